//! `hbao` and `gtao` on the GPU. Depth and normals are those that the CPU sees:
//! no ray is traced here.

use super::{
    Gpu, SCREEN_SPACE,
    device::{Kernel, Timer},
    loaded::{Piece, Surface, pieces},
};
use crate::{
    render::{
        Falloff, Frame, Job, RenderError, ScreenSpace,
        gbuffer::GBuffer,
        screen_space::{Integral, SECTORS, Screen, UNSEEN, bias},
    },
    trace::Tracer,
};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::{sync::Arc, time::Instant};

/// Depth samples that one invocation takes at most: Mesa's software driver stops
/// every loop of an invocation after 65,535 iterations in all.
const SAMPLES_AN_INVOCATION: u32 = 8192;

/// What the shader writes where its loops were stopped early.
const STOPPED: f32 = -1e30;

/// `Params` of screen_space.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Params {
    /// Columns of the map from the world into the image.
    to_image: [[f32; 4]; 3],
    eye: [f32; 3],
    perspective: u32,
    backwards: [f32; 3],
    radius: f32,
    resolution: [u32; 2],
    first_pixel: u32,
    pixels: u32,
    first_slice: u32,
    slices: u32,
    seed: u32,
    replicate: u32,
    steps: u32,
    sample_power: u32,
    falloff: u32,
    tail: f32,
    bias: [f32; 2],
    /// 0 for endless.
    thickness: f32,
    unused: u32,
}

/// A view with its camera on the device.
pub(super) struct OnScreen {
    screen: Screen,
    /// Of the view.
    resolution: [u32; 2],
    seen: Vec<u32>,
    surfaces: wgpu::Buffer,
    gathered: wgpu::Buffer,
    sums: wgpu::Buffer,
    params: wgpu::Buffer,
}

/// A screen and a device to render it with.
pub(super) struct Rendering<'a> {
    gpu: &'a Gpu,
    on: &'a OnScreen,
}

impl OnScreen {
    /// That of a job, `last` where it fits.
    pub fn again<'a>(
        last: &'a mut Option<OnScreen>,
        gpu: &'a Gpu,
        tracer: &Tracer,
        job: &Job<'_>,
    ) -> Result<Rendering<'a>, RenderError> {
        let on = match last.take() {
            Some(on) if on.screen.suits(job) => on,
            _ => gpu.device.guarded(|| Self::new(gpu, tracer, job))?,
        };
        Ok(Rendering { gpu, on: last.insert(on) })
    }

    fn new(gpu: &Gpu, tracer: &Tracer, job: &Job<'_>) -> Result<Self, RenderError> {
        let points = GBuffer::new(tracer, job.view);
        let screen = Screen::new(tracer, &points, job.view, job.camera)?;
        let none = Surface { triangle: UNSEEN, ..Surface::zeroed() };
        let surfaces: Vec<Surface> = screen
            .gbuffer
            .surfaces
            .iter()
            .map(|s| {
                s.map_or(none, |s| Surface {
                    point: s.point.to_array(),
                    triangle: s.triangle,
                    normal: s.normal.to_array(),
                    unused: 0,
                })
            })
            .collect();
        let device = &gpu.device;
        Ok(OnScreen {
            surfaces: device.upload("surfaces", bytemuck::cast_slice(&surfaces))?,
            gathered: device.upload("gathered", bytemuck::cast_slice(&screen.gathered))?,
            sums: device.storage("sums", screen.gathered.len() as u64 * size_of::<f32>() as u64)?,
            params: device.uniform("params", &Params::zeroed())?,
            resolution: job.view.resolution,
            seen: points.triangles(),
            screen,
        })
    }
}

impl Rendering<'_> {
    /// Renders one replicate, no more than `budget` depth samples a dispatch.
    pub fn render(&self, job: &Job<'_>, method: &ScreenSpace, budget: u64) -> Result<Frame, RenderError> {
        let (device, on) = (&self.gpu.device, self.on);
        let sectors = if matches!(method.integral, Integral::Gtao { thickness: Some(_) }) { SECTORS } else { 0 };
        let samples = method.steps * method.sides() + sectors;
        let slices = (SAMPLES_AN_INVOCATION / samples).max(1);
        let pieces = pieces(on.screen.gathered.len() as u32, job.rays, slices, budget / u64::from(samples));
        let entry = if matches!(method.integral, Integral::Gtao { .. }) { "gtao" } else { "hbao" };
        let kernel = self.gpu.kernel(SCREEN_SPACE, entry)?;
        let start = Instant::now();
        device.guarded(|| {
            let timer = Timer::new(device, pieces.len() as u64);
            self.dispatch(job, method, &kernel, &pieces, timer.as_ref());
            let sums: Vec<f32> = device.read(&on.sums)?;
            let wall = start.elapsed().as_secs_f64();
            let shown = |i: usize| on.screen.gathered[i] != UNSEEN;
            if (0..sums.len()).any(|i| shown(i) && sums[i] == STOPPED) {
                return Err(RenderError::Device("the driver stopped a loop of the shader early".into()));
            }
            let value = |(i, &sum): (usize, &f32)| {
                if shown(i) { method.mean(f64::from(sum), job.rays) } else { f32::NAN }
            };
            Ok(Frame {
                resolution: on.resolution,
                values: sums.iter().enumerate().map(value).collect(),
                colors: None,
                decisions: None,
                seen: on.seen.clone(),
                seconds: Timer::total(timer.as_ref(), device, wall)?,
            })
        })
    }

    fn dispatch(
        &self,
        job: &Job<'_>,
        method: &ScreenSpace,
        kernel: &Arc<Kernel>,
        pieces: &[Piece],
        timer: Option<&Timer>,
    ) {
        let (device, on) = (&self.gpu.device, self.on);
        let buffers = [&on.params, &on.surfaces, &on.gathered, &on.sums].map(wgpu::Buffer::as_entire_binding);
        let group = device.bind(kernel, &(0..).zip(buffers).collect::<Vec<_>>());
        for (slot, piece) in (0..).zip(pieces) {
            let params = params(&on.screen, job, method, piece);
            device.queue.write_buffer(&on.params, 0, bytemuck::bytes_of(&params));
            device.run_timed(kernel, &group, params.pixels, timer.map(|t| (t, slot)));
        }
    }
}

/// What a dispatch is told.
fn params(screen: &Screen, job: &Job<'_>, method: &ScreenSpace, (pixels, slices): &Piece) -> Params {
    let (falloff, tail) = match method.falloff {
        Falloff::Quadratic => (1, 0.0),
        Falloff::LinearTail { tail } => (2, tail),
        _ => (0, 0.0),
    };
    let (lifted, thickness) = match method.integral {
        Integral::Hbao { tangent_bias } => (bias(tangent_bias), 0.0),
        Integral::Gtao { thickness } => ([1.0, 0.0], thickness.unwrap_or(0.0)),
    };
    let column = |v: Vec3| v.extend(0.0).to_array();
    let m = screen.to_image.to_image;
    Params {
        to_image: [column(m.x_axis), column(m.y_axis), column(m.z_axis)],
        eye: screen.camera.origin.to_array(),
        perspective: u32::from(screen.to_image.perspective),
        backwards: (-screen.camera.direction).to_array(),
        radius: method.radius(job.ao),
        resolution: screen.gbuffer.resolution,
        first_pixel: pixels.start,
        pixels: pixels.len() as u32,
        first_slice: slices.start,
        slices: slices.len() as u32,
        seed: job.seed,
        replicate: job.replicate,
        steps: method.steps,
        sample_power: method.sample_power,
        falloff,
        tail,
        bias: lifted,
        thickness,
        unused: 0,
    }
}
