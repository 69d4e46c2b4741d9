//! Rays with origins of their own: any-hit for many together, closest hit for one.
//!
//! A ray is tested against eight triangles by the scalar test's own operations in
//! the scalar test's own order, so the bits are the same.

use super::{
    Ray, Tracer,
    lanes::Lanes,
    tree8::{Block, Node8},
    triangle::main_axis,
    walk::{Bundle, Packet, Slopes, any_hit, load3},
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

/// Where a ray meets the eight triangles of a block, within `(0, tmax]`: a bit a
/// triangle, and the distances. Twin: `Ray::meets`.
#[inline(always)]
pub(super) fn meets<L: Lanes>(ray: &Sheared, block: &Block, tmax: f32) -> (u32, L) {
    let [x, y, z] = ray.axes;
    let (ox, oy, oz) = (L::splat(ray.origin[x]), L::splat(ray.origin[y]), L::splat(ray.origin[z]));
    let (sx, sy) = (L::splat(ray.shear.x), L::splat(ray.shear.y));
    let [a, b, c] = &block.corners;
    let (az, bz, cz) = (L::load(&a[z]).sub(oz), L::load(&b[z]).sub(oz), L::load(&c[z]).sub(oz));
    let (ax, ay) = (L::load(&a[x]).sub(ox).sub(sx.mul(az)), L::load(&a[y]).sub(oy).sub(sy.mul(az)));
    let (bx, by) = (L::load(&b[x]).sub(ox).sub(sx.mul(bz)), L::load(&b[y]).sub(oy).sub(sy.mul(bz)));
    let (cx, cy) = (L::load(&c[x]).sub(ox).sub(sx.mul(cz)), L::load(&c[y]).sub(oy).sub(sy.mul(cz)));
    let u = cx.mul(by).sub(cy.mul(bx));
    let v = ax.mul(cy).sub(ay.mul(cx));
    let w = bx.mul(ay).sub(by.mul(ax));
    let zero = L::splat(0.0);
    let inside = zero.le(u.min(v).min(w)) | u.max(v).max(w).le(zero);
    if inside == 0 {
        return (0, zero);
    }
    let det = u.add(v).add(w);
    let t = L::splat(ray.shear.z).mul(u.mul(az).add(v.mul(bz)).add(w.mul(cz))).div(det);
    // Where det is 0, t is infinite or NaN.
    let least = L::splat(f32::from_bits(1));
    (L::le2(least, t, t, L::splat(tmax)) & inside, t)
}

struct Own<'a, L, const N: usize> {
    tracer: &'a Tracer,
    segments: &'a [Segments; N],
    slopes: &'a [Slopes; N],
    lo: [L; 3],
    hi: [L; 3],
}

/// A bit for each segment of `all` that meets a triangle.
#[inline(always)]
pub(super) fn occluded<L: Lanes, const N: usize>(tracer: &Tracer, segments: &[Segments; N], all: u32) -> u32 {
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
    let own = Own {
        tracer,
        segments,
        slopes: &slopes,
        lo: [lo[0].least(), lo[1].least(), lo[2].least()],
        hi: [hi[0].greatest(), hi[1].greatest(), hi[2].greatest()],
    };
    any_hit::<L, _, N>(&tracer.tree, &own, &slopes, all)
}

impl<L: Lanes, const N: usize> Bundle<L> for Own<'_, L, N> {
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
            let ray = Sheared::new(s.origins.get(lane), s.directions.get(lane), inverse);
            let (met, _) = meets::<L>(&ray, block, s.tmax[lane]);
            if met != 0 {
                let ray = Ray::new(s.origins.get(lane), s.directions.get(lane), s.tmax[lane]);
                closed |= u32::from(self.tracer.comes_to_any(block, met, &ray)) << i;
            }
        }
        closed
    }
}
