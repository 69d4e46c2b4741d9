//! How an image is made: what is estimated ([`Estimator`]), by whom
//! ([`Renderer`]), and what comes out ([`Frame`]).

pub mod ao;
pub mod cpu;
pub mod gbuffer;
pub mod gpu;
pub mod path;
pub mod sampler;

use crate::trace::Tracer;
use aogauge_scenes::{AoScale, Environment, Object, Scene, View};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What happens when a secondary ray meets the receiver's own plane; the paper
/// leaves it open, and it matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ReceiverPlane {
    /// The literal reading: all geometry closes a secondary ray, the receiver
    /// too. An empty plane then reads 1 - (k^2/2)/(1 + k^2) with k = 2R'/R.
    Counts,
    /// Secondary rays are cut at the receiver's tangent plane: an empty plane
    /// reads 1.
    Clipped,
}

/// How openness is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Estimator {
    /// O = share of N cosine-distributed primary rays with no hit within R.
    Classic,
    /// The paper's section 5: every open primary ray casts two secondary rays
    /// about its middle and counts 1 - closed/2.
    Extended {
        /// Whether the receiver closes secondary rays.
        receiver_plane: ReceiverPlane,
    },
}

/// One image: a value a pixel, row by row from the top left.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Openness in [0, 1]; NaN where the view meets no surface.
    pub values: Vec<f32>,
    /// How each ray was decided, for up to 32 rays a pixel: see
    /// [`ao::Decisions`].
    pub decisions: Option<Vec<ao::Decisions>>,
    /// The triangle that each pixel sees, in the order of the scene; `u32::MAX`
    /// for none.
    pub seen: Vec<u32>,
    /// Time the rays took, seconds: wall clock on the CPU, timestamp queries on
    /// the GPU (wall clock of the submission where the adapter has none).
    pub seconds: f64,
}

/// What to render of a loaded scene.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// From where.
    pub view: &'a View,
    /// What.
    pub estimator: Estimator,
    /// R and R'.
    pub ao: AoScale,
    /// N, primary rays a pixel.
    pub rays: u32,
    /// The run's seed.
    pub seed: u32,
    /// Which replicate: each has random numbers of its own.
    pub replicate: u32,
}

/// A scene ready to trace: triangles in a tree, and materials beside them.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// The triangles.
    pub tracer: Tracer,
    /// Diffuse albedo of each triangle, in the order of the scene.
    pub albedo: Vec<f32>,
    /// Luminance of the radiance each triangle sends out, from both sides;
    /// empty where none does.
    pub emission: Vec<f32>,
    /// The distant light.
    pub environment: Environment,
}

/// Largest offset of ray origins that openness is still measured with, in R.
const MAX_OFFSET: f32 = 1e-3;

impl Geometry {
    /// Builds the tree of a scene.
    ///
    /// # Errors
    /// [`RenderError::Rounding`] where the scene is so large for its R that
    /// rounding would show.
    pub fn new(scene: &Scene) -> Result<Self, RenderError> {
        let triangles: Vec<_> = scene.triangles().map(|(_, corners)| corners).collect();
        let albedo = scene.objects.iter().flat_map(Object::albedos).collect();
        let mut emission: Vec<f32> = scene.objects.iter().flat_map(Object::emissions).collect();
        if emission.iter().all(|&e| e <= 0.0) {
            emission.clear();
        }
        let tracer = Tracer::new(&triangles);
        let (offset, radius) = (tracer.offset(), scene.ao.radius);
        if offset > MAX_OFFSET * radius {
            let magnitude = offset * 2.0f32.powi(19);
            return Err(RenderError::Rounding { magnitude, radius, largest: MAX_OFFSET * radius * 2.0f32.powi(19) });
        }
        Ok(Geometry { tracer, albedo, emission, environment: scene.environment.clone() })
    }

    /// Luminance of the radiance that a triangle sends out.
    pub fn emitted(&self, triangle: u32) -> f32 {
        self.emission.get(triangle as usize).copied().unwrap_or(0.0)
    }
}

/// Who computes images. A renderer loads a scene once and renders it often.
pub trait Renderer {
    /// Makes a scene ready.
    ///
    /// # Errors
    /// [`RenderError`] where the scene does not fit the device.
    fn load<'a>(&'a self, geometry: &'a Geometry) -> Result<Box<dyn Loaded + 'a>, RenderError>;
}

/// A scene on its device.
pub trait Loaded {
    /// Renders one replicate.
    ///
    /// # Errors
    /// [`RenderError`] where the device fails; the next call may succeed.
    fn render(&mut self, job: &Job<'_>) -> Result<Frame, RenderError>;
}

/// Why an image could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The scene is too large for its R in 32-bit floats.
    #[error(
        "coordinates reach {magnitude} m, but with ao.radius = {radius} m they must stay below {largest} m: beyond, rounding errors would show in openness"
    )]
    Rounding {
        /// The largest coordinate, metres.
        magnitude: f32,
        /// R, metres.
        radius: f32,
        /// The largest coordinate allowed, metres.
        largest: f32,
    },
    /// A GPU was asked for by name and there is none.
    #[error("no GPU adapter was found: {0}")]
    NoAdapter(String),
    /// The scene is larger than the device takes in one binding.
    #[error("the scene needs {needs} bytes for its {what}, but the adapter takes at most {limit} in one binding")]
    TooLarge {
        /// Nodes, triangles or pixels.
        what: &'static str,
        /// Bytes needed.
        needs: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// The device was lost, ran out of memory or refused a command.
    #[error("the GPU failed: {0}")]
    Device(String),
}
