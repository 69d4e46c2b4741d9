//! The CPU renderer against closed forms and quadrature: openness of single
//! points statistically, highlight contrast by rendering.

use aogauge::{
    flatland::Slab,
    metrics::{
        artifact::{Converged, Method},
        regions::Regions,
    },
    render::{
        Estimator, Falloff, Geometry, Job, Openness, ReceiverPlane, Renderer, ao::Shading, cpu::Cpu, gbuffer::GBuffer,
        sampler::Sampler,
    },
    scenes::Scene,
    stats::{Estimate, sidak_alpha, upper_tail},
    trace::Ray,
};
use glam::Vec3;
use serde_json::Value;

const CLASSIC: Estimator = Estimator::CLASSIC;
const CLIPPED: Estimator = Estimator::extended(ReceiverPlane::Clipped);
const COUNTS: Estimator = Estimator::extended(ReceiverPlane::Counts);

/// Eq. 2 with the reference's extinction, 0.12 a centimetre.
const OBSCURANCE: Estimator = Estimator::Openness(Openness::plain(Falloff::Exponential { extinction: 12.0 }));

/// Column of the reference, estimator, R'/R.
const METHODS: [(&str, Estimator, f32); 6] = [
    ("ext_exp_c", OBSCURANCE, 0.25),
    ("ext_c", CLASSIC, 0.25),
    ("ext2_c_R8_g0", CLIPPED, 0.125),
    ("ext2_c_R8_g1", COUNTS, 0.125),
    ("ext2_c_R4_g0", CLIPPED, 0.25),
    ("ext2_c_R4_g1", COUNTS, 0.25),
];

fn method(estimator: Estimator) -> Openness {
    match estimator {
        Estimator::Openness(method) => method,
        other => panic!("{other:?} is not openness"),
    }
}

fn reference(text: &str) -> Vec<Value> {
    let all: Value = serde_json::from_str(text).unwrap();
    assert_eq!((all["R"].as_f64(), all["h"].as_f64()), (Some(25.0), Some(100.0)));
    all["rows"].as_array().unwrap().clone()
}

/// The reference's scene in metres; it gives centimetres.
fn scene(row: &Value) -> Scene {
    let (w, m) = (row["w"].as_f64().unwrap() / 100.0, row["m"].as_f64().unwrap() / 100.0);
    let text = format!(
        r#"
description = "oracle"
ao = {{ radius = 0.25 }}
environment = {{ radiance = 1.0 }}
measure = {{ center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = {}, resolution = [208, 32] }}
look = {{ eye = [1, 1, 1], target = [0, 0, 0], resolution = [16, 16] }}
[[object]]
name = "ground"
shape = {{ plane = {{ center = [0, 0, 0], u = [0, 0, 6], v = [6, 0, 0] }} }}
[[object]]
name = "box"
occluder = true
shape = {{ curtain = {{ thickness = {w}, gap = {m}, height = 1.0, length = 6.0 }} }}
"#,
        0.8 * m
    );
    Scene::from_toml("oracle", "oracle.toml", &text, None).unwrap()
}

/// Openness of one point of the ground, over replicates.
fn render_point(geometry: &Geometry, scene: &Scene, t: f32, estimator: Estimator, ratio: f32, salt: u32) -> Estimate {
    let mut ao = scene.ao;
    ao.secondary_radius = ratio * ao.radius;
    let shading = Shading::new(&geometry.tracer, Vec3::new(t, 0.0, 0.1), Vec3::Y, ao, method(estimator));
    let rays = 512;
    let values: Vec<f64> =
        (0..64).map(|replicate| f64::from(shading.openness(rays, &Sampler::new(11, salt, replicate)).0)).collect();
    Estimate::of_mean(&values)
}

/// Mistakes that the comparison must find.
#[derive(Clone, Copy, PartialEq)]
enum Mistake {
    /// Secondary rays go one way from the middle only.
    OneSided,
    /// Directions are uniform over the hemisphere, not cosine distributed.
    Uniform,
}

/// Openness over one replicate with a mistake in it, built from the same parts.
fn mistaken(shading: &Shading<'_>, geometry: &Geometry, t: f32, ratio: f32, mistake: Mistake, salt: u32) -> f64 {
    let sampler = Sampler::new(12, salt, 0);
    let rays = 512;
    let halves: u32 = (0..rays)
        .map(|i| {
            let [u, v] = sampler.pair(i, 0);
            if mistake == Mistake::Uniform {
                // cos(theta) = 1 - u in place of its square root.
                return (2.0 * shading.decide([1.0 - (1.0 - u) * (1.0 - u), v], [0.0; 2]).weight()) as u32;
            }
            if shading.decide([u, v], [0.0; 2]).hit {
                return 0;
            }
            let (radius, n) = (0.25, Vec3::Y);
            let (s, c) = (std::f32::consts::TAU * v).sin_cos();
            let w = Vec3::new(u.sqrt() * c, (1.0 - u).sqrt(), u.sqrt() * s);
            let d1 = w.cross(n).normalize();
            let middle = Vec3::new(t, 2e-5, 0.1) + w * (0.5 * radius);
            let hit = |d: Vec3| u32::from(geometry.tracer.occluded(&Ray::new(middle, d, ratio * radius)));
            2 - hit(d1) - hit(w.cross(d1))
        })
        .sum();
    f64::from(halves) / f64::from(2 * rays)
}

/// A one-sided secondary ray and a wrong cosine disagree with the reference at
/// the test's own level, in most rows.
#[test]
fn a_one_sided_ray_and_a_wrong_cosine_are_found() {
    let rows = reference(include_str!("../reference/openness.json"));
    let level = sidak_alpha(0.01, rows.len() * METHODS.len());
    for (mistake, column, estimator) in [
        (Mistake::OneSided, "ext2_c_R4_g1", COUNTS),
        (Mistake::Uniform, "ext2_c_R4_g1", COUNTS),
        (Mistake::Uniform, "ext_c", CLASSIC),
    ] {
        let mut rejected = 0;
        for (r, row) in rows.iter().enumerate() {
            let scene = scene(row);
            let geometry = Geometry::new(&scene).unwrap();
            let t = row["t"].as_f64().unwrap() as f32 / 100.0;
            let shading = Shading::new(&geometry.tracer, Vec3::new(t, 0.0, 0.1), Vec3::Y, scene.ao, method(estimator));
            let values: Vec<f64> = (0..64)
                .map(|replicate| mistaken(&shading, &geometry, t, 0.25, mistake, (r * 64 + replicate) as u32))
                .collect();
            let e = Estimate::of_mean(&values);
            let off = (e.value - row[column].as_f64().unwrap()).abs();
            rejected += usize::from(e.se > 0.0 && 2.0 * upper_tail(e.df, off / e.se) < level);
        }
        assert!(rejected * 2 > rows.len(), "{column}: {rejected} of {}", rows.len());
    }
}

/// How many of the reference's rows the renders disagree with, at alpha .01 over
/// all rows (Sidak). Each method's R' is scaled by `stretch`, its reading of the
/// plane swapped on demand, R scaled by `radius`.
fn disagreements(stretch: f32, swap: bool, radius: f32) -> (usize, usize) {
    let rows = reference(include_str!("../reference/openness.json"));
    let tests = rows.len() * METHODS.len();
    let level = sidak_alpha(0.01, tests);
    let mut rejected = 0;
    for (r, row) in rows.iter().enumerate() {
        let mut scene = scene(row);
        scene.ao.radius *= radius;
        let geometry = Geometry::new(&scene).unwrap();
        let t = row["t"].as_f64().unwrap() as f32 / 100.0;
        for (k, (column, estimator, ratio)) in METHODS.into_iter().enumerate() {
            let estimator = match (estimator, swap) {
                (CLIPPED, true) => COUNTS,
                (COUNTS, true) => CLIPPED,
                (e, _) => e,
            };
            let e = render_point(&geometry, &scene, t, estimator, ratio * stretch, (r * METHODS.len() + k) as u32);
            let off = (e.value - row[column].as_f64().unwrap()).abs();
            // Where no ray varies, the reference must be met as closely as it is
            // known: the offset of ray origins allows 1e-4.
            let p = if e.se > 0.0 { 2.0 * upper_tail(e.df, off / e.se) } else { f64::from(u8::from(off < 1e-4)) };
            if p < level {
                rejected += 1;
                if stretch == 1.0 && !swap && radius == 1.0 {
                    println!("{row}\n{column}: {} +- {}, p = {p:e}", e.value, e.se);
                }
            }
        }
    }
    (rejected, tests)
}

#[test]
fn every_point_agrees_with_the_reference() {
    let (rejected, tests) = disagreements(1.0, false, 1.0);
    assert_eq!(tests, 210);
    assert_eq!(rejected, 0, "of {tests} points");
}

#[test]
fn a_wrong_length_is_found() {
    let (rejected, tests) = disagreements(1.05, false, 1.0);
    assert!(rejected > tests / 10, "R' 5 % too long: {rejected} of {tests}");
    let (rejected, tests) = disagreements(1.0, false, 1.02);
    assert!(rejected > tests / 10, "R 2 % too long: {rejected} of {tests}");
}

#[test]
fn the_other_reading_of_the_plane_is_found() {
    let (rejected, tests) = disagreements(1.0, true, 1.0);
    assert!(rejected > tests / 2, "{rejected} of {tests}");
}

/// Renders, finds the regions and takes K: within 1e-2 of the quadrature.
#[test]
fn highlight_contrast_agrees_with_the_reference() {
    for row in reference(include_str!("../reference/highlight.json")) {
        let mut scene = scene(&row);
        let geometry = Geometry::new(&scene).unwrap();
        let view = scene.measure.view();
        let gbuffer = GBuffer::new(&geometry.tracer, &view);
        let regions = Regions::new(&scene, &geometry.tracer, &gbuffer);
        for (column, estimator, ratio) in METHODS.into_iter().filter(|m| m.1 != OBSCURANCE) {
            scene.ao.secondary_radius = ratio * scene.ao.radius;
            let name = column.strip_prefix("ext2_c_").unwrap_or("classic");
            let mut loaded = Cpu.load(&geometry).unwrap();
            let mut render = |seed: u32| -> Vec<Vec<f32>> {
                let job =
                    |replicate| Job { view: &view, camera: None, estimator, ao: scene.ao, rays: 64, seed, replicate };
                (0..4).map(|replicate| loaded.render(&job(replicate)).unwrap().values).collect()
            };
            let (replicates, converged) = (render(3), Converged::new(render(4)));
            let method = Method { replicates: &replicates, converged: &converged, regions: &regions };
            let [weber, michelson] = method.contrasts();
            let k = weber.value.unwrap();
            assert!((michelson.value.unwrap() - k / (2.0 + k)).abs() < 1e-3, "K/(2 + K)");
            let expected = row[name]["K"].as_f64().unwrap();
            assert!((k - expected).abs() < 1e-2, "w {} m {} {name}: K = {k}, expected {expected}", row["w"], row["m"]);
        }
    }
}

/// The profile of a render against the closed form at every column: the mean
/// over 32 rows of 256 rays, within six standard errors of binary samples.
#[test]
fn a_rendered_profile_follows_the_closed_form() {
    let row: Value = serde_json::json!({ "w": 2, "m": 5 });
    let scene = scene(&row);
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let job = Job { view: &view, camera: None, estimator: CLASSIC, ao: scene.ao, rays: 256, seed: 5, replicate: 0 };
    let frame = Cpu.load(&geometry).unwrap().render(&job).unwrap();
    let slab = Slab { width: 0.02, gap: 0.05, height: 1.0 };
    for x in 0..208u32 {
        let mean: f64 = (0..32).map(|y| f64::from(frame.values[(y * 208 + x) as usize])).sum::<f64>() / 32.0;
        let p = slab.openness(f64::from(scene.measure.transect_at(x)), 0.25).extruded_cosine;
        let se = (p * (1.0 - p) / (32.0 * 256.0)).sqrt();
        assert!((mean - p).abs() < 6.0 * se + 1e-4, "column {x}: {mean}, expected {p}");
    }
}
