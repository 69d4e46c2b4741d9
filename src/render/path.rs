//! The judge's path tracer: irradiance from the scene's sky and lamps with diffuse
//! interreflection, unbiased, without a radius.
//!
//! Bounces are cosine distributed; where the scene names portals, each vertex
//! also aims at one, and the two ways are weighted by the balance heuristic
//! (Veach 1997, section 9.2). Either way a ray takes whatever it meets, sky or
//! lamp, so a portal may mark a window or a lamp. Portals change the noise, never
//! the mean.

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

/// One path from a surface to the light: an estimate of irradiance over pi.
fn path(geometry: &Geometry, point: Vec3, normal: Vec3, sampler: &Sampler, index: u32) -> f64 {
    let offset = geometry.tracer.offset();
    let (mut point, mut normal) = (point, normal);
    let mut throughput = 1.0f64;
    let mut sum = 0.0;
    for bounce in 0u32.. {
        let origin = point + normal * offset;
        sum += throughput * aimed(geometry, origin, normal, sampler.pair(index, 3 * bounce));
        let [u, v] = sampler.pair(index, 3 * bounce + 1);
        let [cos_phi, sin_phi] = turn(v);
        let [t, b] = tangents(normal);
        let cosine = (1.0 - u).sqrt();
        let direction = (t * cos_phi + b * sin_phi) * u.sqrt() + normal * cosine;
        // The share that the bounce has in light which aiming could have found.
        let weight = || {
            let density = cosine / std::f32::consts::PI;
            f64::from(density / (density + portal_density(geometry, origin, direction)))
        };
        let Some(hit) = geometry.tracer.closest(&Ray::new(origin, direction, FAR_AWAY)) else {
            let sky = geometry.environment.sky.radiance(direction);
            return sum + throughput * f64::from(sky) * weight();
        };
        let emitted = geometry.emitted(hit.triangle);
        if emitted > 0.0 {
            sum += throughput * f64::from(emitted) * weight();
        }
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

/// Light that comes straight from or through a portal picked at random, weighted
/// against the bounce that could have found it.
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
    if aimed <= 0.0 {
        return 0.0;
    }
    let radiance = arriving(geometry, &Ray::new(origin, direction, FAR_AWAY));
    f64::from(radiance) * f64::from(bounced / (aimed + bounced))
}

/// Radiance that arrives against a ray straight from a lamp or the sky.
fn arriving(geometry: &Geometry, ray: &Ray) -> f32 {
    let sky = geometry.environment.sky.radiance(ray.direction);
    if geometry.emission.is_empty() {
        // Without lamps any hit will do, and costs less than the closest.
        return if geometry.tracer.occluded(ray) { 0.0 } else { sky };
    }
    geometry.tracer.closest(ray).map_or(sky, |hit| geometry.emitted(hit.triangle))
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
        lit(objects, &format!("{{ radiance = 2.0, portals = [{portals}] }}"))
    }

    fn lit(objects: &str, environment: &str) -> Geometry {
        let text = format!(
            r#"
description = "test"
ao = {{ radius = 20 }}
environment = {environment}
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

    /// On open ground, E/pi is the integral of 2 y L(y) over the sine y of the
    /// elevation: horizon/3 + zenith 2/3. Five standard errors.
    #[test]
    fn a_gradient_sky_gives_open_ground_its_closed_form() {
        let g = lit(
            "[[object]]\nname = 'a'\nshape = { plane = { center = [0, 0, 0], u = [0, 0, 9], v = [9, 0, 0] } }",
            "{ gradient = { zenith = 1.0, horizon = 0.4, ground = 7.0 } }",
        );
        let (m, se) = mean(&g, Vec3::ZERO, Vec3::Y, 20_000);
        assert!((m - 0.8).abs() < 5.0 * se && se < 0.01, "{m} +- {se}");
    }

    /// A closed box that glows with e and reflects a everywhere: each point
    /// receives E/pi = e + a E/pi, so E/pi = e / (1 - a). Five standard errors;
    /// with a portal on one wall too.
    #[test]
    fn a_furnace_is_as_bright_as_its_closed_form() {
        let walls = "[[object]]\nname = 'a'\nalbedo = 0.6\nemission = [0.5, 0.5, 0.5]\nshape = { block = { min = [-1, -1, -1], max = [1, 1, 1] } }";
        for environment in ["{}", "{ portals = [{ corner = [-1, 1, -1], u = [2, 0, 0], v = [0, 0, 2] }] }"] {
            let g = lit(walls, environment);
            let (m, se) = mean(&g, Vec3::new(0.2, -1.0, 0.3), Vec3::Y, 40_000);
            let expected = 0.5 / (1.0 - 0.6);
            assert!((m - expected).abs() < 5.0 * se + 1e-6 && se < 0.01, "{environment}: {m} +- {se}");
        }
    }

    /// A lamp in the ceiling of a closed room, aimed at and not: the same mean,
    /// less noise.
    #[test]
    fn a_portal_may_mark_a_lamp() {
        let room = "[[object]]\nname = 'room'\nshape = { block = { min = [-2, 0, -2], max = [2, 2.5, 2] } }\n\
             [[object]]\nname = 'lamp'\nemission = [9, 9, 9]\nshape = { plane = { center = [0, 2.4, 0], u = [0.5, 0, 0], v = [0, 0, 0.5] } }";
        let at = Vec3::new(0.5, 0.0, 0.2);
        let (plain, plain_se) = mean(&lit(room, "{}"), at, Vec3::Y, 120_000);
        let portal = "{ portals = [{ corner = [-0.25, 2.4, -0.25], u = [0.5, 0, 0], v = [0, 0, 0.5] }] }";
        let (m, se) = mean(&lit(room, portal), at, Vec3::Y, 60_000);
        assert!((m - plain).abs() < 5.0 * se.hypot(plain_se), "{m} +- {se}, {plain} +- {plain_se}");
        assert!(se < 0.6 * plain_se, "aiming at the lamp must pay: {se} against {plain_se}");
    }
}
