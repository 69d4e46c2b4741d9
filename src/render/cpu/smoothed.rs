//! Openness with smoothing on the CPU: frame after frame, then the filter.

use super::openness;
use crate::{
    render::{
        Frame, Job, Openness, RenderError,
        gbuffer::GBuffer,
        patience::Patience,
        smoothing::{Camera, Shot, Smoothing, Temporal, atrous, temporal},
    },
    trace::Tracer,
};
use std::{
    borrow::Cow,
    time::{Duration, Instant},
};

/// Renders a job whose method is smoothed; `last` is what its view sees.
pub(super) fn smoothed(
    tracer: &Tracer,
    last: &GBuffer,
    job: &Job<'_>,
    method: &Openness,
    patience: &Patience<'_>,
) -> Result<Frame, RenderError> {
    let Smoothing { temporal, denoise } = method.smoothing;
    let motion = temporal.unwrap_or_default();
    let by_rays = Openness { intensity: 1.0, ..*method };
    let mut time = Duration::ZERO;
    let mut past: Option<(Camera, Cow<'_, GBuffer>, temporal::History)> = None;
    for age in (0..method.smoothing.frames()).rev() {
        let view = motion.view(job.view, age);
        let camera = Camera::new(&view)?;
        let seen = if view == *job.view { Cow::Borrowed(last) } else { Cow::Owned(GBuffer::new(tracer, &view)) };
        let frame = Job { view: &view, seed: Temporal::seed(job.seed, age), ..*job };
        let start = Instant::now();
        let raw = openness(tracer, &seen, &frame, by_rays, patience).values;
        let before = past.as_ref().map(|(camera, gbuffer, history)| (Shot { camera: *camera, gbuffer }, history));
        let history = temporal::accumulate(motion.blend, Shot { camera, gbuffer: &seen }, &raw, before);
        time += start.elapsed();
        past = Some((camera, seen, history));
    }
    let start = Instant::now();
    let shot = Shot { camera: Camera::new(job.view)?, gbuffer: last };
    let mut values = past.map_or_else(Vec::new, |(_, _, history)| history.values);
    if let Some(denoise) = denoise {
        values = atrous::filter(&denoise, shot, &values);
    }
    for value in &mut values {
        *value = method.finished(f64::from(*value));
    }
    Ok(Frame {
        resolution: last.resolution,
        values,
        colors: None,
        decisions: None,
        seen: last.triangles(),
        seconds: (time + start.elapsed()).as_secs_f64(),
    })
}
