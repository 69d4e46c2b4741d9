//! The GPU renderer: compute shaders through wgpu, on hardware or on a software
//! driver. Each WGSL stage stands beside its CPU twin under the same name.

mod adapter;
mod composite;
mod device;
mod drivers;
mod loaded;
mod params;
mod persistent;
mod query;
mod raster;
mod screen_space;
#[cfg(test)]
pub(crate) mod tests;
mod timing;

pub use adapter::{Adapter, Features, Limits, survey};
pub use composite::Lit;
pub use drivers::{Maker, System};
pub use persistent::Persistent;

use super::{Geometry, Loaded, RenderError, Renderer};
pub use device::Checks;
use device::{Device, Kernel, Setup};
use loaded::LoadedGpu;
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};
pub use timing::{Clock, Rounds, Timed};

/// How rays find triangles and meet them, by the renderer's own tree. One of these
/// two is put before every shader that traces.
const TRACE: &str = concat!(
    include_str!("shaders/trace.wgsl"),
    include_str!("shaders/survey.wgsl"),
    include_str!("shaders/triangle.wgsl")
);

/// The same by ray query.
const TRACE_QUERY: &str = concat!(include_str!("shaders/trace_query.wgsl"), include_str!("shaders/triangle.wgsl"));

/// The shader of what a view sees, openness and indirect light.
const SHADER: &str = concat!(
    include_str!("shaders/sampler.wgsl"),
    include_str!("shaders/surface.wgsl"),
    include_str!("shaders/ao.wgsl"),
    include_str!("shaders/indirect.wgsl")
);

/// The shader of screen space.
const SCREEN_SPACE: &str = concat!(
    include_str!("shaders/sampler.wgsl"),
    include_str!("shaders/surface.wgsl"),
    include_str!("shaders/screen_space.wgsl"),
    include_str!("shaders/hbao.wgsl"),
    include_str!("shaders/gtao.wgsl")
);

/// Values of a shader's `override` constants by name. What a whole dispatch shares
/// is a constant of its kernel: the driver then drops what an estimator does not
/// use, and the registers it would take.
type Constants = Vec<(&'static str, u32)>;

/// Source, entry point and constants.
type KernelKey = (&'static str, &'static str, Constants);

/// How the GPU finds what each pixel of a view sees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum GBufferBy {
    /// One ray a pixel, as on the CPU.
    #[default]
    Rays,
    /// Triangles are drawn, as in a hybrid renderer.
    Raster,
}

/// How the GPU finds the triangles that a ray meets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Traversal {
    /// The renderer's own tree, in a shader: on every adapter the same.
    #[default]
    Software,
    /// The driver's acceleration structure, where there is one. Experimental in wgpu.
    RayQuery,
}

/// How the GPU is to render.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// How it finds what each pixel sees.
    pub g_buffer: GBufferBy,
    /// How it finds what a ray meets.
    pub traversal: Traversal,
    /// Whether its shaders check what they do at run time.
    pub checks: Checks,
}

/// A device with its kernels.
pub struct Gpu {
    device: Device,
    /// Those that were used.
    kernels: Mutex<BTreeMap<KernelKey, Arc<Kernel>>>,
    /// How it was opened.
    setup: Setup,
}

impl Gpu {
    /// Opens the best adapter there is, with the options that are the default.
    ///
    /// # Errors
    /// As of [`Gpu::with`].
    pub fn open() -> Result<Self, RenderError> {
        Self::with(Options::default())
    }

    /// Opens the best adapter there is: hardware before software. `WGPU_BACKEND`
    /// and `WGPU_ADAPTER_NAME` narrow the choice.
    ///
    /// # Errors
    /// [`RenderError::NoAdapter`] where there is none, [`RenderError::Device`]
    /// where it cannot be opened, [`RenderError::Raster`] and
    /// [`RenderError::RayQuery`] where it cannot do what the options ask for.
    pub fn with(options: Options) -> Result<Self, RenderError> {
        Self::set_up(Setup { options, ..Setup::default() })
    }

    fn set_up(setup: Setup) -> Result<Self, RenderError> {
        let adapter = adapter::best(setup.flags)?;
        let by_query = query::is_chosen(setup.options.traversal, &adapter)?;
        let mut device = Device::open(&adapter, &setup, by_query)?;
        if setup.options.g_buffer == GBufferBy::Raster {
            raster::check(&adapter)?;
            // Mesa 22.3's stamps compute passes wrongly once something was drawn.
            if device.is_software() {
                device.ignore_timestamps();
            }
        }
        Ok(Gpu { device, kernels: Mutex::default(), setup })
    }

    /// The same adapter, opened anew.
    fn again(&self) -> Result<Self, RenderError> {
        let gpu = Self::set_up(self.setup.clone())?;
        let (was, is) = (self.describe(), gpu.describe());
        if was != is {
            return Err(RenderError::Device(format!("{was} is gone; there is only {is}")));
        }
        Ok(gpu)
    }

    /// Whether the device is of no use any more.
    fn is_lost(&self) -> bool {
        self.device.is_lost()
    }

    /// How rays find triangles and meet them.
    fn trace(&self) -> &'static str {
        if self.device.ray_query { TRACE_QUERY } else { TRACE }
    }

    /// An entry point of a shader that traces no rays.
    fn kernel(&self, source: &'static str, entry: &'static str) -> Result<Arc<Kernel>, RenderError> {
        self.compiled("", (source, entry, Constants::new()))
    }

    /// An entry point of one that does, for these values of its `override`
    /// constants. What traces rays is put before the source.
    fn tracing_kernel(
        &self,
        source: &'static str,
        entry: &'static str,
        constants: Constants,
    ) -> Result<Arc<Kernel>, RenderError> {
        self.compiled(self.trace(), (source, entry, constants))
    }

    /// Compiles what is used for the first time.
    fn compiled(&self, before: &str, key: KernelKey) -> Result<Arc<Kernel>, RenderError> {
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kernel) = kernels.get(&key) {
            return Ok(kernel.clone());
        }
        let (source, entry, constants) = &key;
        let values: Vec<(&str, f64)> = constants.iter().map(|&(name, value)| (name, f64::from(value))).collect();
        let kernel = Arc::new(self.device.kernel(&[before, source].concat(), entry, &values)?);
        kernels.insert(key, kernel.clone());
        Ok(kernel)
    }

    /// Adapter, driver and backend, and what is not done as it usually is, for
    /// people.
    pub fn describe(&self) -> String {
        let i = &self.device.info;
        let driver = [i.driver.as_str(), i.driver_info.as_str()].join(" ");
        let query = if self.device.ray_query { ", rays by ray query" } else { "" };
        let raster = if self.setup.options.g_buffer == GBufferBy::Raster { ", G-buffer by rasterisation" } else { "" };
        format!("{}, {} ({}){query}{raster}", i.name, driver.trim(), i.backend)
    }

    /// Whether the adapter computes on the CPU, as Mesa's software driver does.
    pub fn is_software(&self) -> bool {
        self.device.is_software()
    }
}

impl Renderer for Gpu {
    fn load<'a>(&'a self, geometry: &'a Geometry) -> Result<Box<dyn Loaded + 'a>, RenderError> {
        Ok(Box::new(LoadedGpu::new(self, geometry)?))
    }
}
