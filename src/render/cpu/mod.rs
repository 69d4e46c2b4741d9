//! The CPU reference renderer.

mod smoothed;

use super::{
    Estimator, Frame, Geometry, Job, Loaded, Openness, RenderError, Renderer,
    ao::{Decisions, Shading},
    gbuffer::{GBuffer, Surface},
    indirect, path,
    patience::Patience,
    sampler::Sampler,
    screen_space::Screen,
    smoothing::Smoothing,
};
use crate::trace::Tracer;
use aogauge_scenes::{View, luminance};
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
    /// The same for screen space.
    screen: Option<Screen>,
}

impl Renderer for Cpu {
    fn load<'a>(&'a self, geometry: &'a Geometry) -> Result<Box<dyn Loaded + 'a>, RenderError> {
        Ok(Box::new(LoadedCpu { geometry, seen: None, screen: None }))
    }
}

impl Loaded for LoadedCpu<'_> {
    fn render(&mut self, job: &Job<'_>) -> Result<Frame, RenderError> {
        self.frame(job, &Patience::new(&|| true))
    }

    fn render_while(&mut self, job: &Job<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<Option<Frame>, RenderError> {
        let patience = Patience::new(go_on);
        let frame = self.frame(job, &patience)?;
        Ok((!patience.is_over()).then_some(frame))
    }
}

impl LoadedCpu<'_> {
    /// The image; whatever it holds where patience is over.
    fn frame(&mut self, job: &Job<'_>, patience: &Patience<'_>) -> Result<Frame, RenderError> {
        self.geometry.suits(&job.estimator, job.ao)?;
        let tracer = &self.geometry.tracer;
        let gbuffer = match &self.seen {
            Some((view, gbuffer)) if view == job.view => gbuffer,
            _ => &self.seen.insert((*job.view, GBuffer::new(tracer, job.view))).1,
        };
        if let Estimator::Openness(method) = &job.estimator
            && method.smoothing != Smoothing::NONE
        {
            return smoothed::smoothed(tracer, gbuffer, job, method, patience);
        }
        let screen = match &job.estimator {
            Estimator::ScreenSpace(_) => Some(Screen::again(&mut self.screen, tracer, gbuffer, job)?),
            _ => None,
        };
        let start = Instant::now();
        let image = match &job.estimator {
            Estimator::Openness(method) => openness(tracer, gbuffer, job, *method, patience),
            Estimator::LocalIndirect(method) => {
                Image::colored(shade(gbuffer, patience, [f32::NAN; 3], |pixel, surface| {
                    let sampler = Sampler::new(job.seed, pixel, job.replicate);
                    indirect::incident(self.geometry, surface, job.ao, method, job.rays, &sampler)
                }))
            }
            Estimator::ScreenSpace(method) => Image::plain(screen.map_or_else(Vec::new, |s| s.openness(job, method))),
            Estimator::PathTraced => {
                Image::colored(path::traced(self.geometry, gbuffer, [job.rays, job.seed, job.replicate], patience))
            }
        };
        Ok(Frame {
            resolution: gbuffer.resolution,
            values: image.values,
            colors: image.colors,
            decisions: image.decisions,
            seen: gbuffer.triangles(),
            seconds: start.elapsed().as_secs_f64(),
        })
    }
}

/// What an estimator gives.
struct Image {
    values: Vec<f32>,
    colors: Option<Vec<[f32; 3]>>,
    decisions: Option<Vec<Decisions>>,
}

impl Image {
    fn plain(values: Vec<f32>) -> Self {
        Image { values, colors: None, decisions: None }
    }

    fn colored(colors: Vec<[f32; 3]>) -> Self {
        Image { values: colors.iter().map(|&c| luminance(c)).collect(), colors: Some(colors), decisions: None }
    }
}

fn openness(tracer: &Tracer, gbuffer: &GBuffer, job: &Job<'_>, method: Openness, patience: &Patience<'_>) -> Image {
    let (values, decisions) = shade(gbuffer, patience, (f32::NAN, Decisions::default()), |pixel, surface| {
        let shading = Shading::new(tracer, surface.point, surface.normal, job.ao, method);
        shading.openness(job.rays, &Sampler::new(job.seed, pixel, job.replicate))
    })
    .into_iter()
    .unzip();
    Image { values, colors: None, decisions: Some(decisions) }
}

/// A value for each pixel that sees a surface, `none` for the others and where patience
/// is over.
fn shade<T: Copy + Send + Sync>(
    gbuffer: &GBuffer,
    patience: &Patience<'_>,
    none: T,
    value: impl Fn(u32, &Surface) -> T + Sync,
) -> Vec<T> {
    let surfaces = gbuffer.surfaces.par_iter().enumerate().with_min_len(64);
    let one = |(pixel, surface): (usize, &Option<Surface>)| {
        let skipped = patience.skips(pixel);
        surface.as_ref().filter(|_| !skipped).map_or(none, |s| value(pixel as u32, s))
    };
    surfaces.map(one).collect()
}
