//! Rays with origins of their own: any-hit for many together, closest hit for one.
//!
//! A ray is tested against eight triangles by the scalar test's own operations in
//! the scalar test's own order, so the bits are the same.

use super::{
    Faces, Ray, Tracer,
    faces::fronts,
    lanes::Lanes,
    tree8::{Block, Node8},
    triangle::main_axis,
    walk::{Bundle, Packet, Slopes, U, any_hit, load3, sub3},
};
use glam::Vec3;

/// Eight rays with origins of their own.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Segments {
    /// Where they start.
    pub origins: Packet,
    /// Unit directions.
    pub directions: Packet,
    /// Lengths.
    pub tmax: [f32; 8],
}

impl Segments {
    /// Room for eight.
    pub const EMPTY: Segments = Segments {
        origins: Packet([[0.0; 8]; 3]),
        directions: Packet([[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]; 3]),
        tmax: [0.0; 8],
    };

    /// Writes one of them.
    #[inline]
    pub fn set(&mut self, lane: usize, origin: Vec3, direction: Vec3, tmax: f32) {
        self.origins.set(lane, origin);
        self.directions.set(lane, direction);
        self.tmax[lane & 7] = tmax;
    }

    /// Fills the lanes past the first `count` with the first, so that they do not
    /// widen the box of all.
    pub fn fill(&mut self, count: usize) {
        let (origin, direction) = (self.origins.get(0), self.directions.get(0));
        for lane in count..8 {
            self.origins.set(lane, origin);
            self.directions.set(lane, direction);
            self.tmax[lane] = self.tmax[0];
        }
    }
}

/// Segments that wait to be traced together.
#[derive(Clone, Debug)]
pub struct Queue {
    segments: [Segments; 4],
    count: usize,
}

impl Default for Queue {
    fn default() -> Self {
        Queue { segments: [Segments::EMPTY; 4], count: 0 }
    }
}

impl Queue {
    /// The most that wait.
    pub const MOST: usize = 32;

    /// How many wait.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether there is no room for another.
    pub fn is_full(&self) -> bool {
        self.count == Self::MOST
    }

    /// Puts one down, which must not be done where the queue is full.
    #[inline]
    pub fn push(&mut self, origin: Vec3, direction: Vec3, tmax: f32) {
        let at = self.count % Self::MOST;
        self.segments[at / 8].set(at % 8, origin, direction, tmax);
        self.count += 1;
    }

    /// Empties the queue: which of those that waited meet anything that turns such a face
    /// against them, a bit each.
    pub fn occluded(&mut self, tracer: &Tracer, faces: Faces) -> u32 {
        let count = std::mem::take(&mut self.count);
        if count == 0 {
            return 0;
        }
        let packs = count.div_ceil(8);
        self.segments[packs - 1].fill(count - 8 * (packs - 1));
        let mask = u32::MAX >> (32 - count);
        let [a, b, c, d] = self.segments;
        match packs {
            1 => tracer.occluded_segments(&[a], mask, faces),
            2 => tracer.occluded_segments(&[a, b], mask, faces),
            3 => tracer.occluded_segments(&[a, b, c, c], mask, faces),
            _ => tracer.occluded_segments(&[a, b, c, d], mask, faces),
        }
    }
}

/// What the triangle test needs of a ray: a part of the scalar one.
#[derive(Clone, Copy)]
pub(super) struct Sheared {
    pub origin: Vec3,
    pub axes: [usize; 3],
    pub shear: Vec3,
}

impl Sheared {
    /// Of a ray and 1/d by axis. Twin: `Ray::new`.
    #[inline(always)]
    pub(super) fn new(origin: Vec3, direction: Vec3, inverse: Vec3) -> Self {
        let z = main_axis(direction);
        let (x, y) = ([1, 2, 0][z], [2, 0, 1][z]);
        let sz = inverse[z];
        Sheared { origin, axes: [x, y, z], shear: Vec3::new(direction[x] * sz, direction[y] * sz, sz) }
    }
}

/// Where a ray meets the eight triangles of a block.
#[derive(Clone, Copy)]
pub(super) struct Crossed<L> {
    /// A bit for each triangle that is met within `(0, tmax]`.
    pub met: u32,
    /// Those of them that are met without rounding, too.
    pub sure: u32,
    /// Distances.
    pub t: L,
    /// Weights of the corners, up to their sum.
    pub volumes: [L; 3],
    /// That sum.
    pub sum: L,
}

/// The rounding of an edge function: see [`Crossed::sure`].
const EDGE: [f32; 2] = [64.0 * U, 16.0 * U];

/// Where a ray meets the eight triangles of a block, within `(0, tmax]`. Twin:
/// `Ray::meets`.
///
/// What is met without rounding within `(0, whole]` lies in its leaf's box, so that the
/// scalar walk comes to it. With u = 2^-24, m the largest coordinate of a triangle's corners
/// relative to the origin, and s the largest sheared one, which is the distance from the ray:
/// - a sheared coordinate errs by 8 u m: 1 for the difference, 2 for the shear, 1 for its
///   product with z that errs by 1, and 2 for the last difference;
/// - so an edge function errs by 32 u m s + 128 u^2 m^2 for its factors and 4 u s^2, at most
///   8 u m s, for its own operations: by less than e = 64 u m (s + 16 u m);
/// - the sum of three by 4 e; the numerator of t, with a shear of at most 1.74, by 8 m e;
/// - t, at most 1.74 m, times the sum by less than 16 m e.
#[inline(always)]
pub(super) fn meets<L: Lanes>(ray: &Sheared, block: &Block, tmax: f32, whole: f32) -> Crossed<L> {
    let [x, y, z] = ray.axes;
    let o = [L::splat(ray.origin[x]), L::splat(ray.origin[y]), L::splat(ray.origin[z])];
    let (sx, sy) = (L::splat(ray.shear.x), L::splat(ray.shear.y));
    let [a, b, c] = &block.corners;
    let a = sub3([L::load(&a[x]), L::load(&a[y]), L::load(&a[z])], o);
    let b = sub3([L::load(&b[x]), L::load(&b[y]), L::load(&b[z])], o);
    let c = sub3([L::load(&c[x]), L::load(&c[y]), L::load(&c[z])], o);
    let (ax, ay) = (a[0].sub(sx.mul(a[2])), a[1].sub(sy.mul(a[2])));
    let (bx, by) = (b[0].sub(sx.mul(b[2])), b[1].sub(sy.mul(b[2])));
    let (cx, cy) = (c[0].sub(sx.mul(c[2])), c[1].sub(sy.mul(c[2])));
    let u = cx.mul(by).sub(cy.mul(bx));
    let v = ax.mul(cy).sub(ay.mul(cx));
    let w = bx.mul(ay).sub(by.mul(ax));
    let zero = L::splat(0.0);
    let inside = zero.le(u.min(v).min(w)) | u.max(v).max(w).le(zero);
    let none = Crossed { met: 0, sure: 0, t: zero, volumes: [u, v, w], sum: zero };
    if inside == 0 {
        return none;
    }
    let sum = u.add(v).add(w);
    let t = L::splat(ray.shear.z).mul(u.mul(a[2]).add(v.mul(b[2])).add(w.mul(c[2]))).div(sum);
    // Where the sum is 0, t is infinite or NaN.
    let met = L::le2(L::splat(f32::from_bits(1)), t, t, L::splat(tmax)) & inside;
    if met == 0 {
        return none;
    }
    let m = largest(a).max(largest(b)).max(largest(c));
    let s = largest([ax, bx, cx]).max(largest([ay, by, cy]));
    let edge = L::splat(EDGE[0]).mul(m).mul(s.add(L::splat(EDGE[1]).mul(m)));
    let depth = L::splat(16.0).mul(m).mul(edge);
    let (least, size) = (u.abs().min(v.abs()).min(w.abs()), sum.abs());
    let sure = L::le2(edge, least, depth, t.mul(size)) & depth.le(L::splat(whole).sub(t).mul(size));
    Crossed { met, sure: met & sure, t, volumes: [u, v, w], sum }
}

/// The largest without sign, lane by lane.
#[inline(always)]
fn largest<L: Lanes>(v: [L; 3]) -> L {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
}

struct Own<'a, L, const N: usize, const FRONTS: bool> {
    tracer: &'a Tracer,
    segments: &'a [Segments; N],
    slopes: &'a [Slopes; N],
    lo: [L; 3],
    hi: [L; 3],
}

/// A bit for each segment of `all` that meets a triangle.
#[inline(always)]
pub(super) fn occluded<L: Lanes, const N: usize, const FRONTS: bool>(
    tracer: &Tracer,
    segments: &[Segments; N],
    all: u32,
) -> u32 {
    let mut slopes = [Slopes([[0.0; 8]; 7]); N];
    let (mut lo, mut hi) = ([L::splat(f32::INFINITY); 3], [L::splat(f32::NEG_INFINITY); 3]);
    for (slopes, s) in slopes.iter_mut().zip(segments) {
        let (o, d, t) = (load3::<L>(&s.origins.0), load3::<L>(&s.directions.0), L::load(&s.tmax));
        *slopes = Slopes::new(d, o, t);
        for axis in 0..3 {
            let end = o[axis].add(d[axis].mul(t));
            lo[axis] = lo[axis].min(o[axis].min(end));
            hi[axis] = hi[axis].max(o[axis].max(end));
        }
    }
    // The ends err by less than the boxes' padding.
    let own = Own::<L, N, FRONTS> {
        tracer,
        segments,
        slopes: &slopes,
        lo: [lo[0].least(), lo[1].least(), lo[2].least()],
        hi: [hi[0].greatest(), hi[1].greatest(), hi[2].greatest()],
    };
    any_hit::<L, _, N>(&tracer.tree, &own, &slopes, all)
}

impl<L: Lanes, const N: usize, const FRONTS: bool> Bundle<L> for Own<'_, L, N, FRONTS> {
    /// Boxes that overlap the box of all.
    #[inline(always)]
    fn near(&self, node: &Node8) -> (u32, u32) {
        let [x0, y0, z0, x1, y1, z1] = &node.planes;
        (
            L::le2(L::load(x0), self.hi[0], self.lo[0], L::load(x1))
                & L::le2(L::load(y0), self.hi[1], self.lo[1], L::load(y1))
                & L::le2(L::load(z0), self.hi[2], self.lo[2], L::load(z1)),
            0,
        )
    }

    #[inline(always)]
    fn meets(&self, block: &Block, mask: u32) -> u32 {
        let mut closed = 0;
        let mut left = mask;
        while left != 0 {
            let i = left.trailing_zeros() as usize & 31;
            left &= left - 1;
            let packet = if N == 1 { 0 } else { i / 8 % N };
            let (s, lane) = (&self.segments[packet], i & 7);
            let [x, y, z, ..] = &self.slopes[packet].0;
            let inverse = Vec3::new(x[lane], y[lane], z[lane]);
            let direction = s.directions.get(lane);
            let ray = Sheared::new(s.origins.get(lane), direction, inverse);
            let tmax = s.tmax[lane];
            let Crossed { mut met, mut sure, .. } = meets::<L>(&ray, block, tmax, tmax);
            if FRONTS && met != 0 {
                met = fronts::<L>(block, met, direction);
                sure &= met;
            }
            if sure != 0 {
                closed |= 1 << i;
            } else if met != 0 {
                let ray = Ray::new(s.origins.get(lane), direction, tmax);
                closed |= u32::from(self.tracer.comes_to_any(block, met, &ray)) << i;
            }
        }
        closed
    }
}
