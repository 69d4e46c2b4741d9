//! Any-hit for rays that share their origin and length: AO's.
//!
//! A triangle's three edges give cross products of its corners relative to the
//! origin, which all rays share; a ray then costs three dot products for eight
//! triangles. Fused or not, these signed volumes decide only what no rounding can
//! change: a triangle that is clearly missed, or clearly met. Between the two the
//! scalar test decides. So the answer is the scalar test's, ray by ray, on any
//! machine.
//!
//! The bounds, with u = 2^-24, unit directions, and m the largest coordinate of a
//! block's corners relative to the origin, to first order:
//! - the scalar test: its shear errs by 2.5 u, a sheared corner by 5.5 u m, an edge
//!   function (corners up to 2 m) by 44 u m^2, and it is 0 or of the right sign
//!   beyond 8 u m^2 more: 52 u m^2;
//! - here: a component of a cross product errs by 4 u m^2, times the sum of |d| of
//!   up to 1.74, and the dot product's own rounding: 17 u m^2;
//! - so beyond 72 u m^2 both say the same ([`EDGE`]);
//! - the scalar numerator of t errs by 250 u m^3, the volume here by 28 u m^3
//!   ([`VOLUME`]); the determinants times tmax, and their rounding, by
//!   400 u m^2 tmax ([`REACH`]).
//!
//! Boxes are passed over by what their own test would say. One that lies wholly behind
//! the plane of the origin holds no point of any ray, because none goes against the
//! normal. Rounded, the scalar test of it might say otherwise where it lies behind by
//! no more than 1.7e-6 tmax: four operations on each coordinate. The height above the
//! plane errs by 14 u of the largest coordinate. Beyond both together ([`BEHIND`]) the
//! scalar walk would turn away, too.

use super::{
    Faces, Ray, Tracer,
    faces::fronts,
    free::{self, Crossed, Sheared},
    lanes::Lanes,
    tree8::{Block, Node8},
    triangle::main_axis,
    walk::{Bundle, Packet, Slopes, U, any_hit, exact_dot, load3, splat3, sub3},
};
use glam::Vec3;

const EDGE: f32 = 72.0 * U;
const VOLUME: f32 = 288.0 * U;
const REACH: f32 = 400.0 * U;

/// By how much a box must lie behind the fan's plane to be passed over, as a share of
/// the largest coordinate and of the length.
const BEHIND: [f32; 2] = [16.0 * U, 2e-6];

/// Where rays leave from together, and how far they look.
#[derive(Clone, Copy, Debug)]
pub struct Fan {
    /// Where they start.
    pub origin: Vec3,
    /// Unit normal; no ray goes against it.
    pub normal: Vec3,
    /// Length, metres; a hit at exactly this distance counts.
    pub tmax: f32,
    /// Which side of a triangle closes a ray.
    pub faces: Faces,
}

struct Shared<'a, L, const N: usize, const FRONTS: bool> {
    tracer: &'a Tracer,
    fan: &'a Fan,
    rays: &'a [Packet; N],
    origin: [L; 3],
    normal: [L; 3],
    behind: L,
    tmax: L,
    reach2: L,
}

/// A bit for each ray of `all` that meets a triangle: lane by lane, packet by packet.
#[inline(always)]
pub(super) fn occluded<L: Lanes, const N: usize, const FRONTS: bool>(
    tracer: &Tracer,
    fan: &Fan,
    rays: &[Packet; N],
    all: u32,
) -> u32 {
    // Six operations round.
    let reach = fan.tmax * (1.0 + 1e-5);
    let largest = tracer.magnitude.max(fan.origin.abs().max_element());
    let shared = Shared::<L, N, FRONTS> {
        tracer,
        fan,
        rays,
        origin: splat3(fan.origin),
        normal: splat3(fan.normal),
        behind: L::splat(-(BEHIND[0] * largest + BEHIND[1] * fan.tmax)),
        tmax: L::splat(fan.tmax),
        reach2: L::splat(reach * reach),
    };
    let mut slopes = [Slopes([[0.0; 8]; 7]); N];
    for (slopes, ray) in slopes.iter_mut().zip(rays) {
        *slopes = Slopes::new(load3::<L>(&ray.0), shared.origin, shared.tmax);
    }
    any_hit::<L, _, N>(&tracer.tree, &shared, &slopes, all)
}

/// How far a coordinate lies outside an interval.
#[inline(always)]
fn gap<L: Lanes>(lo: &[f32; 8], hi: &[f32; 8], o: L) -> L {
    L::load(lo).sub(o).max(o.sub(L::load(hi))).max(L::splat(0.0))
}

#[inline(always)]
fn dot<L: Lanes>(p: [L; 3], q: [L; 3]) -> L {
    p[0].mul_add(q[0], p[1].mul_add(q[1], p[2].mul(q[2])))
}

#[inline(always)]
fn cross<L: Lanes>(p: [L; 3], q: [L; 3]) -> [L; 3] {
    [p[1].mul_sub(q[2], p[2].mul(q[1])), p[2].mul_sub(q[0], p[0].mul(q[2])), p[0].mul_sub(q[1], p[1].mul(q[0]))]
}

#[inline(always)]
fn turned<L: Lanes>(n: [L; 3], signs: L) -> [L; 3] {
    [n[0].xor(signs), n[1].xor(signs), n[2].xor(signs)]
}

impl<L: Lanes, const N: usize, const FRONTS: bool> Bundle<L> for Shared<'_, L, N, FRONTS> {
    /// Boxes within tmax of the origin and not wholly behind the plane; all rays come to
    /// those that hold the origin.
    #[inline(always)]
    fn near(&self, node: &Node8) -> (u32, u32) {
        let [x0, y0, z0, x1, y1, z1] = &node.planes;
        let [x, y, z] = self.origin;
        let g = [gap(x0, x1, x), gap(y0, y1, y), gap(z0, z1, z)];
        // The corner of a box furthest along the normal.
        let n = self.fan.normal;
        let corner = [
            L::load(if n.x > 0.0 { x1 } else { x0 }),
            L::load(if n.y > 0.0 { y1 } else { y0 }),
            L::load(if n.z > 0.0 { z1 } else { z0 }),
        ];
        let height = exact_dot(self.normal, sub3(corner, self.origin));
        let d = exact_dot(g, g);
        let near = L::le2(d, self.reach2, self.behind, height);
        (near, near & d.le(L::splat(0.0)))
    }

    #[inline(always)]
    fn meets(&self, block: &Block, mask: u32) -> u32 {
        let volumes = Volumes::new(block, self.origin, self.fan);
        let mut closed = 0;
        let mut left = mask;
        while left != 0 {
            let i = left.trailing_zeros() as usize & 31;
            left &= left - 1;
            let direction = self.rays[if N == 1 { 0 } else { i / 8 % N }].get(i);
            let (met, unsure) = volumes.meets::<FRONTS>(block, direction, self.tmax);
            if met || unsure != 0 && confirm::<L>(self.tracer, block, unsure, self.fan, direction) {
                closed |= 1 << i;
            }
        }
        closed
    }
}

/// What all rays from one point share at a block: twice the areas that its triangles'
/// edges span with the origin, as vectors, and six times the volumes.
struct Volumes<L> {
    edges: [[L; 3]; 3],
    /// Volumes that are surely smaller and surely larger than a triangle's.
    least: L,
    most: L,
    /// What is surely inside of an edge; the negative is surely outside.
    edge: L,
    minus_edge: L,
    /// Triangles in whose plane the origin lies, as far as one can tell.
    flat: u32,
    /// Smallest and largest corner of those, relative to the origin.
    lo: [L; 3],
    hi: [L; 3],
}

impl<L: Lanes> Volumes<L> {
    #[inline(always)]
    fn new(block: &Block, origin: [L; 3], fan: &Fan) -> Self {
        let [lo, hi] = &block.bounds;
        let lo = Vec3::new(lo[0], lo[1], lo[2]) - fan.origin;
        let hi = Vec3::new(hi[0], hi[1], hi[2]) - fan.origin;
        let m = lo.abs().max(hi.abs()).max_element();
        let (m2, m3) = (m * m, m * m * m);

        let a = sub3(load3::<L>(&block.corners[0]), origin);
        let b = sub3(load3::<L>(&block.corners[1]), origin);
        let c = sub3(load3::<L>(&block.corners[2]), origin);
        // Six times the volume over the triangle, and turned so that it is positive: a
        // ray then meets the triangle where all edges are.
        let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
        let volume = dot(a, bc);
        let signs = volume.signs();
        let volume = volume.xor(signs);
        let mut flat = volume.le(L::splat(VOLUME * m3));
        let (mut lo, mut hi) = (a, a);
        if flat != 0 {
            // By the triangles' own coordinates, not the block's.
            for axis in 0..3 {
                lo[axis] = a[axis].min(b[axis]).min(c[axis]);
                hi[axis] = a[axis].max(b[axis]).max(c[axis]);
            }
            let most = hi[0].abs().max(lo[0].abs()).max(hi[1].abs().max(lo[1].abs()));
            let m = most.max(hi[2].abs().max(lo[2].abs()));
            flat &= volume.le(m.mul(m).mul(m).mul(L::splat(VOLUME)));
        }
        let slack = L::splat(VOLUME * m3 + REACH * m2 * fan.tmax);
        Volumes {
            edges: [turned(bc, signs), turned(ca, signs), turned(ab, signs)],
            least: volume.sub(slack),
            most: volume.add(slack),
            edge: L::splat(EDGE * m2),
            minus_edge: L::splat(-EDGE * m2),
            flat,
            lo,
            hi,
        }
    }

    /// Whether a ray surely meets a triangle, and which it may meet.
    #[inline(always)]
    fn meets<const FRONTS: bool>(&self, block: &Block, direction: Vec3, tmax: L) -> (bool, u32) {
        let d = splat3::<L>(direction);
        let [bc, ca, ab] = self.edges;
        let (u, v, w) = (dot(d, bc), dot(d, ca), dot(d, ab));
        let least = u.min(v).min(w);
        // t = volume / (u + v + w) <= tmax, without the division.
        let bound = u.add(v).add(w).mul(tmax);
        let mut clear = !self.flat;
        let mut maybe = L::le2(self.minus_edge, least, self.least, bound) & clear;
        if FRONTS && maybe != 0 {
            maybe = fronts::<L>(block, maybe, direction);
            clear = maybe;
        }
        if maybe != 0 && L::le2(self.edge, least, self.most, bound) & clear != 0 {
            return (true, 0);
        }
        if self.flat == 0 {
            return (false, maybe);
        }
        // Not clearly on both sides of the edges.
        let mut flat = (self.minus_edge.le(least) | u.max(v).max(w).le(self.edge)) & self.flat;
        if flat != 0 {
            // No corner is in front along the axis that the scalar test divides by: then
            // its t, rounded or not, is not above 0.
            let z = main_axis(direction);
            let zero = L::splat(0.0);
            flat &= !if direction[z] > 0.0 { self.hi[z].le(zero) } else { zero.le(self.lo[z]) };
            if FRONTS {
                flat = fronts::<L>(block, flat, direction);
            }
        }
        (false, maybe | flat)
    }
}

/// The scalar test on the triangles in `lanes`.
#[inline(always)]
fn confirm<L: Lanes>(tracer: &Tracer, block: &Block, lanes: u32, fan: &Fan, direction: Vec3) -> bool {
    let ray = Sheared::new(fan.origin, direction, 1.0 / direction);
    let Crossed { met, sure, .. } = free::meets::<L>(&ray, block, fan.tmax, fan.tmax);
    let met = met & lanes;
    sure & met != 0 || met != 0 && tracer.comes_to_any(block, met, &Ray::new(fan.origin, direction, fan.tmax))
}
