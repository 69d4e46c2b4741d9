//! The GPU renderer: compute shaders through wgpu, on hardware or on a software
//! driver. Each WGSL stage stands beside its CPU twin under the same name.

mod device;
mod loaded;
mod params;
mod query;
mod raster;
mod screen_space;
mod timing;

use super::{Geometry, Loaded, RenderError, Renderer};
pub use device::Checks;
use device::{Device, Kernel};
use loaded::LoadedGpu;
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};
pub use timing::{Clock, Rounds, Timed};

/// How rays find triangles and meet them, by the renderer's own tree. One of these
/// two is put before every other shader.
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
    include_str!("shaders/ao.wgsl"),
    include_str!("shaders/indirect.wgsl")
);

/// The shader of screen space.
const SCREEN_SPACE: &str = concat!(
    include_str!("shaders/sampler.wgsl"),
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
    /// Ray query on hardware that has it, by Vulkan; else software.
    #[default]
    Auto,
    /// The renderer's own tree, in a shader: on every adapter the same.
    Software,
    /// The driver's acceleration structure.
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
    options: Options,
    /// Those that were used.
    kernels: Mutex<BTreeMap<KernelKey, Arc<Kernel>>>,
}

/// The backends that aogauge computes on.
fn backends() -> wgpu::Backends {
    wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12
}

/// Hardware before software.
fn preference(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

impl Gpu {
    /// Opens the best adapter there is, with the options that are the default.
    ///
    /// # Errors
    /// As of [`Gpu::with`].
    pub fn open() -> Result<Self, RenderError> {
        Self::with(Options::default())
    }

    /// Opens the best adapter there is: hardware before software. Backends can be
    /// narrowed by `WGPU_BACKEND`.
    ///
    /// # Errors
    /// [`RenderError::NoAdapter`] where there is none, [`RenderError::Device`]
    /// where it cannot be opened, [`RenderError::Raster`] and
    /// [`RenderError::RayQuery`] where it cannot do what the options ask for.
    pub fn with(options: Options) -> Result<Self, RenderError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
        descriptor.backends &= backends();
        let backends = descriptor.backends;
        let instance = wgpu::Instance::new(descriptor);
        let mut adapters = pollster::block_on(instance.enumerate_adapters(backends));
        adapters.sort_by_key(|a| preference(a.get_info().device_type));
        let adapter = adapters.into_iter().next().ok_or_else(|| {
            RenderError::NoAdapter(
                "no Vulkan, Metal or DirectX 12 driver answers; on Debian, `apt-get install mesa-vulkan-drivers libvulkan1` gives a software one"
                    .into(),
            )
        })?;
        let by_query = query::is_chosen(options.traversal, &adapter)?;
        let mut device = Device::open(&adapter, options.checks, by_query)?;
        if options.g_buffer == GBufferBy::Raster {
            raster::check(&adapter)?;
            // Mesa 22.3's stamps compute passes wrongly once something was drawn.
            if device.is_software() {
                device.ignore_timestamps();
            }
        }
        Ok(Gpu { device, options, kernels: Mutex::default() })
    }

    /// How rays find triangles and meet them.
    fn trace(&self) -> &'static str {
        if self.device.ray_query { TRACE_QUERY } else { TRACE }
    }

    /// An entry point of a shader without constants.
    fn kernel(&self, source: &'static str, entry: &'static str) -> Result<Arc<Kernel>, RenderError> {
        self.specialized(source, entry, Constants::new())
    }

    /// An entry point of a shader, compiled when it is first used with these
    /// values of its `override` constants. What traces rays is put before the
    /// source.
    fn specialized(
        &self,
        source: &'static str,
        entry: &'static str,
        constants: Constants,
    ) -> Result<Arc<Kernel>, RenderError> {
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (source, entry, constants);
        if let Some(kernel) = kernels.get(&key) {
            return Ok(kernel.clone());
        }
        let values: Vec<(&str, f64)> = key.2.iter().map(|&(name, value)| (name, f64::from(value))).collect();
        // Screen space traces no ray.
        let trace = if source == SCREEN_SPACE { "" } else { self.trace() };
        let kernel = Arc::new(self.device.kernel(&[trace, source].concat(), entry, &values)?);
        kernels.insert(key, kernel.clone());
        Ok(kernel)
    }

    /// Adapter, driver and backend, and what is not done as it usually is, for
    /// people.
    pub fn describe(&self) -> String {
        let i = &self.device.info;
        let driver = [i.driver.as_str(), i.driver_info.as_str()].join(" ");
        let query = if self.device.ray_query { ", rays by ray query" } else { "" };
        let raster = if self.options.g_buffer == GBufferBy::Raster { ", G-buffer by rasterisation" } else { "" };
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
