//! The CPU reference renderer.

use super::{Frame, Geometry, Job, Loaded, RenderError, Renderer, ao::Shading, gbuffer::GBuffer, sampler::Sampler};
use aogauge_scenes::View;
use rayon::prelude::*;
use std::time::Instant;

/// Renders on rayon's threads. The result does not depend on how many there are:
/// every pixel has a sampler of its own, and pixels share nothing.
#[derive(Debug, Default)]
pub struct Cpu;

struct LoadedCpu<'a> {
    geometry: &'a Geometry,
    /// The view rendered last, with what it sees: replicates share it.
    seen: Option<(View, GBuffer)>,
}

impl Renderer for Cpu {
    fn load<'a>(&'a self, geometry: &'a Geometry) -> Result<Box<dyn Loaded + 'a>, RenderError> {
        Ok(Box::new(LoadedCpu { geometry, seen: None }))
    }
}

impl Loaded for LoadedCpu<'_> {
    fn render(&mut self, job: &Job<'_>) -> Result<Frame, RenderError> {
        let tracer = &self.geometry.tracer;
        let gbuffer = match &self.seen {
            Some((view, gbuffer)) if view == job.view => gbuffer,
            _ => &self.seen.insert((*job.view, GBuffer::new(tracer, job.view))).1,
        };
        let start = Instant::now();
        let scale = 1.0 / (2.0 * job.rays as f32);
        let (values, decisions): (Vec<f32>, Vec<_>) = gbuffer
            .surfaces
            .par_iter()
            .enumerate()
            .with_min_len(64)
            .map(|(pixel, surface)| match surface {
                None => (f32::NAN, Default::default()),
                Some(s) => {
                    let shading = Shading::new(tracer, s.point, s.normal, job.ao, job.estimator);
                    let sampler = Sampler::new(job.seed, pixel as u32, job.replicate);
                    let (halves, decisions) = shading.open_halves(job.rays, &sampler);
                    (halves as f32 * scale, decisions)
                }
            })
            .unzip();
        Ok(Frame {
            resolution: gbuffer.resolution,
            values,
            decisions: Some(decisions),
            seen: gbuffer.surfaces.iter().map(|s| s.map_or(u32::MAX, |s| s.triangle)).collect(),
            seconds: start.elapsed().as_secs_f64(),
        })
    }
}
