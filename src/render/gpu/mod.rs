//! The GPU renderer: compute shaders through wgpu, on hardware or on a software
//! driver. Each WGSL stage stands beside its CPU twin under the same name.

mod device;
mod loaded;
mod params;
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

/// The shader of what a view sees, openness and indirect light.
const SHADER: &str = concat!(
    include_str!("shaders/sampler.wgsl"),
    include_str!("shaders/trace.wgsl"),
    include_str!("shaders/survey.wgsl"),
    include_str!("shaders/surface.wgsl"),
    include_str!("shaders/ao.wgsl"),
    include_str!("shaders/indirect.wgsl")
);

/// Values of a shader's `override` constants by name. What a whole dispatch shares
/// is a constant of its kernel: the driver then drops what an estimator does not
/// use, and the registers it would take.
type Constants = Vec<(&'static str, u32)>;

/// Source, entry point and constants.
type KernelKey = (&'static str, &'static str, Constants);

/// A device with its kernels.
pub struct Gpu {
    device: Device,
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
    /// Opens the best adapter there is: hardware before software. Backends can be
    /// narrowed by `WGPU_BACKEND`.
    ///
    /// # Errors
    /// [`RenderError::NoAdapter`] where there is none, [`RenderError::Device`]
    /// where it cannot be opened.
    pub fn open() -> Result<Self, RenderError> {
        Self::open_with(Checks::default())
    }

    /// The same, with shaders that check what they do at run time, or do not.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open_with(checks: Checks) -> Result<Self, RenderError> {
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
        Self::on(&adapter, checks)
    }

    fn on(adapter: &wgpu::Adapter, checks: Checks) -> Result<Self, RenderError> {
        Ok(Gpu { device: Device::open(adapter, checks)?, kernels: Mutex::default() })
    }

    /// An entry point of a shader without constants.
    fn kernel(&self, source: &'static str, entry: &'static str) -> Result<Arc<Kernel>, RenderError> {
        self.specialized(source, entry, Constants::new())
    }

    /// An entry point of a shader, compiled when it is first used with these
    /// values of its `override` constants.
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
        let kernel = Arc::new(self.device.kernel(source, entry, &values)?);
        kernels.insert(key, kernel.clone());
        Ok(kernel)
    }

    /// Adapter, driver and backend, for people.
    pub fn describe(&self) -> String {
        let i = &self.device.info;
        let driver = [i.driver.as_str(), i.driver_info.as_str()].join(" ");
        format!("{}, {} ({})", i.name, driver.trim(), i.backend)
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
