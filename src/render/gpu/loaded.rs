//! A scene on the GPU, and the dispatches that render it.

use super::Gpu;
use super::params::{Params, Program, Stage};
use crate::render::{Frame, Geometry, Job, Loaded, RenderError, ao::Decisions};
use aogauge_scenes::luminance;
use bytemuck::{Pod, Zeroable};
use std::time::{Duration, Instant};
use wgpu::util::DeviceExt;

/// Primary rays of one dispatch. A dispatch that runs for seconds is killed by
/// some drivers; at these sizes a software driver (2 million rays a second) and a
/// slow GPU (50 million) both stay below a third of a second.
const RAYS_SOFTWARE: u64 = 1 << 19;
const RAYS_HARDWARE: u64 = 1 << 23;

/// What the shader writes where its loops were stopped early.
const STOPPED: f32 = -1.0;

/// Threads of a workgroup, as the shader says.
const WORKGROUP: u32 = 64;

/// A device that has not finished by then counts as hung.
const PATIENCE: Duration = Duration::from_secs(120);

/// `Surface` of ao.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Surface {
    point: [f32; 3],
    triangle: u32,
    normal: [f32; 3],
    unused: u32,
}

/// Buffers that depend on the number of pixels.
struct Images {
    pixels: u64,
    stage: Stage,
    surfaces: wgpu::Buffer,
    sums: wgpu::Buffer,
    decisions: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
}

/// A scene on the GPU.
pub(super) struct LoadedGpu<'a> {
    gpu: &'a Gpu,
    geometry: &'a Geometry,
    nodes: wgpu::Buffer,
    triangles: wgpu::Buffer,
    /// Albedo and emission of each triangle, once a stage asks for them.
    materials: Option<wgpu::Buffer>,
    params: wgpu::Buffer,
    images: Option<Images>,
}

impl<'a> LoadedGpu<'a> {
    pub(super) fn new(gpu: &'a Gpu, geometry: &'a Geometry) -> Result<Self, RenderError> {
        let nodes: &[u8] = bytemuck::cast_slice(geometry.tracer.nodes());
        let corners: Vec<[f32; 9]> =
            geometry.tracer.triangles().iter().map(|[a, b, c]| [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z]).collect();
        let triangles: &[u8] = bytemuck::cast_slice(&corners);
        fits(gpu, "nodes", nodes.len() as u64)?;
        fits(gpu, "triangles", triangles.len() as u64)?;
        let upload = |label, contents| {
            gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage: wgpu::BufferUsages::STORAGE,
            })
        };
        guarded(gpu, || {
            Ok(LoadedGpu {
                gpu,
                geometry,
                nodes: upload("nodes", nodes),
                triangles: upload("triangles", triangles),
                materials: None,
                params: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("params"),
                    size: size_of::<Params>() as u64,
                    usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                }),
                images: None,
            })
        })
    }

    /// Albedo, then emission, of each triangle in leaf order.
    fn materials(&self) -> Result<wgpu::Buffer, RenderError> {
        let of = |&t: &u32| {
            let [a, e] = [self.geometry.albedo(t), self.geometry.emitted(t)];
            [a.x, a.y, a.z, e.x, e.y, e.z]
        };
        let numbers: Vec<[f32; 6]> = self.geometry.tracer.source().iter().map(of).collect();
        let contents: &[u8] = bytemuck::cast_slice(&numbers);
        fits(self.gpu, "materials", contents.len() as u64)?;
        Ok(self.gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("materials"),
            contents,
            usage: wgpu::BufferUsages::STORAGE,
        }))
    }

    fn images(&mut self, pixels: u64, stage: Stage) -> Result<Images, RenderError> {
        if stage == Stage::Indirect && self.materials.is_none() {
            self.materials = Some(self.materials()?);
        }
        let device = &self.gpu.device;
        let buffer = |label, stride: usize| -> Result<wgpu::Buffer, RenderError> {
            let size = pixels * stride as u64;
            fits(self.gpu, label, size)?;
            Ok(device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }))
        };
        let surfaces = buffer("surfaces", size_of::<Surface>())?;
        let sums = buffer("sums", size_of::<f32>() * stage.channels() as usize)?;
        let decisions = buffer("decisions", size_of::<Decisions>())?;
        // Stages that do not read materials are given something to bind.
        let materials = self.materials.as_ref().unwrap_or(&self.triangles);
        let buffers = [&self.params, &self.nodes, &self.triangles, &surfaces, &sums, &decisions, materials];
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0u32..)
            .zip(buffers)
            .map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() })
            .collect();
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.gpu.layout,
            entries: &entries,
        });
        Ok(Images { pixels, stage, surfaces, sums, decisions, bind_group })
    }

    /// Sees, then shades, in pieces that are each a submission of their own. The
    /// timer counts shading, as the CPU's clock does.
    fn dispatch(&self, job: &Job<'_>, program: &Program, images: &Images, timer: Option<&Timer>) {
        let pixels = images.pixels as u32;
        let offset = self.geometry.tracer.offset();
        let shade = match program.stage {
            Stage::Openness => &self.gpu.openness,
            Stage::Indirect => &self.gpu.indirect,
        };
        for (px, rays) in pieces(pixels, 1, 1, self.budget()) {
            self.submit(&self.gpu.see, program.params(job, offset, px, rays), images, None);
        }
        for (slot, (px, rays)) in (0..).zip(self.pieces(job, program)) {
            let params = program.params(job, offset, px, rays);
            self.submit(shade, params, images, timer.map(|t| (t, slot)));
        }
    }

    fn pieces(&self, job: &Job<'_>, program: &Program) -> Vec<Piece> {
        pieces(job.view.pixels() as u32, job.rays, program.rays_an_invocation(), self.budget())
    }

    fn budget(&self) -> u64 {
        if self.gpu.is_software() { RAYS_SOFTWARE } else { RAYS_HARDWARE }
    }

    fn submit(&self, pipeline: &wgpu::ComputePipeline, params: Params, images: &Images, timer: Option<(&Timer, u64)>) {
        self.gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&params));
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: None,
                timestamp_writes: timer.map(|(t, _)| wgpu::ComputePassTimestampWrites {
                    query_set: &t.queries,
                    beginning_of_pass_write_index: Some(0),
                    end_of_pass_write_index: Some(1),
                }),
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &images.bind_group, &[]);
            pass.dispatch_workgroups(params.pixels.div_ceil(WORKGROUP), 1, 1);
        }
        if let Some((t, slot)) = timer {
            encoder.resolve_query_set(&t.queries, 0..2, &t.resolved, 0);
            encoder.copy_buffer_to_buffer(&t.resolved, 0, &t.ticks, slot * TICKS, TICKS);
        }
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Copies a buffer back.
    fn read<T: Pod>(&self, source: &wgpu::Buffer) -> Result<Vec<T>, RenderError> {
        let device = &self.gpu.device;
        let staging = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("staging"),
            size: source.size(),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(source, 0, &staging, 0, source.size());
        self.gpu.queue.submit([encoder.finish()]);
        let (sender, receiver) = std::sync::mpsc::channel();
        staging.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // A receiver that is gone has stopped waiting.
            let _ = sender.send(result);
        });
        let device_error = |e: &dyn std::fmt::Display| RenderError::Device(e.to_string());
        device
            .poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(PATIENCE) })
            .map_err(|e| device_error(&e))?;
        self.gpu.check()?;
        match receiver.try_recv() {
            Ok(Ok(())) => {}
            Ok(Err(e)) => return Err(device_error(&e)),
            Err(_) => return Err(RenderError::Device(format!("it did not finish within {} s", PATIENCE.as_secs()))),
        }
        let mapped = staging.slice(..).get_mapped_range().map_err(|e| device_error(&e))?;
        Ok(bytemuck::pod_collect_to_vec(&mapped))
    }
}

/// Bytes of a pair of timestamps.
const TICKS: u64 = 16;

/// Timestamps of a job's dispatches.
struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    ticks: wgpu::Buffer,
}

impl Timer {
    fn new(gpu: &Gpu, dispatches: u64) -> Self {
        let buffer = |label, size, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        Timer {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: None,
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: buffer("resolved", TICKS, wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            ticks: buffer("ticks", dispatches * TICKS, wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC),
        }
    }
}

impl Loaded for LoadedGpu<'_> {
    fn render(&mut self, job: &Job<'_>) -> Result<Frame, RenderError> {
        let program = Program::new(&job.estimator)?;
        self.geometry.suits(&job.estimator, job.ao)?;
        let pixels = job.view.pixels() as u64;
        let images = match self.images.take() {
            Some(images) if images.pixels == pixels && images.stage == program.stage => images,
            _ => guarded(self.gpu, || self.images(pixels, program.stage))?,
        };
        let start = Instant::now();
        let frame = guarded(self.gpu, || {
            let dispatches = self.pieces(job, &program).len() as u64;
            let timer = self.gpu.tick.map(|_| Timer::new(self.gpu, dispatches));
            self.dispatch(job, &program, &images, timer.as_ref());
            let sums: Vec<f32> = self.read(&images.sums)?;
            let wall = start.elapsed().as_secs_f64();
            if sums.contains(&STOPPED) {
                return Err(RenderError::Device(
                    "the driver stopped a loop of the shader early: the scene is too deep for it".into(),
                ));
            }
            let surfaces: Vec<Surface> = self.read(&images.surfaces)?;
            let decisions = self.read(&images.decisions)?;
            let seconds = match (&timer, self.gpu.tick) {
                (Some(timer), Some(tick)) => {
                    let ticks: Vec<[u64; 2]> = self.read(&timer.ticks)?;
                    let spent: u64 = ticks.iter().map(|[a, b]| b.saturating_sub(*a)).sum();
                    spent as f64 * f64::from(tick) * 1e-9
                }
                _ => wall,
            };
            let source = self.geometry.tracer.source();
            let (values, colors) = finished(&program, &sums, &surfaces, job.rays);
            Ok(Frame {
                resolution: job.view.resolution,
                values,
                colors,
                decisions: (program.stage == Stage::Openness).then_some(decisions),
                seen: surfaces.iter().map(|s| source.get(s.triangle as usize).copied().unwrap_or(u32::MAX)).collect(),
                seconds,
            })
        });
        self.images = Some(images);
        frame
    }
}

/// What a stage's sums mean: a value a pixel, and its colour where it has one.
fn finished(program: &Program, sums: &[f32], surfaces: &[Surface], rays: u32) -> (Vec<f32>, Option<Vec<[f32; 3]>>) {
    let missed = |s: &Surface| s.triangle == u32::MAX;
    if program.stage == Stage::Openness {
        let mean = |sum: f32| program.method.mean(f64::from(sum), rays);
        let value = |(&sum, s): (&f32, &Surface)| if missed(s) { f32::NAN } else { mean(sum) };
        return (sums.iter().zip(surfaces).map(value).collect(), None);
    }
    let mean = |sum: f32| (f64::from(sum) / f64::from(rays)) as f32;
    let color = |(sum, s): (&[f32; 3], &Surface)| if missed(s) { [f32::NAN; 3] } else { sum.map(mean) };
    let colors: Vec<[f32; 3]> = sums.as_chunks().0.iter().zip(surfaces).map(color).collect();
    (colors.iter().map(|&c| luminance(c)).collect(), Some(colors))
}

/// A range of pixels and a range of rays.
type Piece = (std::ops::Range<u32>, std::ops::Range<u32>);

/// Splits a job so that no piece has more than `budget` rays, and no invocation
/// more than `most`.
fn pieces(pixels: u32, rays: u32, most: u32, budget: u64) -> Vec<Piece> {
    let ray_step = rays.clamp(1, most);
    // At most 65,535 workgroups a dispatch.
    let pixel_step = (budget / u64::from(ray_step)).clamp(u64::from(WORKGROUP), 65_535 * u64::from(WORKGROUP)) as u32;
    let mut pieces = Vec::new();
    for first_ray in (0..rays).step_by(ray_step as usize) {
        for first_pixel in (0..pixels).step_by(pixel_step as usize) {
            pieces.push((
                first_pixel..pixels.min(first_pixel.saturating_add(pixel_step)),
                first_ray..rays.min(first_ray.saturating_add(ray_step)),
            ));
        }
    }
    pieces
}

fn fits(gpu: &Gpu, what: &'static str, needs: u64) -> Result<(), RenderError> {
    let limits = gpu.device.limits();
    let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    if needs > limit {
        return Err(RenderError::TooLarge { what, needs, limit });
    }
    Ok(())
}

/// Runs `work` with the device's errors caught, and returns the first of them.
fn guarded<T>(gpu: &Gpu, work: impl FnOnce() -> Result<T, RenderError>) -> Result<T, RenderError> {
    let memory = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    let validation = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
    let result = work();
    let errors = [pollster::block_on(validation.pop()), pollster::block_on(memory.pop())];
    if let Some(e) = errors.into_iter().flatten().next() {
        return Err(RenderError::Device(e.to_string()));
    }
    gpu.check()?;
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_cover_every_ray_of_every_pixel_once() {
        for (pixels, rays, budget) in
            [(1u32, 1u32, 64u64), (6656, 32, 1 << 19), (6656, 512, 1 << 14), (100, 70_000, 1 << 19)]
        {
            let pieces = pieces(pixels, rays, 32, budget);
            let total: u64 = pieces.iter().map(|(p, r)| p.len() as u64 * r.len() as u64).sum();
            assert_eq!(total, u64::from(pixels) * u64::from(rays));
            for (p, r) in &pieces {
                assert!(p.len() as u64 * r.len() as u64 <= budget.max(u64::from(WORKGROUP * 32)));
                assert!(r.len() as u32 <= 32);
            }
        }
    }
}
