//! The judge's path tracer: irradiance from the scene's environment with diffuse
//! interreflection, unbiased, without a radius.
//!
//! Bounces are cosine distributed; where the scene names portals, each vertex
//! also aims at one, and the two ways are weighted by the balance heuristic
//! (Veach 1997, section 9.2). Portals change the noise, never the mean.

use super::{
    Geometry,
    ao::tangents,
    gbuffer::{FAR_AWAY, GBuffer},
    sampler::{Sampler, turn},
};
use crate::trace::Ray;
use glam::Vec3;
use rayon::prelude::*;

/// Bounces before Russian roulette begins.
const SURE_BOUNCES: u32 = 3;

/// Irradiance over pi at every surface of `gbuffer`, traced through `geometry`:
/// 1 under an open sky of radiance 1. NaN where there is no surface.
///
/// The surfaces need not be `geometry`'s own: the twin is traced from the points
/// of the scene with its occluder, with the same random numbers.
pub fn irradiance(geometry: &Geometry, gbuffer: &GBuffer, paths: u32, seed: u32, replicate: u32) -> Vec<f32> {
    gbuffer
        .surfaces
        .par_iter()
        .enumerate()
        .with_min_len(32)
        .map(|(pixel, surface)| {
            surface.map_or(f32::NAN, |s| {
                let sampler = Sampler::new(seed, pixel as u32, replicate);
                let sum: f64 = (0..paths).map(|i| path(geometry, s.point, s.normal, &sampler, i)).sum();
                (sum / f64::from(paths)) as f32
            })
        })
        .collect()
}

/// One path from a surface to the sky: an estimate of irradiance over pi.
fn path(geometry: &Geometry, point: Vec3, normal: Vec3, sampler: &Sampler, index: u32) -> f64 {
    let sky = f64::from(geometry.environment.radiance);
    let offset = geometry.tracer.offset();
    let (mut point, mut normal) = (point, normal);
    let mut throughput = 1.0f64;
    let mut sum = 0.0;
    for bounce in 0u32.. {
        let origin = point + normal * offset;
        sum += throughput * sky * aimed(geometry, origin, normal, sampler.pair(index, 3 * bounce));
        let [u, v] = sampler.pair(index, 3 * bounce + 1);
        let [cos_phi, sin_phi] = turn(v);
        let [t, b] = tangents(normal);
        let cosine = (1.0 - u).sqrt();
        let direction = (t * cos_phi + b * sin_phi) * u.sqrt() + normal * cosine;
        let Some(hit) = geometry.tracer.closest(&Ray::new(origin, direction, FAR_AWAY)) else {
            let density = cosine / std::f32::consts::PI;
            let weight = density / (density + portal_density(geometry, origin, direction));
            return sum + throughput * sky * f64::from(weight);
        };
        let albedo = geometry.albedo[hit.triangle as usize];
        if albedo <= 0.0 {
            return sum;
        }
        throughput *= f64::from(albedo);
        if bounce >= SURE_BOUNCES {
            // Below 1 even for an albedo near 1, so that every path ends.
            let survival = albedo.min(0.95);
            if sampler.pair(index, 3 * bounce + 2)[0] >= survival {
                return sum;
            }
            throughput /= f64::from(survival);
        }
        (point, normal) = (hit.point, hit.normal);
    }
    sum
}

/// Light that comes straight through a portal picked at random, for a sky of
/// radiance 1, weighted against the bounce that could have found it.
fn aimed(geometry: &Geometry, origin: Vec3, normal: Vec3, [u, v]: [f32; 2]) -> f64 {
    let portals = &geometry.environment.portals;
    if portals.is_empty() {
        return 0.0;
    }
    let stretched = u * portals.len() as f32;
    let pick = (stretched as usize).min(portals.len() - 1);
    let portal = &portals[pick];
    let to = portal.corner + portal.u * (stretched - pick as f32) + portal.v * v - origin;
    let Some(direction) = to.try_normalize() else {
        return 0.0;
    };
    let cosine = normal.dot(direction);
    if cosine <= 0.0 {
        return 0.0;
    }
    let aimed = portal_density(geometry, origin, direction);
    let bounced = cosine / std::f32::consts::PI;
    if aimed <= 0.0 || geometry.tracer.occluded(&Ray::new(origin, direction, FAR_AWAY)) {
        return 0.0;
    }
    f64::from(bounced / (aimed + bounced))
}

/// Density per solid angle with which aiming at a random point of a random
/// portal picks this direction.
fn portal_density(geometry: &Geometry, origin: Vec3, direction: Vec3) -> f32 {
    let portals = &geometry.environment.portals;
    let mut density = 0.0;
    for p in portals {
        let cross = p.u.cross(p.v);
        let area = cross.length();
        let plane = cross / area;
        let slope = plane.dot(direction);
        let t = plane.dot(p.corner - origin) / slope;
        if !(t > 0.0 && t.is_finite()) {
            continue;
        }
        let at = origin + direction * t - p.corner;
        // Coordinates in the parallelogram, by Cramer's rule in its plane.
        let a = at.cross(p.v).dot(cross) / (area * area);
        let b = p.u.cross(at).dot(cross) / (area * area);
        if (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b) {
            density += t * t / (slope.abs() * area);
        }
    }
    density / portals.len().max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use aogauge_scenes::Scene;

    fn scene(objects: &str, portals: &str) -> Geometry {
        let text = format!(
            r#"
description = "test"
ao = {{ radius = 0.25 }}
environment = {{ radiance = 2.0, portals = [{portals}] }}
measure = {{ center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 0.1, resolution = [16, 16] }}
look = {{ eye = [1, 1, 1], target = [0, 0, 0], resolution = [16, 16] }}
{objects}"#
        );
        Geometry::new(&Scene::from_toml("test", "test.toml", &text, None).unwrap()).unwrap()
    }

    fn mean(geometry: &Geometry, point: Vec3, normal: Vec3, n: u32) -> (f64, f64) {
        let values: Vec<f64> = (0..n).map(|i| path(geometry, point, normal, &Sampler::new(9, i, 0), 0)).collect();
        let mean = values.iter().sum::<f64>() / f64::from(n);
        let var = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(n - 1);
        (mean, (var / f64::from(n)).sqrt())
    }

    #[test]
    fn open_ground_receives_the_whole_sky() {
        let g = scene(
            "[[object]]\nname = 'a'\nshape = { plane = { center = [0, 0, 0], u = [0, 0, 9], v = [9, 0, 0] } }",
            "",
        );
        let (m, _) = mean(&g, Vec3::ZERO, Vec3::Y, 100);
        assert!((m - 2.0).abs() < 1e-6, "{m}");
    }

    /// A floor before an infinitely long, tall wall of albedo a under a uniform
    /// sky. Both see each other with the form factor of two half planes at a
    /// right angle, so at the edge E/pi solves e = 1/2 + a e/2: e = 1/(2 - a)
    /// there, in the limit. Five standard errors.
    #[test]
    fn interreflection_in_a_corner_matches_the_limit_at_the_edge() {
        let g = scene(
            "[[object]]\nname = 'a'\nalbedo = 0.6\nshape = { plane = { center = [5000, 0, 0], u = [0, 0, 20000], v = [10000, 0, 0] } }\n\
             [[object]]\nname = 'b'\nalbedo = 0.6\nshape = { plane = { center = [0, 5000, 0], u = [0, 10000, 0], v = [0, 0, 20000] } }",
            "",
        );
        let (m, se) = mean(&g, Vec3::new(1.0, 0.0, 0.0), Vec3::Y, 60_000);
        let expected = 2.0 / (2.0 - 0.6);
        assert!((m - expected).abs() < 5.0 * se && se < 0.01, "{m} +- {se}, expected {expected}");
    }

    /// Portals change the noise, never the mean: the room's floor with and
    /// without its portal, and with one that covers half the window, within five
    /// standard errors.
    #[test]
    fn portals_do_not_change_the_mean() {
        let room = "[[object]]\nname = 'room'\nshape = { room = { width = 5, height = 2.6, depth = 4, window = { sill = 0.9, height = 1.2, width = 1.6 } } }";
        let full = "{ corner = [2.5, 0.9, -0.8], u = [0, 1.2, 0], v = [0, 0, 1.6] }";
        let half = "{ corner = [2.5, 0.9, -0.8], u = [0, 0.6, 0], v = [0, 0, 1.6] }";
        let at = Vec3::new(0.5, 0.0, 0.2);
        let (plain, plain_se) = mean(&scene(room, ""), at, Vec3::Y, 120_000);
        for portals in [full.to_owned(), half.to_owned(), format!("{half}, {full}")] {
            let (m, se) = mean(&scene(room, &portals), at, Vec3::Y, 60_000);
            assert!(
                (m - plain).abs() < 5.0 * (se * se + plain_se * plain_se).sqrt(),
                "{m} +- {se}, {plain} +- {plain_se}"
            );
            if portals == full {
                assert!(se < 0.6 * plain_se, "aiming at the window must pay: {se} against {plain_se}");
            }
        }
    }
}
