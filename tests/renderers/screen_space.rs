//! Screen space against closed forms, and the GPU against the CPU. Needs an
//! adapter as tests/renderers/gpu.rs does.

use aogauge::{
    metrics::{
        MetricName,
        regions::{Region, Regions},
    },
    record::{Machine, RecordFolder},
    render::{
        Estimator, Falloff, Frame, Geometry, Job, RenderError, Renderer, ScreenSpace, cpu::Cpu, gbuffer::GBuffer,
        gpu::Gpu, screen_space::Integral,
    },
    run::{Means, Observer, Prepared},
    scenes::{Scene, View, library},
    screen_camera::screen_camera,
    suite::{Plan, Platform, Suite},
};
use glam::Vec3;

/// XeGTAO's numbers.
const XEGTAO: ScreenSpace = ScreenSpace {
    steps: 3,
    sample_power: 2,
    radius_multiplier: 1.457,
    falloff: Falloff::LinearTail { tail: 0.615 },
    intensity: 2.2,
    ..ScreenSpace::GTAO
};

/// What the image shows is thin.
fn thick(metres: f32) -> ScreenSpace {
    ScreenSpace { integral: Integral::Gtao { thickness: Some(metres) }, ..ScreenSpace::GTAO }
}

/// A scene on the CPU with its look view.
struct Stage {
    scene: Scene,
    geometry: Geometry,
    view: View,
}

impl Stage {
    fn new(name: &str, resolution: [u32; 2]) -> Self {
        let scene = library::scene(name).unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let look = aogauge::scenes::LookView { resolution, ..scene.look };
        Stage { scene, geometry, view: look.view() }
    }

    fn job<'a>(&self, view: &'a View, camera: Option<&'a View>, method: ScreenSpace, rays: u32) -> Job<'a> {
        Job { view, camera, estimator: Estimator::ScreenSpace(method), ao: self.scene.ao, rays, seed: 3, replicate: 1 }
    }

    fn render(&self, renderer: &dyn Renderer, job: &Job<'_>) -> Frame {
        renderer.load(&self.geometry).unwrap().render(job).unwrap()
    }

    fn points(&self, view: &View) -> GBuffer {
        GBuffer::new(&self.geometry.tracer, view)
    }
}

/// No direction of HBAO, and on the mean no slice of GTAO, is closed: from a
/// perspective and from an orthographic camera.
#[test]
fn an_open_plane_reads_1() {
    let stage = Stage::new("plane", [72, 48]);
    for view in [stage.view, stage.scene.measure.view()] {
        let hbao = stage.render(&Cpu, &stage.job(&view, None, ScreenSpace::HBAO, 16));
        assert!(hbao.values.iter().all(|v| v.is_nan() || *v == 1.0));
        for method in [ScreenSpace::GTAO, thick(0.02)] {
            let gtao = stage.render(&Cpu, &stage.job(&view, None, method, 256));
            let worst = gtao.values.iter().filter(|v| !v.is_nan()).map(|v| (v - 1.0).abs()).fold(0.0f32, f32::max);
            assert!(worst < 2e-3, "{worst}");
        }
    }
}

/// In a corner of two planes the depth buffer holds all there is, so GTAO without
/// falloff is classic AO: at distance k R from the wall the wall closes the
/// segment of the unit disk beyond k, 1/pi (acos k - k sqrt(1 - k^2)).
#[test]
fn gtao_in_a_corner_meets_the_closed_form() {
    let stage = Stage::new("corner", [360, 240]);
    for (method, tolerance) in [(ScreenSpace::GTAO, 0.01), (thick(1.0), 0.015)] {
        corner(&stage, ScreenSpace { steps: 64, ..method }, tolerance);
    }
}

fn corner(stage: &Stage, method: ScreenSpace, tolerance: f64) {
    let frame = stage.render(&Cpu, &stage.job(&stage.view, None, method, 16));
    let mut bins = [(0.0f64, 0.0f64, 0u32); 10];
    for (surface, value) in stage.points(&stage.view).surfaces.iter().zip(&frame.values) {
        let Some(s) = surface.filter(|s| s.normal.y > 0.9 && s.point.z.abs() < 0.2) else { continue };
        let k = f64::from(s.point.x / stage.scene.ao.radius);
        if (0.05..0.95).contains(&k) {
            let closed = (k.acos() - k * (1.0 - k * k).sqrt()) / std::f64::consts::PI;
            let bin = &mut bins[(k * 10.0) as usize];
            *bin = (bin.0 + f64::from(*value), bin.1 + 1.0 - closed, bin.2 + 1);
        }
    }
    for (own, expected, n) in bins {
        let n = f64::from(n);
        let (own, expected) = (own / n, expected / n);
        println!("{own:.4} against {expected:.4}, {n} pixels");
        assert!(n > 30.0 && (own - expected).abs() < tolerance, "{own} against {expected}");
    }
}

/// HBAO darkens towards a wall, and the less so the more of the horizon the bias
/// takes and the more distance weakens it.
#[test]
fn hbao_in_a_corner_darkens_towards_the_wall() {
    let stage = Stage::new("corner", [240, 160]);
    let points = stage.points(&stage.view);
    let profile = |method: ScreenSpace| -> Vec<f64> {
        let frame = stage.render(&Cpu, &stage.job(&stage.view, None, method, 32));
        let mut bins = [(0.0, 0.0); 6];
        for (surface, value) in points.surfaces.iter().zip(&frame.values) {
            let Some(s) = surface.filter(|s| s.normal.y > 0.9 && s.point.z.abs() < 0.3) else { continue };
            let k = (s.point.x / stage.scene.ao.radius * 5.0) as usize;
            if k < 6 {
                bins[k].0 += f64::from(*value);
                bins[k].1 += 1.0;
            }
        }
        bins.iter().map(|(sum, n)| sum / n).collect()
    };
    let biased =
        |tangent_bias, falloff| ScreenSpace { integral: Integral::Hbao { tangent_bias }, falloff, ..ScreenSpace::HBAO };
    let step = profile(biased(0.0, Falloff::Step));
    assert!(step.windows(2).all(|w| w[0] < w[1]) && step[0] < 0.75 && (step[5] - 1.0).abs() < 1e-6, "{step:?}");
    for (lighter, darker) in
        [(profile(biased(0.0, Falloff::Quadratic)), &step), (profile(biased(20.0, Falloff::Step)), &step)]
    {
        assert!(lighter.iter().zip(darker).take(5).all(|(a, b)| a > b), "{lighter:?} {darker:?}");
    }
}

/// What the camera does not show is NaN; what it shows twice has one value.
#[test]
fn a_measure_view_is_gathered_from_its_camera() {
    let stage = Stage::new("curtain-arcade", [16, 16]);
    let view = stage.scene.measure.view();
    let points = stage.points(&view);
    let regions = Regions::new(&stage.scene, &stage.geometry.tracer, &points);
    let camera = screen_camera(&stage.scene, &stage.geometry.tracer, &points, &regions);
    let gathered = stage.render(&Cpu, &stage.job(&view, Some(&camera), ScreenSpace::GTAO, 16));
    let whole = stage.render(&Cpu, &stage.job(&camera, None, ScreenSpace::GTAO, 16));
    let to_image = camera.world_to_image().unwrap();
    for (surface, value) in points.surfaces.iter().zip(&gathered.values).filter(|(_, v)| !v.is_nan()) {
        let at = to_image.at(surface.unwrap().point).unwrap();
        let pixel = at.y as usize * camera.resolution[0] as usize + at.x as usize;
        assert_eq!(value.to_bits(), whole.values[pixel].to_bits());
    }
    // From higher up: what the curtain hides is not guessed at.
    let high = View::perspective(Vec3::new(0.5, 0.9, 0.0), Vec3::ZERO, Vec3::Y, 0.9, [256, 256]);
    let frame = stage.render(&Cpu, &stage.job(&view, Some(&high), ScreenSpace::GTAO, 1));
    let nan = |region| regions.pixels(region).iter().filter(|&&i| frame.values[i as usize].is_nan()).count();
    assert!(nan(Region::Left) > 400 && nan(Region::Right) == 0, "{} {}", nan(Region::Left), nan(Region::Right));
}

#[test]
fn threads_change_nothing_and_tiny_views_render() {
    let stage = Stage::new("curtain-arcade", [48, 32]);
    let images = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| stage.render(&Cpu, &stage.job(&stage.view, None, XEGTAO, 5)).values)
    });
    assert!(images[0].iter().zip(&images[1]).all(|(a, b)| a.to_bits() == b.to_bits()));
    let gpu = Gpu::open().unwrap_or_else(|e| panic!("{e}"));
    let tiny = View { resolution: [1, 1], ..stage.view };
    for renderer in [&Cpu as &dyn Renderer, &gpu] {
        for method in [ScreenSpace::HBAO, XEGTAO] {
            for (view, camera) in [(tiny, None), (stage.scene.measure.view(), Some(&tiny)), (tiny, Some(&tiny))] {
                let frame = stage.render(renderer, &stage.job(&view, camera, method, 2));
                assert_eq!(frame.values.len(), view.pixels());
            }
        }
        let neither = View { origin_dx: Vec3::X, ..stage.view };
        let job = stage.job(&neither, None, XEGTAO, 1);
        let error = renderer.load(&stage.geometry).unwrap().render(&job).unwrap_err();
        assert!(matches!(error, RenderError::Camera), "{error}");
    }
}

/// The same pixels are NaN, and at most 1 in 10,000 of the others differs by more
/// than 2e-3.
#[test]
fn the_gpu_sees_what_the_cpu_sees() {
    let gpu = Gpu::open().unwrap_or_else(|e| panic!("{e}"));
    let (mut pixels, mut differ, mut worst) = (0, 0, 0.0f32);
    for name in ["curtain-arcade", "pillar"] {
        let stage = Stage::new(name, [192, 128]);
        let measure = stage.scene.measure.view();
        let points = stage.points(&measure);
        let regions = Regions::new(&stage.scene, &stage.geometry.tracer, &points);
        let camera = screen_camera(&stage.scene, &stage.geometry.tracer, &points, &regions);
        let (mut on_cpu, mut on_gpu) = (Cpu.load(&stage.geometry).unwrap(), gpu.load(&stage.geometry).unwrap());
        for (view, camera) in [(&stage.view, None), (&measure, Some(&camera))] {
            for (method, rays) in [
                (ScreenSpace::GTAO, 8),
                (XEGTAO, 3),
                (thick(0.02), 8),
                (ScreenSpace::HBAO, 8),
                (ScreenSpace { falloff: Falloff::Step, steps: 5, ..ScreenSpace::HBAO }, 5),
            ] {
                let job = stage.job(view, camera, method, rays);
                let (a, b) = (on_cpu.render(&job).unwrap(), on_gpu.render(&job).unwrap());
                assert_eq!(a.seen, b.seen);
                for (a, b) in a.values.iter().zip(&b.values) {
                    assert_eq!(a.is_nan(), b.is_nan());
                    pixels += usize::from(!a.is_nan());
                    differ += usize::from((a - b).abs() > 2e-3);
                    worst = worst.max((a - b).abs());
                }
            }
        }
    }
    // More slices than one dispatch takes.
    let stage = Stage::new("curtain-arcade", [48, 32]);
    let job = stage.job(&stage.view, None, ScreenSpace { steps: 64, ..ScreenSpace::GTAO }, 70);
    let (a, b) = (stage.render(&Cpu, &job), stage.render(&gpu, &job));
    assert!(a.values.iter().zip(&b.values).all(|(a, b)| (a - b).abs() < 1e-4 || (a.is_nan() && b.is_nan())));
    println!("{differ} of {pixels} pixels differ by more than 2e-3; the most by {worst}");
    assert!(differ * 10_000 <= pixels, "{differ} of {pixels}, the most by {worst}");
}

struct Silent;

impl Observer for Silent {
    fn step(&self, _done: u64, _total: u64, _what: &str) {}
}

/// Half a centimetre under the hem no camera sees the far flank: metrics that
/// need it are null and say why, those of ray traced methods are not, and the
/// report tells how much was seen.
#[test]
fn what_no_camera_sees_is_not_measured() {
    let dir = tempfile::tempdir().unwrap();
    let low = r#"
description = "A hem just over the ground."
ao = { radius = 0.25 }
environment = { radiance = 1.0 }
measure = { center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 0.004, resolution = [208, 16] }
look = { eye = [0.9, 0.45, 1.25], target = [0, 0, 0], resolution = [32, 16] }
[[object]]
name = "ground"
shape = { plane = { center = [0, 0, 0], u = [0, 0, 6], v = [6, 0, 0] } }
[[object]]
name = "curtain"
occluder = true
shape = { curtain = { thickness = 0.02, gap = 0.005, height = 1.0, length = 6.0 } }
"#;
    std::fs::write(dir.path().join("low.toml"), low).unwrap();
    let suite = r#"
description = "x"
scenes = ["low.toml"]
rays = [2]
replicates = 2
converged_rays = 8
look_rays = 1
judge = { paths = 1, replicates = 2, max_replicates = 2 }
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "gtao"
kind = "gtao"
"#;
    let suite = Suite::from_toml("x", "x.toml", suite, dir.path()).unwrap();
    let plan = Plan::new(&suite, Platform::Cpu, None);
    let folder = RecordFolder::create(&dir.path().join("out")).unwrap();
    let machine = Machine::here("a test".into(), None);
    let record = Prepared::new(&plan).unwrap().run(&Means::new(&Cpu, machine), &folder, &Silent).unwrap();
    let screen = record.scenes[0].screen.as_ref().unwrap();
    let flanks = [Region::Left, Region::Right].map(|r| (screen.regions[&r], record.scenes[0].regions[&r]));
    assert!(flanks.iter().any(|(shown, of)| *shown < 64 && *of == 256), "{flanks:?}");
    assert!(flanks.iter().any(|(shown, of)| shown == of), "{flanks:?}");
    let contrast = |case: usize| record.cases[case].metric(MetricName::Contrast, None).unwrap();
    assert!(contrast(0).value.is_some());
    assert!(contrast(1).value.is_none() && contrast(1).note.as_deref().unwrap().contains("fewer than 64"));
    aogauge::report::write(folder.path(), folder.path()).unwrap();
    let report = std::fs::read_to_string(folder.path().join("report.md")).unwrap();
    assert!(report.contains("Screen-space methods are computed") && report.contains("of 256"), "{report}");
}

#[test]
fn the_command_line_takes_it_and_names_what_is_wrong() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("g.exr");
    let render = |args: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_aogauge"));
        command.args(["render", "curtain-open", "--rays", "2", "--out"]).arg(&out).args(args);
        let output = command.output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    for args in [
        &["--estimator", "gtao", "--view", "look"][..],
        &["--estimator", "hbao", "--set", "tangent_bias=30", "--set", "falloff=step"],
        &["--preset", "xegtao-high", "--set", "steps=2"],
    ] {
        assert_eq!(render(args).0, Some(0), "{args:?}");
    }
    let layers = aogauge::layers::Layers::read(&out).unwrap();
    let shown = layers.get("mean").unwrap().iter().filter(|v| !v.is_nan()).count();
    assert!((1000..6656).contains(&shown), "{shown} of {:?}", layers.resolution);
    for (option, says) in [
        ("steps=65", "steps is 65: it must be from 1 to 64"),
        ("tangent_bias=3", "tangent_bias means nothing for kind 'gtao'"),
        ("secondary_rays=3", "secondary_rays means nothing for kind 'gtao'"),
    ] {
        let (code, message) = render(&["--estimator", "gtao", "--set", option]);
        assert!(code == Some(2) && message.contains(says), "{option}: {code:?} {message}");
    }
}

#[test]
fn the_committed_suite_loads() {
    let suite = Suite::load("reports/screen-space/suite.toml").unwrap();
    assert_eq!((suite.scenes.len(), suite.methods.len(), suite.gates.len()), (5, 7, 9));
}
