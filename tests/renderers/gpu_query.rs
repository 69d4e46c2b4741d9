//! Ray query against the CPU, ray by ray. What compares needs an adapter that has
//! it and is ignored unless asked for: `.ci/peers ray_query` runs it on a software
//! driver.

use aogauge::{
    render::{
        Estimator, Faces, Falloff, Geometry, Job, LocalIndirect, Openness, ReceiverPlane, Renderer, Scale,
        cpu::Cpu,
        gpu::{GBufferBy, Gpu, Options, Traversal},
    },
    scenes::{Mesh, Scene, View, library},
};
use glam::Vec3;
use std::process::Command;

fn gpu(g_buffer: GBufferBy) -> Gpu {
    let gpu = Gpu::with(Options { g_buffer, traversal: Traversal::RayQuery, ..Options::default() })
        .unwrap_or_else(|e| panic!("{e}"));
    assert!(gpu.describe().contains("ray query"), "{}", gpu.describe());
    gpu
}

#[derive(Default, Debug)]
struct Tally {
    pixels: usize,
    elsewhere: usize,
    rays: u64,
    differently: u64,
    values: usize,
}

const PLAIN: Openness = Openness::plain(Falloff::Step);

/// At most 1 ray in 10,000 is decided differently, and where none is values are
/// equal but for the last bits of falloff; pixels that see something else are below
/// .1 %.
fn compare(gpu: &Gpu, scene: &Scene, view: &View, rays: u32, methods: &[Openness]) {
    let geometry = Geometry::new(scene).unwrap();
    let (mut on_cpu, mut on_gpu) = (Cpu.load(&geometry).unwrap(), gpu.load(&geometry).unwrap());
    let mut tally = Tally::default();
    for &method in methods {
        let estimator = Estimator::Openness(method);
        let job = Job { view, camera: None, estimator, ao: scene.ao, rays, seed: 3, replicate: 0 };
        let (a, b) = (on_cpu.render(&job).unwrap(), on_gpu.render(&job).unwrap());
        let (decided, by_query) = (a.decisions.unwrap(), b.decisions.unwrap());
        for i in 0..view.pixels() {
            tally.pixels += 1;
            if a.seen[i] != b.seen[i] {
                tally.elsewhere += 1;
                continue;
            }
            let (c, d) = (decided[i], by_query[i]);
            let differ = [c.primary ^ d.primary, c.first ^ d.first, c.second ^ d.second].map(u32::count_ones);
            let secondary = method.extension.map_or(0, |e| e.secondary_rays) * (rays - c.primary.count_ones());
            tally.rays += u64::from(rays + secondary);
            tally.differently += u64::from(differ.iter().sum::<u32>());
            let off = (a.values[i] - b.values[i]).abs() > 2e-6;
            tally.values += usize::from(off && differ == [0; 3]);
        }
    }
    println!(
        "{}: {} rays, {} decided differently; {} pixels, {} see another triangle",
        scene.name, tally.rays, tally.differently, tally.pixels, tally.elsewhere
    );
    assert!(tally.rays > 10_000, "{tally:?}");
    assert!(tally.differently * 10_000 <= tally.rays, "{tally:?}");
    assert!(tally.values * 1000 <= tally.pixels, "{tally:?}");
    assert!(tally.elsewhere * 1000 <= tally.pixels, "{tally:?}");
}

fn methods() -> Vec<Openness> {
    let Estimator::Openness(extended) = Estimator::extended(ReceiverPlane::Clipped) else { panic!() };
    let falloff = Openness::plain(Falloff::Exponential { extinction: 8.0 });
    vec![
        PLAIN,
        extended,
        falloff,
        Openness { faces: Faces::Front, ..PLAIN },
        Openness { faces: Faces::Front, ..falloff },
    ]
}

#[test]
#[ignore = "needs an adapter with ray query"]
fn openness_agrees_ray_by_ray() {
    let gpu = gpu(GBufferBy::Rays);
    println!("{}", gpu.describe());
    for name in ["curtain-arcade", "pillar", "leaves", "thick-box"] {
        let scene = library::scene(name).unwrap();
        let view = View { resolution: [80, 20], ..scene.measure.view() };
        compare(&gpu, &scene, &view, 8, &methods());
        let view = View { resolution: [60, 40], ..scene.look.view() };
        compare(&gpu, &scene, &view, 4, &methods());
    }
}

/// Triangles without an area are in the buffer but not in the way.
#[test]
#[ignore = "needs an adapter with ray query"]
fn flat_triangles_and_rasterised_points_are_no_trouble() {
    let mut scene = library::scene("curtain-open").unwrap();
    let mut flat = Mesh::default();
    for i in 0..50 {
        let at = flat.push_vertex(Vec3::new(i as f32 * 0.01, 0.05, 0.0));
        let end = flat.push_vertex(Vec3::new(i as f32 * 0.01, 0.3, 0.1));
        flat.triangles.extend([[at, end, end], [at, at, at]]);
    }
    scene.objects[0].mesh.append(&flat);
    let view = View { resolution: [80, 20], ..scene.measure.view() };
    compare(&gpu(GBufferBy::Raster), &scene, &view, 8, &methods());
}

#[test]
#[ignore = "needs an adapter with ray query"]
fn local_indirect_light_agrees() {
    let gpu = gpu(GBufferBy::Rays);
    let scene = library::scene("curtain-room").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = View { resolution: [80, 20], ..scene.measure.view() };
    let estimator = Estimator::LocalIndirect(LocalIndirect { falloff: Falloff::Step, scale: Scale::default() });
    let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays: 8, seed: 9, replicate: 0 };
    let a = Cpu.load(&geometry).unwrap().render(&job).unwrap();
    let b = gpu.load(&geometry).unwrap().render(&job).unwrap();
    let differ = a.values.iter().zip(&b.values).filter(|(a, b)| (**a - **b).abs() > 1e-4).count();
    println!("{}, local indirect light: {differ} of {} pixels differ", scene.name, a.values.len());
    assert!(differ as u64 * 10_000 <= a.values.len() as u64 * 8 * 2, "{differ}");
}

/// On an adapter without, an error says so; on one with, the adapter does.
#[test]
fn what_is_asked_for_is_done_or_refused() {
    match Gpu::with(Options { traversal: Traversal::RayQuery, ..Options::default() }) {
        Ok(gpu) => assert!(gpu.describe().contains("ray query"), "{}", gpu.describe()),
        Err(e) => {
            let message = e.to_string();
            assert!(message.contains("ray query") && message.contains("--traversal software"), "{message}");
        }
    }
    let unless_asked = Gpu::open().unwrap_or_else(|e| panic!("{e}"));
    assert!(!unless_asked.describe().contains("ray query"), "{}", unless_asked.describe());
}

#[test]
fn the_cpu_has_no_traversal_to_choose() {
    let dir = tempfile::tempdir().unwrap();
    for verb in ["render", "composite", "run"] {
        let scene = if verb == "run" { "thin-occluders" } else { "plane" };
        let args = [verb, scene, "--renderer", "cpu", "--traversal", "software", "--out", "x.png"];
        let output = Command::new(env!("CARGO_BIN_EXE_aogauge")).current_dir(dir.path()).args(args).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains("--traversal is for the GPU"), "{stderr}");
    }
}

/// What an adapter lacks costs the cases on it, and not those on the CPU.
#[test]
fn a_run_goes_on_without_what_the_adapter_lacks() {
    let lacks = Gpu::with(Options { traversal: Traversal::RayQuery, ..Options::default() }).is_err();
    let dir = tempfile::tempdir().unwrap();
    let suite = "description = 'x'\nscenes = ['plane']\nrays = [4]\nreplicates = 2\nconverged_rays = 16\n\
                 look_rays = 1\n[[estimator]]\nname = 'classic'\nkind = 'classic'\n";
    std::fs::write(dir.path().join("x.toml"), suite).unwrap();
    let args = ["run", "x.toml", "--renderer", "gpu", "--traversal", "ray-query", "--no-cache", "--out", "out"];
    let output = Command::new(env!("CARGO_BIN_EXE_aogauge")).current_dir(dir.path()).args(args).output().unwrap();
    let record = aogauge::record::Record::read(&dir.path().join("out")).unwrap();
    let errors: Vec<&str> = record.cases.iter().map(|c| c.error.as_deref().unwrap_or_default()).collect();
    let stderr = String::from_utf8_lossy(&output.stderr);
    if lacks {
        assert_eq!(output.status.code(), Some(5), "{stderr}");
        assert!(errors.len() == 2 && errors[0].is_empty() && errors[1].contains("ray query"), "{errors:?}");
    } else {
        assert_eq!((output.status.code(), errors), (Some(0), vec!["", ""]), "{stderr}");
    }
}
