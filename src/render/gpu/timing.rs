//! How long stages take, side by side in one run.

use super::{Gpu, device::Timer, loaded::LoadedGpu, params::Program};
use crate::render::{Estimator, Geometry, Job, Loaded, RenderError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// What times are taken by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Clock {
    /// The device's own timestamps, at the beginning and end of each dispatch.
    TimestampQueries,
    /// The CPU's clock, from submission until all is done: the adapter has no
    /// timestamps.
    WallClock,
}

/// How often each job runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rounds {
    /// Runs that are not counted, so that memory, caches and clocks are warm.
    pub warm_up: u32,
    /// Runs that are.
    pub counted: u32,
}

/// One job's times and rays.
#[derive(Clone, Debug, PartialEq)]
pub struct Timed {
    /// Seconds that finding the seen surfaces took, a value a round.
    pub see: Vec<f64>,
    /// Seconds that shading took, a value a round.
    pub shade: Vec<f64>,
    /// Pixels that see a surface.
    pub pixels: u64,
    /// Primary rays of one round.
    pub primary: u64,
    /// Secondary rays of one round: those of each open primary ray.
    pub secondary: u64,
}

impl Gpu {
    /// What [`Gpu::time`] takes times by.
    pub fn clock(&self) -> Clock {
        if self.device.has_timestamps() { Clock::TimestampQueries } else { Clock::WallClock }
    }

    /// Times jobs of one scene. Each round runs all of them in turn, so that
    /// what else the machine does falls on all alike. `tell` is called after
    /// each round. At most 32 rays a job, and a falloff that is the step: more is
    /// not counted.
    ///
    /// # Errors
    /// [`RenderError`] where the device fails or does not know an estimator.
    pub fn time(
        &self,
        geometry: &Geometry,
        jobs: &[Job<'_>],
        rounds: Rounds,
        mut tell: impl FnMut(u32),
    ) -> Result<Vec<Timed>, RenderError> {
        let mut loaded = LoadedGpu::new(self, geometry)?;
        let mut timed = jobs.iter().map(|job| counted(&mut loaded, job)).collect::<Result<Vec<_>, _>>()?;
        for round in 0..rounds.warm_up + rounds.counted {
            for (job, timed) in jobs.iter().zip(&mut timed) {
                let [see, shade] = loaded.seconds(job)?;
                if round >= rounds.warm_up {
                    timed.see.push(see);
                    timed.shade.push(shade);
                }
            }
            tell(round + 1);
        }
        Ok(timed)
    }
}

/// Renders a job once and counts its rays.
fn counted(loaded: &mut LoadedGpu<'_>, job: &Job<'_>) -> Result<Timed, RenderError> {
    let frame = loaded.render(job)?;
    let pixels = frame.values.iter().filter(|v| !v.is_nan()).count() as u64;
    let primary = pixels * u64::from(job.rays);
    let closed: u64 = frame.decisions.iter().flatten().map(|d| u64::from(d.primary.count_ones())).sum();
    let each = match job.estimator {
        Estimator::Openness(o) => o.extension.map_or(0, |e| e.secondary_rays),
        _ => 0,
    };
    let secondary = (primary - closed) * u64::from(each);
    Ok(Timed { see: vec![], shade: vec![], pixels, primary, secondary })
}

impl LoadedGpu<'_> {
    /// Runs a job without reading it back: seconds to see, and to shade.
    fn seconds(&mut self, job: &Job<'_>) -> Result<[f64; 2], RenderError> {
        let program = Program::new(&job.estimator)?;
        let images = self.take_images(job, &program)?;
        let seconds = self.gpu.device.guarded(|| {
            let see = self.clocked(self.see_count(job, &images), |timer| self.see(job, &program, &images, timer))?;
            let shade = self.clocked(self.pieces(job, &program).len() as u64, |timer| {
                self.shade(job, &program, &images, timer);
                Ok(())
            })?;
            Ok([see, shade])
        });
        self.keep_images(images);
        seconds
    }

    fn clocked(
        &self,
        submissions: u64,
        work: impl Fn(Option<&Timer>) -> Result<(), RenderError>,
    ) -> Result<f64, RenderError> {
        let device = &self.gpu.device;
        let timer = Timer::new(device, submissions);
        device.wait()?;
        let start = Instant::now();
        work(timer.as_ref())?;
        device.wait()?;
        let wall = start.elapsed().as_secs_f64();
        Timer::total(timer.as_ref(), device, wall)
    }
}
