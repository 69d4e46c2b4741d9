//! CPU against GPU, ray by ray. Needs a Vulkan, Metal or DirectX 12 adapter; a
//! software one will do. Without any, these tests fail and say what to install.

#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

use aogauge::{
    render::{Estimator, Frame, Geometry, Job, ReceiverPlane, Renderer, cpu::Cpu, gpu::Gpu},
    scenes::{AoScale, Scene, View, library},
};

fn gpu() -> Gpu {
    Gpu::open().unwrap_or_else(|e| panic!("{e}"))
}

const ESTIMATORS: [Estimator; 3] =
    [Estimator::CLASSIC, Estimator::extended(ReceiverPlane::Counts), Estimator::extended(ReceiverPlane::Clipped)];

#[derive(Default, Debug)]
struct Tally {
    pixels: usize,
    elsewhere: usize,
    rays: u64,
    differently: u64,
    worst: u32,
}

impl Tally {
    /// Counts rays that were decided differently, in pixels that see the same
    /// triangle.
    fn add(&mut self, cpu: &Frame, gpu: &Frame, job: &Job<'_>) {
        let secondary = if job.estimator == Estimator::CLASSIC { 0 } else { 2 };
        let (a, b) = (cpu.decisions.as_ref().unwrap(), gpu.decisions.as_ref().unwrap());
        for i in 0..cpu.values.len() {
            self.pixels += 1;
            if cpu.seen[i] != gpu.seen[i] {
                self.elsewhere += 1;
                continue;
            }
            let primary = (a[i].primary ^ b[i].primary).count_ones();
            let first = (a[i].first ^ b[i].first).count_ones();
            let second = (a[i].second ^ b[i].second).count_ones();
            let differ = primary + first + second;
            let open = job.rays - (a[i].primary & b[i].primary).count_ones();
            self.rays += u64::from(job.rays + secondary * open);
            self.differently += u64::from(differ);
            self.worst = self.worst.max(differ);
            if differ == 0 {
                assert_eq!(cpu.values[i].to_bits(), gpu.values[i].to_bits(), "pixel {i}");
            }
        }
    }

    /// At most 1 ray in 10,000 decides differently, no pixel by more than 2 rays;
    /// pixels that see something else are below .1 %.
    fn check(&self, what: &str) {
        println!("{what}: {self:?}");
        assert!(self.differently * 10_000 <= self.rays, "{what}: {self:?}");
        assert!(self.worst <= 2, "{what}: {self:?}");
        assert!(self.elsewhere * 1000 < self.pixels, "{what}: {self:?}");
    }
}

/// Holds every estimator to its limits by itself.
fn compare(name: &str, view: impl Fn(&Scene) -> View, rays: u32) {
    let gpu = gpu();
    let scene = library::scene(name).unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let (mut on_cpu, mut on_gpu) = (Cpu.load(&geometry).unwrap(), gpu.load(&geometry).unwrap());
    let view = view(&scene);
    for estimator in ESTIMATORS {
        let mut tally = Tally::default();
        for replicate in 0..2 {
            let job = Job { view: &view, estimator, ao: scene.ao, rays, seed: 9, replicate };
            tally.add(&on_cpu.render(&job).unwrap(), &on_gpu.render(&job).unwrap(), &job);
        }
        tally.check(&format!("{name}, {estimator:?}"));
    }
}

#[test]
fn measure_views_agree_ray_by_ray() {
    for name in ["curtain-open", "curtain-arcade", "curtain-room", "pillar", "plane", "corner", "thick-box"] {
        compare(name, |s| s.measure.view(), 32);
    }
}

#[test]
fn look_views_agree_ray_by_ray() {
    for name in ["curtain-room", "pillar"] {
        compare(name, |s| s.look.view(), 8);
    }
}

/// More rays than one dispatch takes, so that the job is split.
#[test]
fn split_jobs_add_up() {
    let gpu = gpu();
    let scene = library::scene("thick-box").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = View { resolution: [64, 16], ..scene.measure.view() };
    let job = Job { view: &view, estimator: ESTIMATORS[1], ao: scene.ao, rays: 9_001, seed: 2, replicate: 1 };
    let on_cpu = Cpu.load(&geometry).unwrap().render(&job).unwrap();
    let on_gpu = gpu.load(&geometry).unwrap().render(&job).unwrap();
    let off: f64 = on_cpu.values.iter().zip(&on_gpu.values).map(|(a, b)| f64::from((a - b).abs())).sum();
    assert!(off / 1024.0 < 1e-4, "mean difference {}", off / 1024.0);
    assert!(on_gpu.seconds > 0.0);
}

/// More pixels than one dispatch has workgroups for.
#[test]
fn large_views_are_split() {
    let gpu = gpu();
    let scene = library::scene("curtain-open").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = View { resolution: [4096, 1024], ..scene.measure.view() };
    let job = Job { view: &view, estimator: ESTIMATORS[0], ao: scene.ao, rays: 1, seed: 2, replicate: 1 };
    let on_cpu = Cpu.load(&geometry).unwrap().render(&job).unwrap();
    let on_gpu = gpu.load(&geometry).unwrap().render(&job).unwrap();
    let off =
        on_cpu.values.iter().zip(&on_gpu.values).filter(|(a, b)| a.to_bits() != b.to_bits() && !a.is_nan()).count();
    assert!(off * 1000 < on_cpu.values.len(), "{off} of {} pixels", on_cpu.values.len());
}

/// Same adapter, same job, same bits; and a change of view size in between.
#[test]
fn repeated_renders_are_identical() {
    let gpu = gpu();
    let scene = library::scene("curtain-open").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let mut loaded = gpu.load(&geometry).unwrap();
    let (measure, look) = (scene.measure.view(), scene.look.view());
    let ao = AoScale { radius: 0.3, secondary_radius: 0.05 };
    let mut render = |view| {
        let job = Job { view, estimator: ESTIMATORS[2], ao, rays: 4, seed: 1, replicate: 0 };
        loaded.render(&job).unwrap().values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    let first = render(&measure);
    assert_ne!(first.len(), render(&look).len());
    assert_eq!(first, render(&measure));
}
