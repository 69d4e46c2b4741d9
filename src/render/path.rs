//! The judge's path tracer: irradiance from the scene's sky and lamps with diffuse
//! interreflection, unbiased, without a radius, by red, green and blue.
//!
//! Bounces are cosine distributed. At each vertex, where the scene has them, the
//! tracer also aims at a portal and at a surface that glows; whatever light may
//! be found in several ways is weighted by the balance heuristic (Veach 1997,
//! section 9.2). A portal may mark a window or a lamp: aiming at it takes whatever
//! light lies behind. All of this changes the noise, never the mean. Punctual
//! lights can only be aimed at.

mod batch;
#[cfg(test)]
mod one;
mod portals;

use super::{
    Geometry,
    gbuffer::{FAR_AWAY, GBuffer},
    lights::Aim,
    patience::Patience,
    sampler::Sampler,
};
use crate::trace::{Hit, Ray};
use aogauge_scenes::luminance;
use batch::{MOST, Start};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Neighbouring pixels whose paths go together.
const PIXELS: usize = 32;

/// Bounces before Russian roulette begins.
const SURE_BOUNCES: u32 = 3;

/// Pairs of random numbers a bounce.
const PAIRS: u32 = 4;

/// Irradiance over pi at every surface of `gbuffer`, traced through `geometry`,
/// by luminance: 1 under an open sky of radiance 1. NaN where there is no
/// surface.
///
/// The surfaces need not be `geometry`'s own: the twin is traced from the points
/// of the scene with its occluder, with the same random numbers.
pub fn irradiance(geometry: &Geometry, gbuffer: &GBuffer, paths: u32, seed: u32, replicate: u32) -> Vec<f32> {
    colors(geometry, gbuffer, paths, seed, replicate).into_iter().map(luminance).collect()
}

/// [`irradiance`], but None as soon as `go_on` says no: it is asked now and then, by
/// several threads.
pub fn irradiance_while(
    geometry: &Geometry,
    gbuffer: &GBuffer,
    paths: u32,
    seed: u32,
    replicate: u32,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<f32>> {
    let patience = Patience::new(go_on);
    let colors = traced(geometry, gbuffer, [paths, seed, replicate], &patience);
    (!patience.is_over()).then(|| colors.into_iter().map(luminance).collect())
}

/// [`irradiance`] by linear red, green and blue.
pub fn colors(geometry: &Geometry, gbuffer: &GBuffer, paths: u32, seed: u32, replicate: u32) -> Vec<[f32; 3]> {
    traced(geometry, gbuffer, [paths, seed, replicate], &Patience::new(&|| true))
}

/// [`colors`]; NaN where patience is over.
pub(super) fn traced(
    geometry: &Geometry,
    gbuffer: &GBuffer,
    [paths, seed, replicate]: [u32; 3],
    patience: &Patience<'_>,
) -> Vec<[f32; 3]> {
    let mut colors = vec![[f32::NAN; 3]; gbuffer.surfaces.len()];
    let chunks = colors.par_chunks_mut(PIXELS).zip(gbuffer.surfaces.par_chunks(PIXELS)).enumerate();
    chunks.for_each(|(chunk, (colors, surfaces))| {
        let first = chunk * PIXELS;
        let mut batches = Batches::new(geometry);
        let mut shaded = [false; PIXELS];
        for (k, surface) in surfaces.iter().enumerate() {
            let skipped = patience.skips(first + k);
            let Some(s) = surface.as_ref().filter(|_| !skipped) else { continue };
            shaded[k] = true;
            let sampler = Sampler::new(seed, (first + k) as u32, replicate);
            for sample in 0..paths {
                batches.push(k, Start { point: s.point, normal: s.normal, sampler, sample });
                if patience.leaves(sample) {
                    break;
                }
            }
        }
        let sums = batches.finish();
        for (k, color) in colors.iter_mut().enumerate().filter(|(k, _)| shaded[*k]) {
            *color = (sums[k] / f64::from(paths)).as_vec3().to_array();
        }
    });
    colors
}

/// Paths of neighbouring pixels, traced as soon as there are enough to go side by side.
struct Batches<'a> {
    geometry: &'a Geometry,
    starts: Vec<Start>,
    /// Of which pixel each is.
    of: [u8; MOST],
    sums: [DVec3; PIXELS],
}

impl<'a> Batches<'a> {
    fn new(geometry: &'a Geometry) -> Self {
        Batches { geometry, starts: Vec::with_capacity(MOST), of: [0; MOST], sums: [DVec3::ZERO; PIXELS] }
    }

    fn push(&mut self, pixel: usize, start: Start) {
        self.of[self.starts.len()] = pixel as u8;
        self.starts.push(start);
        if self.starts.len() == MOST {
            self.trace();
        }
    }

    /// The light of each pixel, summed in the order of its paths.
    fn finish(mut self) -> [DVec3; PIXELS] {
        self.trace();
        self.sums
    }

    fn trace(&mut self) {
        let mut light = [Vec3::ZERO; MOST];
        batch::trace(self.geometry, &self.starts, &mut light);
        for (light, &pixel) in light.iter().zip(&self.of[..self.starts.len()]) {
            self.sums[usize::from(pixel)] += light.as_dvec3();
        }
        self.starts.clear();
    }
}

/// Light along a way that was aimed, weighted against the other ways to find it.
fn aimed(geometry: &Geometry, origin: Vec3, normal: Vec3, aim: Aim) -> Vec3 {
    let Geometry { tracer, lights, .. } = geometry;
    let cosine = normal.dot(aim.direction);
    if cosine <= 0.0 {
        return Vec3::ZERO;
    }
    let ray = Ray::new(origin, aim.direction, FAR_AWAY);
    let hit = if aim.triangle.is_none() && !lights.has_emitters() {
        // Without lamps any hit will do, and costs less than the closest.
        if tracer.occluded(&ray) {
            return Vec3::ZERO;
        }
        None
    } else {
        tracer.closest(&ray)
    };
    if aim.triangle.is_some() && aim.triangle != hit.map(|h| h.triangle) {
        return Vec3::ZERO;
    }
    let radiance = radiance(geometry, aim.direction, hit.as_ref());
    let aimed = lights.density(origin, aim.direction, hit.as_ref(), radiance);
    if aimed <= 0.0 {
        return Vec3::ZERO;
    }
    let own = cosine / PI;
    radiance * own / (aimed + own)
}

/// What a ray sees that met `hit`, or the sky: its own light, not what it
/// reflects.
fn radiance(geometry: &Geometry, direction: Vec3, hit: Option<&Hit>) -> Vec3 {
    match hit {
        Some(hit) => geometry.emitted(hit.triangle),
        None => Vec3::splat(geometry.environment.sky.radiance(direction)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::lights::Lights;
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

    /// A path from one point by each of `n` samplers.
    fn paths(geometry: &Geometry, point: Vec3, normal: Vec3, n: u32) -> Vec<Vec3> {
        let starts: Vec<_> =
            (0..n).map(|i| Start { point, normal, sampler: Sampler::new(9, i, 0), sample: 0 }).collect();
        let mut light = vec![Vec3::ZERO; starts.len()];
        starts.chunks(MOST).zip(light.chunks_mut(MOST)).for_each(|(s, l)| batch::trace(geometry, s, l));
        light
    }

    fn mean(geometry: &Geometry, point: Vec3, normal: Vec3, n: u32) -> (f64, f64) {
        let values: Vec<f64> =
            paths(geometry, point, normal, n).iter().map(|l| f64::from(luminance(l.to_array()))).collect();
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

    /// A lamp in the ceiling of a closed room: found by chance alone, aimed at,
    /// and aimed at twice over, through a portal that marks it. The same mean,
    /// less noise.
    #[test]
    fn lamps_are_aimed_at() {
        let room = "[[object]]\nname = 'room'\nshape = { block = { min = [-2, 0, -2], max = [2, 2.5, 2] } }\n\
             [[object]]\nname = 'lamp'\nemission = [9, 9, 9]\nshape = { plane = { center = [0, 2.4, 0], u = [0.5, 0, 0], v = [0, 0, 0.5] } }";
        let at = Vec3::new(0.5, 0.0, 0.2);
        let mut by_chance = lit(room, "{}");
        by_chance.lights = Lights::default();
        let (plain, plain_se) = mean(&by_chance, at, Vec3::Y, 60_000);
        let portal = "{ portals = [{ corner = [-0.25, 2.4, -0.25], u = [0.5, 0, 0], v = [0, 0, 0.5] }] }";
        for environment in ["{}", portal] {
            let (m, se) = mean(&lit(room, environment), at, Vec3::Y, 60_000);
            assert!((m - plain).abs() < 5.0 * se.hypot(plain_se), "{m} +- {se}, {plain} +- {plain_se}");
            assert!(se < 0.5 * plain_se, "aiming at the lamp must pay: {se} against {plain_se}");
        }
    }

    /// Direct light of a rectangular lamp 2a x 2b overhead at height h is its form
    /// factor (Hottel): each quarter gives
    /// (A/sqrt(1+A^2) atan(B/sqrt(1+A^2)) + B/sqrt(1+B^2) atan(A/sqrt(1+B^2))) / 2 pi
    /// with A = a/h, B = b/h. However many ways there are to aim at it, the mean is
    /// that, within five standard errors of less than 0.1 %.
    #[test]
    fn a_lamp_gives_its_form_factor() {
        let lamp = "[[object]]\nname = 'floor'\nalbedo = 0\nshape = { plane = { center = [0, 0, 0], u = [0, 0, 9], v = [9, 0, 0] } }\n\
             [[object]]\nname = 'lamp'\nalbedo = 0\nemission = [3, 3, 3]\nshape = { plane = { center = [0, 0.8, 0], u = [1, 0, 0], v = [0, 0, 0.6] } }";
        let (a, b): (f64, f64) = (0.5 / 0.8, 0.3 / 0.8);
        let part = |a: f64, b: f64| a / a.hypot(1.0) * (b / a.hypot(1.0)).atan();
        let expected = 3.0 * 4.0 * (part(a, b) + part(b, a)) / std::f64::consts::TAU;
        let whole = "{ corner = [-0.5, 0.8, -0.3], u = [1, 0, 0], v = [0, 0, 0.6] }";
        let half = "{ corner = [-0.5, 0.8, -0.3], u = [0.5, 0, 0], v = [0, 0, 0.6] }";
        let beside = "{ corner = [0.2, 0.5, -0.3], u = [1, 0, 0], v = [0, 0, 0.6] }";
        for portals in ["", whole, half, beside, &format!("{whole}, {beside}")] {
            let g = lit(lamp, &format!("{{ portals = [{portals}] }}"));
            let (m, se) = mean(&g, Vec3::ZERO, Vec3::Y, 200_000);
            assert!(se < 1e-3 * expected && (m - expected).abs() < 5.0 * se, "{portals}: {m} +- {se}, {expected}");
        }
    }

    /// A point light over a floor: I cos / (pi d^2), of each colour, and none in
    /// the shadow of a block.
    #[test]
    fn a_point_light_gives_its_inverse_square() {
        let mut g = lit(
            "[[object]]\nname = 'floor'\nalbedo = 0\nshape = { plane = { center = [0, 0, 0], u = [0, 0, 40], v = [40, 0, 0] } }\n\
             [[object]]\nname = 'block'\nalbedo = 0\nshape = { block = { min = [1.9, 0.5, -0.2], max = [2.1, 0.6, 0.2] } }",
            "{ gradient = { zenith = 0, horizon = 0, ground = 1 } }",
        );
        g.lights = Lights::of_punctual(vec![aogauge_scenes::Light {
            name: "lamp".into(),
            kind: aogauge_scenes::LightKind::Point,
            position: Vec3::new(1.0, 2.0, 0.0),
            direction: Vec3::NEG_Y,
            color: [1.0, 0.5, 0.25],
            intensity: 30.0,
            range: None,
        }]);
        let light = paths(&g, Vec3::ZERO, Vec3::Y, 1)[0];
        let expected = 30.0 * (2.0 / 5.0f32.sqrt()) / (5.0 * PI);
        for (value, share) in light.to_array().into_iter().zip([1.0, 0.5, 0.25]) {
            assert!((value - expected * share).abs() < 2e-4, "{light}");
        }
        // The ray from the light through the block's middle meets the floor here.
        let shadow = paths(&g, Vec3::new(1.0 + 1.0 * 2.0 / 1.45, 0.0, 0.0), Vec3::Y, 1)[0];
        assert!(shadow.max_element() < 1e-6, "{shadow}");
    }

    /// Red walls around a white floor make it reddish: E/pi by channel in a closed
    /// box whose lower half glows is known where all walls share one albedo.
    #[test]
    fn a_colored_furnace_is_right_in_each_channel() {
        let walls = "[[object]]\nname = 'a'\ncolor = [0.8, 0.4, 0.1]\nemission = [0.1, 0.2, 0.3]\nshape = { block = { min = [-1, -1, -1], max = [1, 1, 1] } }";
        let g = lit(walls, "{}");
        let n = 20_000;
        let paths = paths(&g, Vec3::new(0.2, -1.0, 0.3), Vec3::Y, n);
        for (c, (albedo, emission)) in [(0.8, 0.1), (0.4, 0.2), (0.1, 0.3)].into_iter().enumerate() {
            let values: Vec<f64> = paths.iter().map(|p| f64::from(p[c])).collect();
            let e = crate::stats::Estimate::of_mean(&values);
            let expected = emission / (1.0 - albedo);
            assert!((e.value - expected).abs() < 5.0 * e.se + 1e-6, "channel {c}: {} +- {}, {expected}", e.value, e.se);
        }
    }
}
