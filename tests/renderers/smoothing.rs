//! Accumulation over frames and the spatial filter, from outside. The tests on the
//! GPU need an adapter; a software one will do.

use aogauge::{
    metrics::regions::{Region, Regions},
    render::{
        Estimator, Frame, Geometry, Job, Loaded, Openness, ReceiverPlane, Renderer,
        cpu::Cpu,
        gbuffer::{GBuffer, Surface},
        gpu::{Checks, Gpu, Options},
        smoothing::{
            Camera, Denoise, Shot, Smoothing, Temporal, atrous,
            temporal::{History, accumulate},
        },
    },
    scenes::{Scene, View, library},
    stats::Estimate,
    suite::Suite,
};
use glam::Vec3;
use std::process::Command;

const MOVING: Temporal = Temporal { frames: 16, blend: 0.1, motion: [0.7, 0.3] };

fn classic() -> Openness {
    openness(Estimator::CLASSIC)
}

fn extended() -> Openness {
    openness(Estimator::extended(ReceiverPlane::Clipped))
}

fn openness(estimator: Estimator) -> Openness {
    let Estimator::Openness(method) = estimator else { panic!("{estimator:?}") };
    method
}

fn smoothed(method: Openness, temporal: Option<Temporal>, denoise: Option<Denoise>) -> Openness {
    Openness { smoothing: Smoothing { temporal, denoise }, ..method }
}

/// A job of four rays unless it says otherwise.
fn job<'a>(scene: &Scene, view: &'a View, method: Openness) -> Job<'a> {
    Job { view, camera: None, estimator: Estimator::Openness(method), ao: scene.ao, rays: 4, seed: 11, replicate: 0 }
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// The mean of |a - b| over pixels that see a surface.
fn mean_distance(a: &[f32], b: &[f32]) -> f64 {
    let distances: Vec<f64> = a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).filter(|d| !d.is_nan()).collect();
    distances.iter().sum::<f64>() / distances.len() as f64
}

#[test]
fn a_static_camera_gives_the_mean_of_the_frames() {
    let scene = library::scene("curtain-arcade").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let mut loaded = Cpu.load(&geometry).unwrap();
    let view = scene.measure.view();
    let temporal = Temporal { frames: 8, blend: 0.125, motion: [0.0; 2] };
    for replicate in 0..2 {
        let accumulated = Job { replicate, ..job(&scene, &view, smoothed(extended(), Some(temporal), None)) };
        let frame = |age| Job { seed: Temporal::seed(11, age), replicate, ..job(&scene, &view, extended()) };
        let frames: Vec<Frame> = (0..8).map(|age| loaded.render(&frame(age)).unwrap()).collect();
        assert!((1..8).all(|age| frames[age].values != frames[0].values), "frames have random numbers of their own");
        let result = loaded.render(&accumulated).unwrap();
        assert!(result.decisions.is_none() && result.seconds > 0.0);
        for (pixel, value) in result.values.iter().enumerate() {
            let mean = frames.iter().map(|f| f64::from(f.values[pixel])).sum::<f64>() / 8.0;
            assert!((f64::from(*value) - mean).abs() < 5e-7, "pixel {pixel}: {value} and {mean}");
        }
    }
}

/// A pan past a surface and the sky, and the widest filter.
#[test]
fn a_constant_image_stays_constant() {
    let scene = library::scene("pillar").unwrap();
    let tracer = Geometry::new(&scene).unwrap().tracer;
    let last = View { resolution: [96, 64], ..scene.look.view() };
    let mut past: Option<(Camera, GBuffer, History)> = None;
    for age in (0..6).rev() {
        let view = MOVING.view(&last, age);
        let (camera, gbuffer) = (Camera::new(&view).unwrap(), GBuffer::new(&tracer, &view));
        let raw: Vec<f32> = gbuffer.surfaces.iter().map(|s| s.map_or(f32::NAN, |_| 0.37)).collect();
        let before = past.as_ref().map(|(camera, gbuffer, h)| (Shot { camera: *camera, gbuffer }, h));
        let history = accumulate(0.1, Shot { camera, gbuffer: &gbuffer }, &raw, before);
        past = Some((camera, gbuffer, history));
    }
    let (camera, gbuffer, history) = past.unwrap();
    assert!(history.lengths.contains(&6.0));
    let denoise = Denoise { passes: 8, ..Denoise::default() };
    let filtered = atrous::filter(&denoise, Shot { camera, gbuffer: &gbuffer }, &history.values);
    for values in [&history.values, &filtered] {
        for (value, surface) in values.iter().zip(&gbuffer.surfaces) {
            assert_eq!(value.is_nan(), surface.is_none());
            assert!(value.is_nan() || (value - 0.37).abs() < 1e-6, "{value}");
        }
    }
}

/// Looking down on 64 x 16 pixels of 1 cm; `surface` gives height and normal at a
/// column.
fn from_above(left: f32, surface: impl Fn(f32) -> Option<(f32, Vec3)>) -> (Camera, GBuffer) {
    let view = View {
        resolution: [64, 16],
        origin: Vec3::new(left, 2.0, 0.0),
        origin_dx: Vec3::X * 0.01,
        origin_dy: Vec3::Z * 0.01,
        direction: Vec3::NEG_Y,
        direction_dx: Vec3::ZERO,
        direction_dy: Vec3::ZERO,
    };
    let surfaces = (0..64 * 16).map(|i| {
        let (origin, _) = view.ray(i % 64, i / 64);
        surface(origin.x).map(|(y, normal)| Surface { point: Vec3::new(origin.x, y, origin.z), normal, triangle: 0 })
    });
    (Camera::new(&view).unwrap(), GBuffer { resolution: [64, 16], surfaces: surfaces.collect() })
}

/// A step of 10 cm, a fold of 45 degrees, and a gap: openness of one side never
/// reaches the other, whatever it is.
#[test]
fn edges_do_not_leak() {
    let step = |x: f32| Some((if x < 0.32 { 0.0f32 } else { 0.1 }, Vec3::Y));
    let fold = |x: f32| Some(if x < 0.32 { (0.0, Vec3::Y) } else { (x - 0.32, Vec3::new(-1.0, 1.0, 0.0).normalize()) });
    let gap = |x: f32| (x < 0.32).then_some((0.0, Vec3::Y));
    let denoise = Denoise { passes: 5, openness: 100.0, ..Denoise::default() };
    for (what, scene) in [("step", &step as &dyn Fn(f32) -> Option<(f32, Vec3)>), ("fold", &fold), ("gap", &gap)] {
        let open = |x: usize| if x < 32 { 0.2 } else { 0.9 };
        let value = |i: usize, s: &Option<Surface>| s.map_or(f32::NAN, |_| open(i % 64));
        let mut images = Vec::new();
        let (then, seen_then) = from_above(-0.013, scene);
        let (camera, gbuffer) = from_above(0.0, scene);
        let shot = Shot { camera, gbuffer: &gbuffer };
        let raw: Vec<f32> = gbuffer.surfaces.iter().enumerate().map(|(i, s)| value(i, s)).collect();
        images.push(atrous::filter(&denoise, shot, &raw));
        // The edge stood 1.3 pixels further right in the frame before.
        let shot_then = Shot { camera: then, gbuffer: &seen_then };
        let raw_then: Vec<f32> = seen_then
            .surfaces
            .iter()
            .map(|s| s.map_or(f32::NAN, |s| open(if s.point.x < 0.32 { 0 } else { 63 })))
            .collect();
        let before = accumulate(0.1, shot_then, &raw_then, None);
        let history = accumulate(0.1, shot, &raw, Some((shot_then, &before)));
        assert!(history.lengths.iter().filter(|n| **n == 2.0).count() > 900 / if what == "gap" { 2 } else { 1 });
        images.push(history.values);
        for (which, image) in images.iter().enumerate() {
            for (i, (value, surface)) in image.iter().zip(&gbuffer.surfaces).enumerate() {
                assert_eq!(value.is_nan(), surface.is_none());
                assert!(
                    value.is_nan() || (value - open(i % 64)).abs() < 1e-6,
                    "{what}, image {which}, column {}: {value}",
                    i % 64
                );
            }
        }
    }
}

/// Noise is left behind where neighbours show the same, and an edge of openness is
/// kept better the narrower the filter's openness term is.
#[test]
fn the_filter_takes_noise_away_and_a_narrow_one_keeps_edges_of_openness() {
    let (camera, gbuffer) = from_above(0.0, |_| Some((0.0, Vec3::Y)));
    let noise = |i: usize| aogauge::render::sampler::Sampler::new(3, i as u32, 0).pair(0, 0)[0] - 0.5;
    let truth: Vec<f32> = (0..64 * 16).map(|i| if i % 64 < 32 { 0.2 } else { 0.8 }).collect();
    let noisy: Vec<f32> = truth.iter().enumerate().map(|(i, t)| t + 0.2 * noise(i)).collect();
    let error = |openness| {
        let denoise = Denoise { openness, ..Denoise::default() };
        mean_distance(&atrous::filter(&denoise, Shot { camera, gbuffer: &gbuffer }, &noisy), &truth)
    };
    let (narrow, wide) = (error(0.5), error(100.0));
    let raw = mean_distance(&noisy, &truth);
    println!("raw {raw}, narrow {narrow}, wide {wide}");
    assert!(narrow < 0.4 * raw && wide > raw, "raw {raw}, narrow {narrow}, wide {wide}");
}

#[test]
fn with_motion_the_error_falls_with_the_frames() {
    let scene = library::scene("curtain-arcade").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let mut loaded = Cpu.load(&geometry).unwrap();
    let view = scene.measure.view();
    for method in [classic(), extended()] {
        let converged = loaded.render(&Job { rays: 512, seed: 99, ..job(&scene, &view, method) }).unwrap().values;
        let mut errors = vec![mean_distance(&loaded.render(&job(&scene, &view, method)).unwrap().values, &converged)];
        for frames in [2, 4, 16] {
            let method = smoothed(method, Some(Temporal { frames, ..MOVING }), None);
            errors.push(mean_distance(&loaded.render(&job(&scene, &view, method)).unwrap().values, &converged));
        }
        println!("{errors:?}");
        assert!(errors.is_sorted_by(|a, b| b < a) && errors[3] < 0.4 * errors[0], "{errors:?}");
    }
}

/// The camera steps aside and a point comes into view behind the pillar's edge.
#[test]
fn what_appears_begins_anew() {
    let scene = library::scene("pillar").unwrap();
    let tracer = Geometry::new(&scene).unwrap().tracer;
    let mut look = scene.look;
    look.resolution = [144, 96];
    let view = look.view();
    look.eye.x += 0.3;
    look.target.x += 0.3;
    let before = look.view();
    let (now, then) = (GBuffer::new(&tracer, &view), GBuffer::new(&tracer, &before));
    let shots = [(&view, &now), (&before, &then)].map(|(v, gbuffer)| Shot { camera: Camera::new(v).unwrap(), gbuffer });
    let flat = vec![0.5; view.pixels()];
    let past = accumulate(0.1, shots[1], &flat, None);
    let history = accumulate(0.1, shots[0], &flat, Some((shots[1], &past)));
    let (mut hidden, mut anew, mut kept, mut seen) = (0, 0, 0, 0);
    for (surface, length) in now.surfaces.iter().zip(&history.lengths) {
        let Some(s) = surface else {
            assert_eq!(*length, 0.0);
            continue;
        };
        let origin = s.point + s.normal * tracer.offset();
        let covered = tracer.occluded(&aogauge::trace::Ray::new(
            origin,
            (look.eye - origin).normalize(),
            (look.eye - origin).length() * 0.999,
        ));
        let place = shots[1].camera.to_image.at(s.point).unwrap();
        let inside = place.x > 1.0 && place.y > 1.0 && place.x < 143.0 && place.y < 95.0;
        if covered || place.x < -1.0 || place.x > 145.0 || place.y < -1.0 || place.y > 97.0 {
            hidden += 1;
            anew += usize::from(*length == 1.0);
        } else if inside {
            seen += 1;
            kept += usize::from(*length == 2.0);
        }
    }
    println!("{anew} of {hidden} hidden ones begin anew, {kept} of {seen} others go on");
    // Within a pixel of an edge both may happen.
    assert!(hidden > 100 && anew * 100 > hidden * 90, "{anew} of {hidden}");
    assert!(seen > 5000 && kept * 100 > seen * 97, "{kept} of {seen}");

    // A pan: what comes in at the border is new.
    let pan = Temporal { frames: 2, blend: 0.1, motion: [3.0, 0.0] };
    let before = pan.view(&view, 1);
    let then = GBuffer::new(&tracer, &before);
    let shot = Shot { camera: Camera::new(&before).unwrap(), gbuffer: &then };
    let past = accumulate(0.1, shot, &flat, None);
    let history = accumulate(0.1, shots[0], &flat, Some((shot, &past)));
    for (i, length) in history.lengths.iter().enumerate().filter(|(_, n)| **n > 0.0) {
        assert_eq!(*length == 1.0, i % 144 >= 141 || *length != 2.0, "column {}: {length}", i % 144);
    }
    let new = history.lengths.iter().filter(|n| **n == 1.0).count();
    assert!(new >= 3 * 80, "{new}");
}

/// Means over footprint and flanks, over replicates: smoothing moves them by less
/// than the limits, and the extension stays darker under the curtain than classic.
#[test]
fn the_extended_weight_survives() {
    let scene = library::scene("curtain-arcade").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let gbuffer = GBuffer::new(&geometry.tracer, &view);
    let regions = Regions::new(&scene, &geometry.tracer, &gbuffer);
    let mut loaded = Cpu.load(&geometry).unwrap();
    let mut means = |method: Openness, rays| -> [Estimate; 3] {
        let images: Vec<Vec<f32>> = (0..8)
            .map(|replicate| loaded.render(&Job { rays, replicate, ..job(&scene, &view, method) }).unwrap().values)
            .collect();
        [Region::Footprint, Region::Left, Region::Right].map(|region| {
            let values: Vec<f64> = images.iter().map(|i| regions.mean(region, i).unwrap()).collect();
            Estimate::of_mean(&values)
        })
    };
    let truth = means(extended(), 64);
    let open = means(classic(), 64);
    let denoise = Some(Denoise::default());
    let still = Some(Temporal { motion: [0.0; 2], ..MOVING });
    for (what, temporal, denoise, limits) in [
        ("temporal", still, None, [0.006, 0.004]),
        ("moving", Some(MOVING), None, [0.006, 0.004]),
        ("denoise", None, denoise, [0.03, 0.012]),
        ("both", Some(MOVING), denoise, [0.03, 0.004]),
    ] {
        let own = means(smoothed(extended(), temporal, denoise), 4);
        let bias = [0, 1, 2].map(|i| own[i].less(&truth[i]));
        println!("{what}: {bias:?}");
        for (i, limit) in [(0, limits[0]), (1, limits[1]), (2, limits[1])] {
            let [lo, hi] = bias[i].interval(0.95);
            assert!(lo > -limit && hi < limit, "{what}, region {i}: {lo} to {hi}");
        }
        let [_, darker] = own[0].less(&open[0]).interval(0.95);
        assert!(darker < -0.1, "{what}: {darker}");
    }
}

#[test]
fn the_power_is_taken_last() {
    let scene = library::scene("curtain-arcade").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let mut loaded = Cpu.load(&geometry).unwrap();
    let plain = smoothed(classic(), Some(MOVING), Some(Denoise::default()));
    let mut values = |method| loaded.render(&job(&scene, &view, method)).unwrap().values;
    let (plain, squared) = (values(plain), values(Openness { intensity: 2.0, ..plain }));
    assert!(plain.iter().zip(squared).all(|(p, s)| (p * p - s).abs() < 1e-6));
}

#[test]
fn threads_do_not_matter() {
    let scene = library::scene("pillar").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = View { resolution: [96, 64], ..scene.look.view() };
    let method = smoothed(extended(), Some(Temporal { frames: 4, ..MOVING }), Some(Denoise::default()));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bits(&Cpu.load(&geometry).unwrap().render(&job(&scene, &view, method)).unwrap().values))
    };
    assert_eq!(with(1), with(5));
}

#[test]
fn small_and_wide_views_are_smoothed() {
    // With checks, so that an index outside an image shows.
    let gpu = Gpu::with(Options { checks: Checks::On, ..Options::default() }).unwrap_or_else(|e| panic!("{e}"));
    let scene = library::scene("curtain-arcade").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let denoise = Some(Denoise { passes: 8, ..Denoise::default() });
    let method = smoothed(extended(), Some(Temporal { frames: 2, ..MOVING }), denoise);
    let (mut on_cpu, mut on_gpu) = (Cpu.load(&geometry).unwrap(), gpu.load(&geometry).unwrap());
    for resolution in [[1, 1], [4096, 2], [1, 300]] {
        for view in [scene.measure.view(), scene.look.view()] {
            let view = View { resolution, ..view };
            agree(on_cpu.as_mut(), on_gpu.as_mut(), &job(&scene, &view, method));
        }
    }
    let nowhere = View { origin_dx: Vec3::X, ..scene.look.view() };
    for loaded in [&mut on_cpu, &mut on_gpu] {
        let message = loaded.render(&job(&scene, &nowhere, method)).unwrap_err().to_string();
        assert!(message.contains("orthographic or perspective"), "{message}");
    }
}

/// Renders on both: of 10,000 pixels at most one may differ by more than 1e-5, and
/// the driver does the same twice.
fn agree(on_cpu: &mut dyn Loaded, on_gpu: &mut dyn Loaded, job: &Job<'_>) {
    let (a, b) = (on_cpu.render(job).unwrap(), on_gpu.render(job).unwrap());
    assert!(b.decisions.is_none() && b.seconds > 0.0);
    let mut worst: Vec<f32> = Vec::new();
    for (i, (x, y)) in a.values.iter().zip(&b.values).enumerate() {
        assert_eq!(x.is_nan(), a.seen[i] == u32::MAX);
        assert_eq!(y.is_nan(), b.seen[i] == u32::MAX);
        let apart = (x - y).abs();
        // One of them alone sees a surface.
        worst.push(if x.is_nan() != y.is_nan() {
            1.0
        } else if apart.is_nan() {
            0.0
        } else {
            apart
        });
    }
    let differ = worst.iter().filter(|d| **d > 1e-5).count();
    println!(
        "{:?}: {differ} of {} pixels, the worst by {}",
        job.view.resolution,
        worst.len(),
        worst.iter().copied().fold(0.0, f32::max)
    );
    assert!(differ * 10_000 <= worst.len(), "{differ} of {} pixels: {job:?}", worst.len());
    assert_eq!(bits(&b.values), bits(&on_gpu.render(job).unwrap().values));
}

#[test]
fn the_gpu_smooths_as_the_cpu_does() {
    let gpu = Gpu::open().unwrap_or_else(|e| panic!("{e}"));
    // Wide, so that points apart count for each other.
    let denoise = Some(Denoise { normal: 2.0, plane: 4.0, ..Denoise::default() });
    for name in ["curtain-arcade", "sphere", "leaves"] {
        let scene = library::scene(name).unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let (mut on_cpu, mut on_gpu) = (Cpu.load(&geometry).unwrap(), gpu.load(&geometry).unwrap());
        for view in [scene.measure.view(), View { resolution: [144, 96], ..scene.look.view() }] {
            let still = Some(Temporal { frames: 4, motion: [0.0; 2], ..MOVING });
            let moving = Some(Temporal { frames: 6, ..MOVING });
            for (temporal, denoise) in [(still, None), (moving, None), (None, denoise), (moving, denoise)] {
                let method = smoothed(extended(), temporal, denoise);
                agree(on_cpu.as_mut(), on_gpu.as_mut(), &job(&scene, &view, method));
            }
        }
    }
}

#[test]
fn the_suite_of_the_report_is_legal() {
    let suite = Suite::load("reports/smoothing/suite.toml").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(suite.methods.iter().filter(|m| m.estimator != m.estimator.unsmoothed()).count(), 8);
}

/// `--set` takes both, the output names them, and what is wrong is refused.
#[test]
fn the_command_line_takes_both() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("o.exr");
    let render = |options: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
        command.args(["render", "plane", "--rays", "1", "--format", "json", "--out"]).arg(&out);
        for option in options {
            command.args(["--set", option]);
        }
        command.output().unwrap()
    };
    let output = render(&["temporal={ frames = 2, motion = [0.5, 0] }", "denoise={ passes = 1 }"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["estimator"]["temporal"]["motion"], serde_json::json!([0.5, 0.0]));
    assert_eq!(json["estimator"]["denoise"]["passes"], 1);
    assert_eq!(json["mean"], 1.0);
    let output = render(&["temporal={ frames = 300 }"]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2));
    assert!(message.contains("temporal.frames is 300: it must be from 2 to 256"), "{message}");
}
