//! What `aogauge bench` measures: how long AO takes, and what the extension adds.

pub mod cpu;

use crate::{
    render::{
        Estimator, Geometry, Job, ReceiverPlane, RenderError,
        gpu::{Clock, Gpu, Rounds, Timed},
    },
    scenes::{LookView, Scene},
    stats::Spread,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Version of the format.
pub const VERSION: u32 = 1;

/// Methods that are timed, the one without extension first.
const METHODS: [(&str, Estimator); 3] = [
    ("classic", Estimator::CLASSIC),
    ("extended, clipped", Estimator::extended(ReceiverPlane::Clipped)),
    ("extended, counts", Estimator::extended(ReceiverPlane::Counts)),
];

/// Most rays a pixel: those whose decisions are kept.
pub const MOST_RAYS: u32 = 32;

/// What was measured on one adapter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GpuBench {
    /// Version of this format.
    pub version: u32,
    /// Version of the tool.
    pub tool: String,
    /// Adapter, driver and backend.
    pub adapter: String,
    /// Whether the adapter computes on the CPU.
    pub is_software: bool,
    /// What times were taken by.
    pub clock: Clock,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Rounds before those that count.
    pub warm_up: u32,
    /// Rounds that count; medians are over them.
    pub rounds: u32,
    /// Scene by scene.
    pub scenes: Vec<SceneBench>,
}

/// Times of one scene's look view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneBench {
    /// Its name.
    pub name: String,
    /// Triangles.
    pub triangles: usize,
    /// R, metres.
    pub radius: f64,
    /// R', metres.
    pub secondary_radius: f64,
    /// Pixels that see a surface.
    pub pixels: u64,
    /// Milliseconds to find what the view sees.
    pub g_buffer_ms: Spread,
    /// Methods by number of rays.
    pub methods: Vec<MethodBench>,
}

/// Times of one method at one number of rays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MethodBench {
    /// The method.
    pub method: String,
    /// Primary rays a pixel.
    pub rays: u32,
    /// Milliseconds of AO.
    pub ms: Spread,
    /// Milliseconds more than without extension, round by round; null for the
    /// method without.
    pub extra_ms: Option<Spread>,
    /// Primary rays, all pixels.
    pub primary_rays: u64,
    /// Secondary rays, all pixels.
    pub secondary_rays: u64,
    /// Rays of all kinds a second in the median, millions; null where it took no
    /// time that the clock could tell.
    pub million_rays_a_second: Option<f64>,
    /// Secondary rays over the extra time in the median, millions a second; null
    /// without extension, and where it took no time.
    pub million_secondary_rays_a_second: Option<f64>,
}

/// What to measure.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Primary rays a pixel, each at most [`MOST_RAYS`].
    pub rays: Vec<u32>,
    /// How often.
    pub rounds: Rounds,
    /// Seed of all randomness.
    pub seed: u32,
}

/// Times classic and extended AO from a scene's look view. `tell` is called
/// after each round.
///
/// # Errors
/// [`RenderError`] where the scene does not fit the device, or that fails.
pub fn scene(gpu: &Gpu, scene: &Scene, settings: &Settings, tell: impl FnMut(u32)) -> Result<SceneBench, RenderError> {
    let scene = scene.near_origin();
    let geometry = Geometry::new(&scene)?;
    let view = LookView { resolution: settings.resolution, ..scene.look }.view();
    let cases: Vec<(u32, &str, Estimator)> =
        settings.rays.iter().flat_map(|&rays| METHODS.map(|(name, estimator)| (rays, name, estimator))).collect();
    let jobs: Vec<Job<'_>> = cases
        .iter()
        .map(|&(rays, _, estimator)| Job {
            view: &view,
            camera: None,
            estimator,
            ao: scene.ao,
            rays,
            seed: settings.seed,
            replicate: 0,
        })
        .collect();
    let timed = gpu.time(&geometry, &jobs, settings.rounds, tell)?;
    let see: Vec<f64> = timed.iter().flat_map(|t| &t.see).copied().collect();
    let methods = cases.iter().zip(timed.chunks(METHODS.len()).flat_map(|group| group.iter().map(|t| (t, &group[0]))));
    Ok(SceneBench {
        name: scene.name.clone(),
        triangles: geometry.tracer.triangles().len(),
        radius: f64::from(scene.ao.radius),
        secondary_radius: f64::from(scene.ao.secondary_radius),
        pixels: timed.first().map_or(0, |t| t.pixels),
        g_buffer_ms: spread_ms(&see),
        methods: methods.map(|(case, (timed, classic))| method(case, timed, classic)).collect(),
    })
}

fn method(&(rays, name, _): &(u32, &str, Estimator), timed: &Timed, classic: &Timed) -> MethodBench {
    let ms = spread_ms(&timed.shade);
    let extended = timed.secondary > 0;
    let extra: Vec<f64> = timed.shade.iter().zip(&classic.shade).map(|(own, classic)| own - classic).collect();
    let extra_ms = extended.then(|| spread_ms(&extra));
    let millions = |rays: u64, ms: f64| (ms > 0.0).then(|| rays as f64 / ms * 1e-3);
    MethodBench {
        method: name.to_owned(),
        rays,
        ms,
        extra_ms,
        primary_rays: timed.primary,
        secondary_rays: timed.secondary,
        million_rays_a_second: millions(timed.primary + timed.secondary, ms.median),
        million_secondary_rays_a_second: extra_ms.and_then(|extra| millions(timed.secondary, extra.median)),
    }
}

fn spread_ms(seconds: &[f64]) -> Spread {
    let nothing = Spread { least: 0.0, lower: 0.0, median: 0.0, upper: 0.0 };
    Spread::of(seconds).map_or(nothing, |s| s.times(1e3))
}
