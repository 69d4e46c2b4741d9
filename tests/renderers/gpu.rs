//! CPU against GPU, ray by ray. Needs a Vulkan, Metal or DirectX 12 adapter; a
//! software one will do. Without any, these tests fail and say what to install.

use aogauge::{
    render::{
        Estimator, Extension, Faces, Falloff, Frame, Geometry, Job, LocalIndirect, Openness, ReceiverPlane,
        RenderError, Renderer, Scale, SecondaryOrigin, Sides, cpu::Cpu, gpu::Checks, gpu::Gpu, gpu::Options,
    },
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
    /// Whether pixels whose rays are decided alike must be equal to the last bit.
    exact: bool,
}

impl Tally {
    /// Counts rays that were decided differently, in pixels that see the same
    /// triangle.
    fn add(&mut self, cpu: &Frame, gpu: &Frame, job: &Job<'_>) {
        let Estimator::Openness(method) = job.estimator else { panic!("{:?}", job.estimator) };
        let secondary = method.extension.map_or(0, |e| e.secondary_rays);
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
                // Without falloff sums are exact; else the exponential's last bits
                // and the order of addition show. What no bit tells of, a third
                // secondary ray, shows in the value.
                let (a, b) = (cpu.values[i], gpu.values[i]);
                if self.exact {
                    assert_eq!(a.to_bits(), b.to_bits(), "pixel {i}");
                } else if (a - b).abs() > 2e-6 && !(a.is_nan() && b.is_nan()) {
                    self.differently += 1;
                    self.worst = self.worst.max(1);
                }
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
fn compare(name: &str, view: impl Fn(&Scene) -> View, rays: u32, estimators: &[Estimator]) {
    let gpu = gpu();
    let scene = library::scene(name).unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let (mut on_cpu, mut on_gpu) = (Cpu.load(&geometry).unwrap(), gpu.load(&geometry).unwrap());
    let view = view(&scene);
    for &estimator in estimators {
        let exact = ESTIMATORS.contains(&estimator);
        let mut tally = Tally { exact, ..Tally::default() };
        for replicate in 0..2 {
            let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays, seed: 9, replicate };
            tally.add(&on_cpu.render(&job).unwrap(), &on_gpu.render(&job).unwrap(), &job);
        }
        tally.check(&format!("{name}, {estimator:?}"));
    }
}

#[test]
fn measure_views_agree_ray_by_ray() {
    for name in ["curtain-open", "curtain-arcade", "curtain-room", "pillar", "plane", "corner", "thick-box"] {
        compare(name, |s| s.measure.view(), 32, &ESTIMATORS);
    }
}

/// Every falloff and every option of the extension, each by itself and some
/// together.
#[test]
fn all_options_agree_ray_by_ray() {
    let falloffs = [
        Falloff::Exponential { extinction: 8.0 },
        Falloff::LinearTail { tail: 0.615 },
        Falloff::Gaussian { lambda: 2.0, floor: 0.07, reflectance: 0.5 },
    ];
    let step = Openness::plain(Falloff::Step);
    let extended = |falloff, secondary_rays, sides, origin| {
        let extension = Some(Extension { receiver_plane: ReceiverPlane::Clipped, secondary_rays, sides, origin });
        Openness { extension, ..Openness::plain(falloff) }
    };
    let (middle, jittered) = (SecondaryOrigin::Middle, SecondaryOrigin::Jittered);
    let mut methods: Vec<Openness> = falloffs.into_iter().map(Openness::plain).collect();
    methods.extend(falloffs.map(|f| extended(f, 2, Sides::Two, middle)));
    methods.push(extended(Falloff::Step, 1, Sides::Two, middle));
    methods.push(extended(Falloff::Step, 3, Sides::One, middle));
    methods.push(extended(Falloff::Step, 8, Sides::Two, jittered));
    methods.push(extended(falloffs[0], 5, Sides::One, jittered));
    methods.push(Openness::plain(Falloff::Quadratic));
    methods.push(Openness { faces: Faces::Front, ..step });
    methods.push(Openness { faces: Faces::Front, ..extended(falloffs[1], 2, Sides::Two, middle) });
    methods.push(Openness { intensity: 1.7, scale: Scale { radius: Some(0.4), secondary_radius: None }, ..step });
    let estimators: Vec<Estimator> = methods.into_iter().map(Estimator::Openness).collect();
    compare("curtain-arcade", |s| s.measure.view(), 16, &estimators);
    compare("pillar", |s| View { resolution: [96, 64], ..s.look.view() }, 8, &estimators);
}

/// Local indirect light follows the same paths: few pixels differ by as much as a
/// path that met something else, and images by channel are equal in the mean.
#[test]
fn local_indirect_light_agrees_path_by_path() {
    let gpu = gpu();
    let mut scene = library::scene("curtain-room").unwrap();
    scene.objects[1].material.base_color = [0.8, 0.2, 0.1];
    let geometry = Geometry::new(&scene).unwrap();
    let (mut on_cpu, mut on_gpu) = (Cpu.load(&geometry).unwrap(), gpu.load(&geometry).unwrap());
    let view = scene.measure.view();
    for falloff in [Falloff::Step, Falloff::Exponential { extinction: 6.0 }] {
        let estimator = Estimator::LocalIndirect(LocalIndirect { falloff, scale: Scale::default() });
        let rays = 20;
        let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays, seed: 9, replicate: 0 };
        let (a, b) = (on_cpu.render(&job).unwrap(), on_gpu.render(&job).unwrap());
        let differ = a.values.iter().zip(&b.values).filter(|(a, b)| (**a - **b).abs() > 1e-4).count();
        println!("{falloff:?}: {differ} of {} pixels", a.values.len());
        assert!(differ as u64 * 10_000 <= a.values.len() as u64 * u64::from(rays), "{falloff:?}: {differ}");
        let (a, b) = (a.colors.unwrap(), b.colors.unwrap());
        for c in 0..3 {
            let mean = |colors: &[[f32; 3]]| colors.iter().map(|v| f64::from(v[c])).sum::<f64>() / colors.len() as f64;
            assert!((mean(&a) - mean(&b)).abs() < 1e-5, "channel {c}: {} and {}", mean(&a), mean(&b));
        }
    }
}

#[test]
fn what_the_gpu_does_not_compute_is_refused() {
    let gpu = gpu();
    let scene = library::scene("plane").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let job = Job {
        view: &view,
        camera: None,
        estimator: Estimator::PathTraced,
        ao: scene.ao,
        rays: 4,
        seed: 1,
        replicate: 0,
    };
    let message = gpu.load(&geometry).unwrap().render(&job).unwrap_err().to_string();
    assert!(message.contains("path-traced") && message.contains("gpu"), "{message}");
}

#[test]
fn look_views_agree_ray_by_ray() {
    for name in ["curtain-room", "pillar", "blinds", "banner"] {
        compare(name, |s| s.look.view(), 8, &ESTIMATORS);
    }
}

/// More rays than one dispatch takes, so that the job is split.
#[test]
fn split_jobs_add_up() {
    let gpu = gpu();
    let scene = library::scene("thick-box").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = View { resolution: [64, 16], ..scene.measure.view() };
    let job =
        Job { view: &view, camera: None, estimator: ESTIMATORS[1], ao: scene.ao, rays: 9_001, seed: 2, replicate: 1 };
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
    let job = Job { view: &view, camera: None, estimator: ESTIMATORS[0], ao: scene.ao, rays: 1, seed: 2, replicate: 1 };
    let on_cpu = Cpu.load(&geometry).unwrap().render(&job).unwrap();
    let on_gpu = gpu.load(&geometry).unwrap().render(&job).unwrap();
    let off =
        on_cpu.values.iter().zip(&on_gpu.values).filter(|(a, b)| a.to_bits() != b.to_bits() && !a.is_nan()).count();
    assert!(off * 1000 < on_cpu.values.len(), "{off} of {} pixels", on_cpu.values.len());
}

/// Nothing to see and nothing to meet.
#[test]
fn a_scene_without_triangles_is_empty() {
    let mut scene = library::scene("plane").unwrap();
    let view = View { resolution: [5, 3], ..scene.look.view() };
    scene.objects.clear();
    let geometry = Geometry::new(&scene).unwrap();
    for checks in [Checks::On, Checks::Off] {
        let gpu = Gpu::with(Options { checks, ..Options::default() }).unwrap();
        let job =
            Job { view: &view, camera: None, estimator: ESTIMATORS[2], ao: scene.ao, rays: 4, seed: 1, replicate: 0 };
        let frame = gpu.load(&geometry).unwrap().render(&job).unwrap();
        assert!(frame.values.iter().all(|v| v.is_nan()) && frame.seen.iter().all(|&t| t == u32::MAX));
    }
}

/// Shaders run without checks of indices and loops; with them they find the same.
#[test]
fn checks_change_nothing() {
    let scene = library::scene("atrium").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = View { resolution: [101, 53], ..scene.look.view() };
    let step = Openness { faces: Faces::Front, ..Openness::plain(Falloff::Step) };
    let falloff = Falloff::LinearTail { tail: 0.6 };
    let indirect = Estimator::LocalIndirect(LocalIndirect { falloff, scale: Scale::default() });
    let images = [Checks::On, Checks::Off].map(|checks| {
        let gpu = Gpu::with(Options { checks, ..Options::default() }).unwrap();
        let mut loaded = gpu.load(&geometry).unwrap();
        [ESTIMATORS[0], ESTIMATORS[1], ESTIMATORS[2], Estimator::Openness(step), indirect].map(|estimator| {
            let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays: 4, seed: 3, replicate: 0 };
            loaded.render(&job).unwrap().values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
        })
    });
    assert_eq!(images[0], images[1]);
}

/// A view whose image no adapter takes in one binding is refused before anything
/// of it is made, and the next one is rendered.
#[test]
fn views_beyond_a_binding_are_refused() {
    let gpu = gpu();
    let scene = library::scene("plane").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let mut loaded = gpu.load(&geometry).unwrap();
    let view = View { resolution: [65_535, 65_535], ..scene.measure.view() };
    let job = Job { view: &view, camera: None, estimator: ESTIMATORS[0], ao: scene.ao, rays: 1, seed: 1, replicate: 0 };
    let error = loaded.render(&job).unwrap_err();
    assert!(matches!(error, RenderError::TooLarge { what: "surfaces", .. }), "{error}");
    assert!(loaded.render(&Job { view: &scene.measure.view(), ..job }).is_ok());
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
        let job = Job { view, camera: None, estimator: ESTIMATORS[2], ao, rays: 4, seed: 1, replicate: 0 };
        loaded.render(&job).unwrap().values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    let first = render(&measure);
    assert_ne!(first.len(), render(&look).len());
    assert_eq!(first, render(&measure));
}
