//! A GPU that outlives its device: where that is lost, the adapter is opened anew
//! for whatever is rendered next.

use super::Gpu;
use crate::render::{Frame, Geometry, Job, Loaded, RenderError, Renderer};
use std::sync::OnceLock;

/// Devices that are opened at most, the first one included. A driver that goes on
/// losing them is not asked for ever.
const MOST: usize = 4;

/// A GPU for a run of many cases. The case during which the device is lost ends
/// with that error; the next one is rendered on a new device of the same adapter.
pub struct Persistent {
    /// In the order in which they were opened; none but the last is in use.
    devices: [OnceLock<Result<Gpu, RenderError>>; MOST],
}

struct LoadedPersistent<'a> {
    gpu: &'a Persistent,
    geometry: &'a Geometry,
    /// Where the scene was loaded.
    loaded: Option<(&'a Gpu, Box<dyn Loaded + 'a>)>,
}

impl Persistent {
    /// Begins with an open GPU, or with why there is none as it was asked for: then
    /// every case ends with that.
    pub fn new(gpu: Result<Gpu, RenderError>) -> Self {
        let devices: [OnceLock<Result<Gpu, RenderError>>; MOST] = Default::default();
        devices[0].get_or_init(|| gpu);
        Persistent { devices }
    }

    /// The device in use, opened anew where the last one was lost.
    fn current(&self) -> Result<&Gpu, RenderError> {
        if let Some(Err(e)) = self.devices[0].get() {
            return Err(RenderError::Device(e.to_string()));
        }
        let mut first = None;
        for device in &self.devices {
            match device.get() {
                Some(Ok(gpu)) if !gpu.is_lost() => return Ok(gpu),
                Some(lost) => first = first.or(lost.as_ref().ok()),
                None => {
                    let again = || first.map_or_else(|| Err(given_up()), Gpu::again);
                    let opened = device.get_or_init(again).as_ref();
                    return opened.map_err(|e| RenderError::Device(format!("it was lost, and not opened again: {e}")));
                }
            }
        }
        Err(given_up())
    }
}

fn given_up() -> RenderError {
    RenderError::Device(format!("{MOST} devices were lost in this run, and no more are opened"))
}

impl Renderer for Persistent {
    /// Loads when first rendered, so that what fails there is the case's own error.
    fn load<'a>(&'a self, geometry: &'a Geometry) -> Result<Box<dyn Loaded + 'a>, RenderError> {
        Ok(Box::new(LoadedPersistent { gpu: self, geometry, loaded: None }))
    }
}

impl Loaded for LoadedPersistent<'_> {
    fn render(&mut self, job: &Job<'_>) -> Result<Frame, RenderError> {
        // What lies on a lost device goes before the next one is filled.
        self.loaded.take_if(|(gpu, _)| gpu.is_lost());
        let (_, loaded) = match &mut self.loaded {
            Some(loaded) => loaded,
            none => {
                let gpu = self.gpu.current()?;
                none.insert((gpu, gpu.load(self.geometry)?))
            }
        };
        loaded.render(job)
    }
}
