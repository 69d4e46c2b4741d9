//! What eight rays meet first. Each goes down the tree on its own; what is known of their
//! hits is worked out side by side.

use super::{
    Hit, Tracer,
    free::Segments,
    lanes::Lanes,
    one,
    triangle::Ray,
    walk::{Packet, exact_cross, exact_dot, load3, sub3},
};
use glam::Vec3;

/// The nearest triangles along eight rays.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Hits {
    /// A bit for each ray that meets one; nothing is known of the others.
    pub met: u32,
    /// Distances, metres.
    pub t: [f32; 8],
    /// The triangles, as numbered in [`Tracer::triangles`].
    pub leaves: [u32; 8],
    /// The same, as they were numbered when the tracer was built.
    pub triangles: [u32; 8],
    /// The points, as those of [`Hit`].
    pub points: Packet,
    /// Unit geometric normals, turned against the rays.
    pub normals: Packet,
}

impl Hits {
    /// One of them.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Option<Hit> {
        let lane = lane & 7;
        (self.met >> lane & 1 == 1).then(|| Hit {
            t: self.t[lane],
            triangle: self.triangles[lane],
            leaf: self.leaves[lane],
            point: self.points.get(lane),
            normal: self.normals.get(lane),
        })
    }
}

/// Of the rays in `mask`. Twin: `Tracer::hit`.
#[inline(always)]
#[allow(clippy::needless_range_loop)] // axes
pub(super) fn closest<L: Lanes>(tracer: &Tracer, rays: &Segments, mask: u32) -> Hits {
    let nowhere = Packet([[0.0; 8]; 3]);
    let mut hits = Hits { met: 0, t: [0.0; 8], leaves: [0; 8], triangles: [0; 8], points: nowhere, normals: nowhere };
    let (mut corners, mut weights) = ([nowhere; 3], nowhere);
    for lane in 0..8 {
        if mask >> lane & 1 == 0 {
            continue;
        }
        let ray = Ray::new(rays.origins.get(lane), rays.directions.get(lane), rays.tmax[lane]);
        let Some(met) = one::first::<L, false>(tracer, &ray) else { continue };
        let block = &tracer.tree.blocks[met.block as usize];
        for (to, from) in corners.iter_mut().zip(&block.corners) {
            for axis in 0..3 {
                to.0[axis][lane] = from[axis][met.lane & 7];
            }
        }
        weights.set(lane, met.weights);
        hits.met |= 1 << lane;
        hits.t[lane] = met.t;
        hits.leaves[lane] = block.triangle[met.lane & 7];
        hits.triangles[lane] = tracer.source[hits.leaves[lane] as usize];
    }
    let [a, b, c] = [load3::<L>(&corners[0].0), load3::<L>(&corners[1].0), load3::<L>(&corners[2].0)];
    let w = load3::<L>(&weights.0);
    for axis in 0..3 {
        let point = a[axis].mul(w[0]).add(b[axis].mul(w[1])).add(c[axis].mul(w[2]));
        point.store(&mut hits.points.0[axis]);
    }
    let normal = exact_cross(sub3(b, a), sub3(c, a));
    let reciprocal = L::splat(1.0).div(exact_dot(normal, normal).sqrt());
    let normal = [normal[0].mul(reciprocal), normal[1].mul(reciprocal), normal[2].mul(reciprocal)];
    // Turned where the dot product is above 0.
    let signs = L::splat(0.0).sub(exact_dot(normal, load3::<L>(&rays.directions.0))).signs();
    for axis in 0..3 {
        normal[axis].xor(signs).store(&mut hits.normals.0[axis]);
    }
    // A triangle without area has no normal.
    let mut flat = hits.met & !L::le2(L::splat(f32::from_bits(1)), reciprocal, reciprocal, L::splat(f32::MAX));
    while flat != 0 {
        hits.normals.set(flat.trailing_zeros() as usize, Vec3::ZERO);
        flat &= flat - 1;
    }
    if !tracer.lifts.is_empty() {
        for lane in (0..8).filter(|lane| hits.met >> lane & 1 == 1) {
            let point = tracer.lifted(hits.leaves[lane] as usize, hits.points.get(lane), hits.normals.get(lane));
            hits.points.set(lane, point);
        }
    }
    hits
}
