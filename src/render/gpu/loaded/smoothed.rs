//! Openness with smoothing on the GPU: images stay on the device from the first
//! frame to the last pass of the filter.

use super::{Bound, Images, LoadedGpu, Surface, pieces};
use crate::render::{
    Frame, Job, RenderError,
    gpu::{device::Timer, params::Program},
    smoothing::{Camera, Denoise, Temporal},
};
use bytemuck::{Pod, Zeroable};
use std::time::Instant;

/// Accumulation over frames.
pub(in crate::render::gpu) const TEMPORAL: &str = concat!(
    include_str!("../shaders/surface.wgsl"),
    include_str!("../shaders/smoothing.wgsl"),
    include_str!("../shaders/temporal.wgsl")
);

/// The spatial filter.
pub(in crate::render::gpu) const ATROUS: &str = concat!(
    include_str!("../shaders/surface.wgsl"),
    include_str!("../shaders/smoothing.wgsl"),
    include_str!("../shaders/atrous.wgsl")
);

/// `Camera` of smoothing.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Lens {
    /// Columns.
    to_image: [[f32; 4]; 3],
    origin: [f32; 3],
    perspective: u32,
    pixel: f32,
    unused: [u32; 3],
}

impl From<Camera> for Lens {
    fn from(camera: Camera) -> Self {
        let columns = camera.to_image.to_image.to_cols_array_2d();
        Lens {
            to_image: columns.map(|[x, y, z]| [x, y, z, 0.0]),
            origin: camera.to_image.origin.to_array(),
            perspective: camera.to_image.perspective.into(),
            pixel: camera.pixel,
            unused: [0; 3],
        }
    }
}

/// `Params` of smoothing.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Params {
    now: Lens,
    past: Lens,
    resolution: [u32; 2],
    first_pixel: u32,
    pixels: u32,
    has_past: u32,
    blend: f32,
    units: f32,
    step: u32,
    normal: f32,
    plane: f32,
    openness: f32,
    unused: u32,
}

/// Buffers that smoothing adds to those of openness.
pub(super) struct Filters {
    params: wgpu::Buffer,
    past_surfaces: wgpu::Buffer,
    past_values: wgpu::Buffer,
    past_lengths: wgpu::Buffer,
    lengths: wgpu::Buffer,
    /// Where accumulation ends, and what each pass of the filter reads or writes.
    values: [wgpu::Buffer; 2],
    temporal: Bound,
    /// From the first of the values to the second, and back.
    atrous: [Bound; 2],
}

/// Counts the dispatches that a timer notes.
struct Clock<'a> {
    timer: Option<&'a Timer>,
    slot: u64,
}

impl<'a> Clock<'a> {
    fn tick(&mut self) -> Option<(&'a Timer, u64)> {
        let slot = self.slot;
        self.slot += 1;
        self.timer.map(|t| (t, slot))
    }
}

impl LoadedGpu<'_> {
    pub(super) fn filters(&self, images: &Images) -> Result<Filters, RenderError> {
        let device = &self.gpu.device;
        let numbers = |label| device.storage(label, images.pixels() * size_of::<f32>() as u64);
        let params = device.uniform("smoothing", &Params::zeroed())?;
        let past_surfaces = device.storage("past surfaces", images.surfaces.size())?;
        let [past_values, past_lengths, lengths] =
            [numbers("past values")?, numbers("past lengths")?, numbers("lengths")?];
        let values = [numbers("values")?, numbers("filtered values")?];
        let bound = |source, entry, more: &[(u32, &wgpu::Buffer)]| {
            let kernel = self.gpu.kernel(source, entry)?;
            let buffers = [(0, &params), (1, &images.surfaces)].into_iter().chain(more.iter().copied());
            let all: Vec<_> = buffers.map(|(binding, b)| (binding, b.as_entire_binding())).collect();
            let group = device.bind(&kernel, &all);
            Ok::<_, RenderError>(Bound { kernel, group })
        };
        let history = [(3, &past_surfaces), (4, &past_values), (5, &past_lengths)];
        let accumulated = [(2, &images.sums), (6, &values[0]), (7, &lengths)];
        let temporal = bound(TEMPORAL, "temporal", &[history, accumulated].concat())?;
        let pass = |from: usize| bound(ATROUS, "atrous", &[(2, &values[from]), (3, &values[1 - from])]);
        let atrous = [pass(0)?, pass(1)?];
        Ok(Filters { params, past_surfaces, past_values, past_lengths, lengths, values, temporal, atrous })
    }

    /// Renders a job whose method is smoothed.
    pub(super) fn smoothed(
        &self,
        job: &Job<'_>,
        program: &Program,
        images: &Images,
        filters: &Filters,
    ) -> Result<Frame, RenderError> {
        let device = &self.gpu.device;
        let start = Instant::now();
        let smoothing = program.method.smoothing;
        let over_pixels = pieces(images.pixels() as u32, 1, 1, self.budget()).len() as u64;
        let a_frame = self.pieces(job, program).len() as u64 + over_pixels;
        let passes = u64::from(smoothing.denoise.map_or(0, |d| d.passes)) * over_pixels;
        let timer = Timer::new(device, u64::from(smoothing.frames()) * a_frame + passes);
        let mut clock = Clock { timer: timer.as_ref(), slot: 0 };
        self.accumulate(job, program, images, filters, &mut clock)?;
        let result = match smoothing.denoise {
            Some(denoise) => self.filter(job, &denoise, images, filters, &mut clock)?,
            None => 0,
        };
        let values: Vec<f32> = device.read(&filters.values[result])?;
        let wall = start.elapsed().as_secs_f64();
        if values.iter().any(|v| *v < 0.0) {
            return Err(super::stopped());
        }
        let surfaces: Vec<Surface> = device.read(&images.surfaces)?;
        let seconds = Timer::total(timer.as_ref(), device, wall)?;
        let finished = |(&value, s): (&f32, &Surface)| {
            if s.triangle == u32::MAX { f32::NAN } else { program.method.finished(f64::from(value)) }
        };
        Ok(Frame {
            resolution: job.view.resolution,
            values: values.iter().zip(&surfaces).map(finished).collect(),
            colors: None,
            decisions: None,
            seen: self.seen(&surfaces),
            seconds,
        })
    }

    /// Renders frame after frame and accumulates them in the first of the values.
    fn accumulate(
        &self,
        job: &Job<'_>,
        program: &Program,
        images: &Images,
        filters: &Filters,
        clock: &mut Clock<'_>,
    ) -> Result<(), RenderError> {
        let smoothing = program.method.smoothing;
        let motion = smoothing.temporal.unwrap_or_default();
        let units = f64::from(job.rays) * f64::from(program.method.units());
        let mut past = None;
        for age in (0..smoothing.frames()).rev() {
            let view = motion.view(job.view, age);
            let now = Camera::new(&view)?.into();
            let frame = Job { view: &view, seed: Temporal::seed(job.seed, age), ..*job };
            self.see(&frame, program, images, None)?;
            let shading = self.pieces(&frame, program);
            let after = clock.slot + shading.len() as u64;
            self.dispatch(&frame, program, &images.shade, shading, clock.timer.map(|t| (t, clock.slot)));
            clock.slot = after;
            let params = Params {
                now,
                past: past.unwrap_or(now),
                resolution: job.view.resolution,
                has_past: past.is_some().into(),
                blend: motion.blend,
                units: units as f32,
                ..Params::zeroed()
            };
            self.over_pixels(&filters.temporal, &params, images, filters, clock);
            if age > 0 {
                self.gpu.device.copy(&[
                    (&images.surfaces, &filters.past_surfaces),
                    (&filters.values[0], &filters.past_values),
                    (&filters.lengths, &filters.past_lengths),
                ]);
            }
            past = Some(now);
        }
        Ok(())
    }

    /// Filters the first of the values; returns which of them holds the result.
    fn filter(
        &self,
        job: &Job<'_>,
        denoise: &Denoise,
        images: &Images,
        filters: &Filters,
        clock: &mut Clock<'_>,
    ) -> Result<usize, RenderError> {
        let now = Camera::new(job.view)?.into();
        for pass in 0..denoise.passes {
            let params = Params {
                now,
                resolution: job.view.resolution,
                step: 1 << pass,
                normal: denoise.normal,
                plane: denoise.plane,
                openness: denoise.openness_at(pass),
                ..Params::zeroed()
            };
            self.over_pixels(&filters.atrous[pass as usize % 2], &params, images, filters, clock);
        }
        Ok(denoise.passes as usize % 2)
    }

    fn over_pixels(&self, bound: &Bound, params: &Params, images: &Images, filters: &Filters, clock: &mut Clock<'_>) {
        let device = &self.gpu.device;
        for (pixels, _) in pieces(images.pixels() as u32, 1, 1, self.budget()) {
            let params = Params { first_pixel: pixels.start, pixels: pixels.len() as u32, ..*params };
            device.queue.write_buffer(&filters.params, 0, bytemuck::bytes_of(&params));
            device.run_timed(&bound.kernel, &bound.group, pixels.len() as u32, clock.tick());
        }
    }
}
