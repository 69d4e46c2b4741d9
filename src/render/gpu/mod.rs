//! The GPU renderer: compute shaders through wgpu, on hardware or on a software
//! driver. Each WGSL stage stands beside its CPU twin under the same name.

mod adapter;
mod composite;
mod device;
mod drivers;
mod loaded;
mod params;
mod persistent;
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

/// The shader of what a view sees, openness and indirect light.
const SHADER: &str = concat!(
    include_str!("shaders/sampler.wgsl"),
    include_str!("shaders/trace.wgsl"),
    include_str!("shaders/survey.wgsl"),
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
    /// How it was opened.
    setup: Setup,
}

impl Gpu {
    /// Opens the best adapter there is: hardware before software. `WGPU_BACKEND`
    /// and `WGPU_ADAPTER_NAME` narrow the choice.
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
        Self::with(Setup { checks, ..Setup::default() })
    }

    fn with(setup: Setup) -> Result<Self, RenderError> {
        let adapter = adapter::best(setup.flags)?;
        Ok(Gpu { device: Device::open(&adapter, &setup)?, kernels: Mutex::default(), setup })
    }

    /// The same adapter, opened anew.
    fn again(&self) -> Result<Self, RenderError> {
        let gpu = Self::with(self.setup.clone())?;
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
