//! Aiming at portals for many paths side by side, compiled for AVX2 too. Twins:
//! `aim_at_portal` and `portal_density` of `lights.rs`, operation by operation.

use super::batch::{Lane, Vectors, at, put};
use aogauge_scenes::Portal;

/// Unit directions from the first `count` origins to random points of random portals, and
/// their cosines with the normals; 0 where there is no direction.
#[inline(always)]
#[allow(clippy::needless_range_loop)] // lanes
pub(super) fn aim(
    portals: &[Portal],
    count: usize,
    [origins, normals]: [&Vectors; 2],
    [u, v]: &[Lane; 2],
    directions: &mut Vectors,
    cosines: &mut Lane,
) {
    let last = portals.len() as i32 - 1;
    for (k, portal) in portals.iter().enumerate() {
        for i in 0..count {
            let stretched = u[i] * portals.len() as f32;
            let index = (stretched as i32).min(last);
            let u = stretched - index as f32;
            let to = portal.corner + portal.u * u + portal.v * v[i] - at(origins, i);
            let before = at(directions, i);
            put(directions, i, if index == k as i32 { to } else { before });
        }
    }
    for i in 0..count {
        let to = at(directions, i);
        let reciprocal = to.length_recip();
        let direction = to * reciprocal;
        put(directions, i, direction);
        let cosine = at(normals, i).dot(direction);
        cosines[i] = if reciprocal.is_finite() & (reciprocal > 0.0) { cosine } else { 0.0 };
    }
}

/// Densities per solid angle with which [`aim`] picks the first `count` directions.
#[inline(always)]
// Lanes; and without branches, which `contains` would bring.
#[allow(clippy::needless_range_loop, clippy::manual_range_contains)]
pub(super) fn densities(
    portals: &[Portal],
    count: usize,
    origins: &Vectors,
    directions: &Vectors,
    densities: &mut Lane,
) {
    *densities = [0.0; super::MOST];
    for p in portals {
        let cross = p.u.cross(p.v);
        let area = cross.length();
        let plane = cross / area;
        for i in 0..count {
            let (origin, direction) = (at(origins, i), at(directions, i));
            let slope = plane.dot(direction);
            let t = plane.dot(p.corner - origin) / slope;
            let place = origin + direction * t - p.corner;
            let a = place.cross(p.v).dot(cross) / (area * area);
            let b = p.u.cross(place).dot(cross) / (area * area);
            let inside = (a >= 0.0) & (a <= 1.0) & (b >= 0.0) & (b <= 1.0);
            let density = t * t / (slope.abs() * area);
            densities[i] += if (t > 0.0) & t.is_finite() & inside { density } else { 0.0 };
        }
    }
    let number = portals.len().max(1) as f32;
    for density in &mut densities[..count] {
        *density /= number;
    }
}
