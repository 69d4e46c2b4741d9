//! How an image is made: what is estimated ([`Estimator`]), by whom
//! ([`Renderer`]), and what comes out ([`Frame`]).

pub mod ao;
pub mod brdf;
pub mod composite;
pub mod cpu;
mod estimator;
pub mod external;
pub mod gbuffer;
pub mod gpu;
mod indirect;
pub mod lights;
pub mod materials;
pub mod path;
pub(crate) mod patience;
pub mod sampler;
pub mod screen_space;
pub mod smoothing;

pub use estimator::{
    Estimator, Extension, Faces, Falloff, Kind, LocalIndirect, Openness, ReceiverPlane, Scale, SecondaryOrigin, Sides,
};

pub use screen_space::ScreenSpace;

use crate::trace::Tracer;
use aogauge_scenes::{AoScale, Environment, Object, Scene, View};
use glam::Vec3;
use lights::Lights;

/// One image: a value a pixel, row by row from the top left.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// What the estimator computes, openness in [0, 1] or light by luminance; NaN
    /// where the view meets no surface. Few slices of `gtao` may read above 1, and
    /// few directions of `hbao` below 0: only their mean has bounds.
    pub values: Vec<f32>,
    /// The same by linear red, green and blue, for estimators that know colour.
    pub colors: Option<Vec<[f32; 3]>>,
    /// How each ray was decided, for up to 32 rays a pixel: see
    /// [`ao::Decisions`]. None for images that were smoothed.
    pub decisions: Option<Vec<ao::Decisions>>,
    /// The triangle that each pixel sees, in the order of the scene; `u32::MAX`
    /// for none.
    pub seen: Vec<u32>,
    /// Time the rays took, and smoothing after them, over all its frames, seconds:
    /// wall clock on the CPU, timestamp queries on the GPU (wall clock of the
    /// submission where the adapter has none).
    pub seconds: f64,
}

/// What to render of a loaded scene.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// From where.
    pub view: &'a View,
    /// The camera whose depth and normals a method of screen space takes, where
    /// that is not the view itself; others ignore it. What it does not show is
    /// NaN.
    pub camera: Option<&'a View>,
    /// What.
    pub estimator: Estimator,
    /// R and R'.
    pub ao: AoScale,
    /// N, primary rays a pixel; slices or directions in screen space.
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
    /// The distant light.
    pub environment: Environment,
    /// What can be aimed at.
    pub lights: Lights,
    /// Linear diffuse albedo of each triangle, in the order of the scene.
    albedo: Vec<[f32; 3]>,
    /// Radiance each triangle sends out, from both sides; empty where none does.
    emission: Vec<[f32; 3]>,
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
        let mut emission: Vec<[f32; 3]> = scene.objects.iter().flat_map(Object::emissions).collect();
        let lights = Lights::new(scene, &triangles, &emission);
        if !lights.has_emitters() {
            emission.clear();
        }
        let tracer = Tracer::new(&triangles);
        check_rounding(&tracer, scene.ao.radius)?;
        Ok(Geometry { tracer, environment: scene.environment.clone(), lights, albedo, emission })
    }

    /// Whether an estimator's R, its own or that of `ao`, is large enough for the
    /// scene's rounding errors.
    ///
    /// # Errors
    /// [`RenderError::Rounding`] where it is not.
    pub fn suits(&self, estimator: &Estimator, ao: AoScale) -> Result<(), RenderError> {
        match estimator {
            Estimator::Openness(o) => check_rounding(&self.tracer, o.scale.on(ao).radius),
            Estimator::LocalIndirect(l) => check_rounding(&self.tracer, l.scale.on(ao).radius),
            Estimator::ScreenSpace(s) => check_rounding(&self.tracer, s.radius(ao)),
            Estimator::PathTraced => Ok(()),
        }
    }

    /// Linear diffuse albedo of a triangle: red, green and blue.
    pub fn albedo(&self, triangle: u32) -> Vec3 {
        Vec3::from(self.albedo[triangle as usize])
    }

    /// Radiance that a triangle sends out: red, green and blue.
    pub fn emitted(&self, triangle: u32) -> Vec3 {
        self.emission.get(triangle as usize).map_or(Vec3::ZERO, |e| Vec3::from(*e))
    }
}

/// Whether R is large enough for the scene's rounding errors.
fn check_rounding(tracer: &Tracer, radius: f32) -> Result<(), RenderError> {
    let unit = 2.0f32.powi(19);
    if tracer.offset() > MAX_OFFSET * radius {
        let magnitude = tracer.offset() * unit;
        return Err(RenderError::Rounding { magnitude, radius, largest: MAX_OFFSET * radius * unit });
    }
    Ok(())
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

    /// The same, but None where it ended before it was done because `go_on` said no. A
    /// renderer that cannot ask in between does not: it renders the whole image.
    ///
    /// # Errors
    /// As [`Loaded::render`].
    fn render_while(
        &mut self,
        job: &Job<'_>,
        _go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<Frame>, RenderError> {
        self.render(job).map(Some)
    }
}

/// Why an image could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The scene is too large for its R in 32-bit floats.
    #[error(
        "the scene reaches {magnitude} m from the centre of its measure view or the origin, but with R = {radius} m (ao.radius, or an estimator's own) it must stay within {largest} m: beyond, rounding errors would show in openness"
    )]
    Rounding {
        /// The largest coordinate, metres.
        magnitude: f32,
        /// R, metres.
        radius: f32,
        /// The largest coordinate allowed, metres.
        largest: f32,
    },
    /// The renderer does not know the estimator.
    #[error("the {renderer} renderer does not compute '{kind}'; it knows {knows}")]
    Unsupported {
        /// `gpu`.
        renderer: &'static str,
        /// What was asked for.
        kind: Kind,
        /// What may be asked for.
        knows: &'static str,
    },
    /// Screen space and smoothing need to know where points appear.
    #[error(
        "screen-space methods, temporal and denoise need a view that is orthographic or perspective, and has an extent"
    )]
    Camera,
    /// A GPU was asked for by name and there is none.
    #[error("no GPU adapter was found: {0}")]
    NoAdapter(String),
    /// The scene is larger than the device takes in one binding.
    #[error("{needs} bytes are needed for the {what}, but the adapter takes at most {limit} in one binding")]
    TooLarge {
        /// Nodes, triangles or pixels.
        what: &'static str,
        /// Bytes needed.
        needs: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// The tree of a scene has more levels than the GPU's stack.
    #[error(
        "the scene's tree has {levels} levels, but the GPU walks at most {limit}: are thousands of its triangles in one place?"
    )]
    TooDeep {
        /// Levels it has.
        levels: usize,
        /// Levels allowed.
        limit: usize,
    },
    /// Triangles cannot be drawn: by this adapter, or into this view.
    #[error("the GPU cannot rasterise the G-buffer: {0}; --g-buffer rays can do without")]
    Raster(String),
    /// The adapter has no ray query, or not for so large a scene.
    #[error("the GPU cannot trace by ray query: {0}; --traversal software can do without")]
    RayQuery(String),
    /// An image holds NaN or infinity where there must be a number.
    #[error(
        "{count} values of replicate {replicate} are no finite numbers although their pixels see a surface, the first at pixel ({x}, {y}): {value}"
    )]
    NotFinite {
        /// How many values.
        count: usize,
        /// In which replicate, counted from 0.
        replicate: u32,
        /// Column of the first, from the left.
        x: u32,
        /// Its row, from the top.
        y: u32,
        /// Its value.
        value: f32,
    },
    /// The device was lost, ran out of memory or refused a command.
    #[error("the GPU failed: {0}")]
    Device(String),
}
