//! A scene on the GPU, and the dispatches that render it.

mod smoothed;

#[cfg(test)]
pub(super) use smoothed::{ATROUS, TEMPORAL};

use super::{
    Constants, GBufferBy, Gpu, SHADER,
    device::{Kernel, Timer, WORKGROUP},
    params::{Params, Program, Stage, places},
    query,
    raster::Raster,
    screen_space::OnScreen,
};
use crate::{
    render::{Estimator, Frame, Geometry, Job, Loaded, RenderError, ao::Decisions, smoothing::Smoothing},
    trace::{WIDE_STACK, Wide},
};
use aogauge_scenes::luminance;
use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use smoothed::Filters;
use std::{sync::Arc, time::Instant};

/// Rays of all kinds of one dispatch. A dispatch that runs for seconds is killed by
/// some drivers; at these sizes a software driver (4 million rays a second) and a
/// slow GPU (50 million) both stay below a third of a second.
const RAYS_SOFTWARE: u64 = 1 << 20;
const RAYS_HARDWARE: u64 = 1 << 24;

/// What the shader writes where its loops were stopped early.
pub(super) const STOPPED: f32 = -1.0;

/// `Surface` of surface.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Surface {
    pub point: [f32; 3],
    pub triangle: u32,
    pub normal: [f32; 3],
    pub unused: u32,
}

/// Buffers that depend on the number of pixels.
pub(super) struct Images {
    resolution: [u32; 2],
    /// What `shade` computes.
    program: Program,
    surfaces: wgpu::Buffer,
    sums: wgpu::Buffer,
    decisions: wgpu::Buffer,
    /// What is drawn before `see`, where the G-buffer is rasterised.
    raster: Option<Raster>,
    see: Bound,
    shade: Bound,
    /// Once a method asks for them.
    filters: Option<Filters>,
}

impl Images {
    fn pixels(&self) -> u64 {
        let [width, height] = self.resolution.map(u64::from);
        width * height
    }
}

/// A kernel with its buffers.
pub(super) struct Bound {
    pub kernel: Arc<Kernel>,
    pub group: wgpu::BindGroup,
}

/// What rays find triangles by.
enum Tree {
    /// The renderer's own.
    Nodes { nodes: wgpu::Buffer, levels: usize },
    /// The driver's.
    Query(wgpu::Tlas),
}

/// A scene on the GPU.
pub(super) struct LoadedGpu<'a> {
    pub(super) gpu: &'a Gpu,
    geometry: &'a Geometry,
    tree: Tree,
    triangles: wgpu::Buffer,
    /// How each triangle of the buffer was numbered in the scene.
    pub source: Vec<u32>,
    /// Albedo and emission of each triangle, once a stage asks for them.
    materials: Option<wgpu::Buffer>,
    params: wgpu::Buffer,
    images: Option<Images>,
    screen: Option<OnScreen>,
}

impl<'a> LoadedGpu<'a> {
    pub(super) fn new(gpu: &'a Gpu, geometry: &'a Geometry) -> Result<Self, RenderError> {
        let device = &gpu.device;
        let tracer = &geometry.tracer;
        let wide = Wide::new(tracer);
        if !device.ray_query && wide.depth > WIDE_STACK {
            return Err(RenderError::TooDeep { levels: wide.depth, limit: WIDE_STACK });
        }
        let source: Vec<u32> = wide.order.iter().map(|&i| tracer.source()[i as usize]).collect();
        let with_number = |(&leaf, &number): (&u32, &u32)| {
            let [a, b, c] = tracer.triangles()[leaf as usize];
            [a.extend(f32::from_bits(number)), b.extend(0.0), c.extend(0.0)]
        };
        let mut corners: Vec<[Vec4; 3]> = wide.order.iter().zip(&source).map(with_number).collect();
        // A binding has at least one element.
        corners.resize(corners.len().max(1), [Vec4::ZERO; 3]);
        device.guarded(|| {
            let triangles = device.upload("triangles", bytemuck::cast_slice(&corners))?;
            let tree = if device.ray_query {
                Tree::Query(query::build(device, &triangles, corners.len())?)
            } else {
                let nodes = device.upload("nodes", bytemuck::cast_slice(&wide.nodes))?;
                Tree::Nodes { nodes, levels: wide.depth }
            };
            Ok(LoadedGpu {
                gpu,
                geometry,
                tree,
                triangles,
                source,
                materials: None,
                params: device.uniform("params", &Params::zeroed())?,
                images: None,
                screen: None,
            })
        })
    }

    /// What rays are traced against, with the bindings that the shaders give it.
    pub fn tracing(&self) -> [(u32, wgpu::BindingResource<'_>); 2] {
        let tree = match &self.tree {
            Tree::Nodes { nodes, .. } => nodes.as_entire_binding(),
            Tree::Query(tlas) => tlas.as_binding(),
        };
        [(1, tree), (2, self.triangles.as_entire_binding())]
    }

    /// A kernel that traces rays in this scene. Its stack is as long as the tree
    /// needs, in steps of four levels, so that scenes share kernels: of steps
    /// of eight, an RDNA 2 GPU could run 8 workgroups in place of 12 (classic AO, atrium).
    pub fn tracing_kernel(
        &self,
        source: &'static str,
        entry: &'static str,
        mut constants: Constants,
    ) -> Result<Arc<Kernel>, RenderError> {
        if let Tree::Nodes { levels, .. } = self.tree {
            constants.push(("STACKS", levels.next_multiple_of(4) as u32 * WORKGROUP));
        }
        self.gpu.tracing_kernel(source, entry, constants)
    }

    /// What [`Self::dispatch`] tells kernels, with its binding.
    pub fn told(&self) -> (u32, wgpu::BindingResource<'_>) {
        (0, self.params.as_entire_binding())
    }

    /// Albedo, then emission, of each triangle in leaf order.
    fn materials(&self) -> Result<wgpu::Buffer, RenderError> {
        let of = |&t: &u32| {
            let [a, e] = [self.geometry.albedo(t), self.geometry.emitted(t)];
            [a.x, a.y, a.z, e.x, e.y, e.z]
        };
        let numbers: Vec<[f32; 6]> = self.source.iter().map(of).collect();
        self.gpu.device.upload("materials", bytemuck::cast_slice(&numbers))
    }

    /// The buffers of the job before where they fit, else new ones.
    pub(super) fn take_images(&mut self, job: &Job<'_>, program: &Program) -> Result<Images, RenderError> {
        let resolution = job.view.resolution;
        let kept = self.images.take().filter(|i| i.resolution == resolution && i.program.stage == program.stage);
        self.gpu.device.guarded(|| {
            let Some(mut images) = kept else { return self.images(resolution, program) };
            if images.program.constants() != program.constants() {
                images.shade = self.bound_shade(program, &images.surfaces, &images.sums, &images.decisions)?;
            }
            images.program = *program;
            Ok(images)
        })
    }

    /// Keeps buffers for the next job.
    pub(super) fn keep_images(&mut self, images: Images) {
        self.images = Some(images);
    }

    fn images(&mut self, resolution: [u32; 2], program: &Program) -> Result<Images, RenderError> {
        let stage = program.stage;
        if stage == Stage::Indirect && self.materials.is_none() {
            self.materials = Some(self.materials()?);
        }
        let device = &self.gpu.device;
        let pixels = resolution.map(u64::from).into_iter().product::<u64>();
        let buffer = |label, stride: usize| device.storage(label, pixels * stride as u64);
        let surfaces = buffer("surfaces", size_of::<Surface>())?;
        let sums = buffer("sums", size_of::<f32>() * stage.channels() as usize)?;
        let decisions = buffer("decisions", size_of::<Decisions>())?;
        let (raster, see) = match self.gpu.setup.options.g_buffer {
            GBufferBy::Rays => {
                (None, self.bound(self.tracing_kernel(SHADER, "see", vec![])?, &surfaces, &sums, Some((5, &decisions))))
            }
            GBufferBy::Raster => {
                let [_, triangles] = self.tracing();
                let seen = [(0, &self.params), (3, &surfaces), (4, &sums), (5, &decisions)];
                let mut bound: Vec<_> = seen.map(|(binding, b)| (binding, b.as_entire_binding())).into();
                bound.push(triangles.clone());
                let count = self.source.len() as u32;
                let raster = Raster::new(self.gpu, &self.params, triangles, count, resolution)?;
                let (kernel, group) = raster.resolve(self.gpu, bound)?;
                (Some(raster), Bound { kernel, group })
            }
        };
        let shade = self.bound_shade(program, &surfaces, &sums, &decisions)?;
        Ok(Images { resolution, program: *program, surfaces, sums, decisions, raster, see, shade, filters: None })
    }

    fn bound_shade(
        &self,
        program: &Program,
        surfaces: &wgpu::Buffer,
        sums: &wgpu::Buffer,
        decisions: &wgpu::Buffer,
    ) -> Result<Bound, RenderError> {
        let (entry, more) = match program.stage {
            Stage::Openness => ("openness", Some((5, decisions))),
            Stage::Indirect => ("indirect", self.materials.as_ref().map(|m| (6, m))),
        };
        let kernel = self.tracing_kernel(SHADER, entry, program.constants())?;
        Ok(self.bound(kernel, surfaces, sums, more))
    }

    fn bound(
        &self,
        kernel: Arc<Kernel>,
        surfaces: &wgpu::Buffer,
        sums: &wgpu::Buffer,
        more: Option<(u32, &wgpu::Buffer)>,
    ) -> Bound {
        let [tree, triangles] = self.tracing();
        let buffers = [(0, &self.params), (3, surfaces), (4, sums)].into_iter().chain(more);
        let bound = buffers.map(|(binding, b)| (binding, b.as_entire_binding())).chain([tree, triangles]);
        let group = self.gpu.device.bind(&kernel, &bound.collect::<Vec<_>>());
        Bound { kernel, group }
    }

    /// Finds what the view sees, in pieces that are each a submission of their own:
    /// as many as [`Self::see_count`] says.
    pub(super) fn see(
        &self,
        job: &Job<'_>,
        program: &Program,
        images: &Images,
        timer: Option<&Timer>,
    ) -> Result<(), RenderError> {
        let mut drawn = 0;
        if let Some(raster) = &images.raster {
            let (device, near) = (&self.gpu.device, self.geometry.tracer.offset());
            let params = program.params(job, near, 0..0, 0..0);
            device.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&params));
            raster.draw(device, job.view, near, timer)?;
            drawn = raster.pieces();
        }
        self.dispatch(job, program, &images.see, self.see_pieces(job), timer.map(|t| (t, drawn)));
        Ok(())
    }

    /// Shades what is seen, likewise.
    pub(super) fn shade(&self, job: &Job<'_>, program: &Program, images: &Images, timer: Option<&Timer>) {
        let pieces = self.pieces(job, program);
        self.dispatch(job, program, &images.shade, pieces, timer.map(|t| (t, 0)));
    }

    /// Runs a kernel over pieces of a job, each a submission of its own. A timer
    /// comes with the slot of the first piece.
    pub(super) fn dispatch(
        &self,
        job: &Job<'_>,
        program: &Program,
        bound: &Bound,
        pieces: Vec<Piece>,
        timer: Option<(&Timer, u64)>,
    ) {
        let device = &self.gpu.device;
        let offset = self.geometry.tracer.offset();
        for (i, (places, rays)) in (0..).zip(pieces) {
            let count = places.len() as u32;
            let params = program.params(job, offset, places, rays);
            device.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&params));
            device.run_timed(&bound.kernel, &bound.group, count, timer.map(|(t, first)| (t, first + i)));
        }
    }

    /// The triangle that each pixel sees, as the scene numbers it.
    fn seen(&self, surfaces: &[Surface]) -> Vec<u32> {
        surfaces.iter().map(|s| self.source.get(s.triangle as usize).copied().unwrap_or(u32::MAX)).collect()
    }

    /// Submissions of [`Self::see`].
    pub(super) fn see_count(&self, job: &Job<'_>, images: &Images) -> u64 {
        images.raster.as_ref().map_or(0, Raster::pieces) + self.see_pieces(job).len() as u64
    }

    fn see_pieces(&self, job: &Job<'_>) -> Vec<Piece> {
        pieces(places(job.view.resolution), 1, 1, self.budget())
    }

    pub(super) fn pieces(&self, job: &Job<'_>, program: &Program) -> Vec<Piece> {
        let budget = self.budget() / u64::from(program.rays_a_primary());
        pieces(places(job.view.resolution), job.rays, program.rays_an_invocation(), budget)
    }

    pub fn budget(&self) -> u64 {
        if self.gpu.is_software() { RAYS_SOFTWARE } else { RAYS_HARDWARE }
    }
}

impl Loaded for LoadedGpu<'_> {
    fn render(&mut self, job: &Job<'_>) -> Result<Frame, RenderError> {
        self.geometry.suits(&job.estimator, job.ao)?;
        if let Estimator::ScreenSpace(method) = &job.estimator {
            let budget = self.budget();
            return OnScreen::again(&mut self.screen, self.gpu, &self.geometry.tracer, job)?
                .render(job, method, budget);
        }
        let program = Program::new(&job.estimator)?;
        let mut images = self.take_images(job, &program)?;
        let start = Instant::now();
        let frame = self.gpu.device.guarded(|| {
            if program.method.smoothing != Smoothing::NONE {
                let filters = match images.filters.take() {
                    Some(filters) => filters,
                    None => self.filters(&images)?,
                };
                let frame = self.smoothed(job, &program, &images, &filters);
                images.filters = Some(filters);
                return frame;
            }
            let dispatches = self.pieces(job, &program).len() as u64;
            let timer = Timer::new(&self.gpu.device, dispatches);
            self.see(job, &program, &images, None)?;
            self.shade(job, &program, &images, timer.as_ref());
            let sums: Vec<f32> = self.gpu.device.read(&images.sums)?;
            let wall = start.elapsed().as_secs_f64();
            if sums.contains(&STOPPED) {
                return Err(stopped());
            }
            let surfaces: Vec<Surface> = self.gpu.device.read(&images.surfaces)?;
            let decisions = self.gpu.device.read(&images.decisions)?;
            let seconds = Timer::total(timer.as_ref(), &self.gpu.device, wall)?;
            let (values, colors) = finished(&program, &sums, &surfaces, job.rays);
            Ok(Frame {
                resolution: job.view.resolution,
                values,
                colors,
                decisions: (program.stage == Stage::Openness).then_some(decisions),
                seen: self.seen(&surfaces),
                seconds,
            })
        });
        self.keep_images(images);
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

/// What [`STOPPED`] means.
pub(super) fn stopped() -> RenderError {
    RenderError::Device("the driver stopped a loop of the shader early: the scene is too deep for it".into())
}

/// A range of places in tile order and a range of rays.
pub(super) type Piece = (std::ops::Range<u32>, std::ops::Range<u32>);

/// Splits a job so that no piece has more than `budget` rays, and no invocation
/// more than `most`.
pub(super) fn pieces(places: u32, rays: u32, most: u32, budget: u64) -> Vec<Piece> {
    let ray_step = rays.clamp(1, most);
    // Whole workgroups, at most 65,535 a dispatch.
    let groups = (budget / u64::from(ray_step * WORKGROUP)).clamp(1, 65_535) as u32;
    let place_step = groups * WORKGROUP;
    let mut pieces = Vec::new();
    for first_ray in (0..rays).step_by(ray_step as usize) {
        for first_place in (0..places).step_by(place_step as usize) {
            pieces.push((
                first_place..places.min(first_place.saturating_add(place_step)),
                first_ray..rays.min(first_ray.saturating_add(ray_step)),
            ));
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_cover_every_ray_of_every_pixel_once() {
        for (places, rays, budget) in
            [(1u32, 1u32, 64u64), (6656, 32, 1 << 19), (6656, 512, 1 << 14), (100, 70_000, 1 << 19)]
        {
            let pieces = pieces(places, rays, 32, budget);
            let total: u64 = pieces.iter().map(|(p, r)| p.len() as u64 * r.len() as u64).sum();
            assert_eq!(total, u64::from(places) * u64::from(rays));
            for (p, r) in &pieces {
                assert!(p.len() as u64 * r.len() as u64 <= budget.max(u64::from(WORKGROUP * 32)));
                assert!(r.len() as u32 <= 32);
            }
        }
    }
}
