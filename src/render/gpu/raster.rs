//! The G-buffer by rasterisation, as hybrid renderers have it: a visibility buffer
//! (Burns and Hunt, "The Visibility Buffer", JCGT 2(2), 2013) that says which
//! triangle each pixel sees, and a kernel that turns it into points to shade. The
//! shader: `shaders/raster.wgsl`.

use super::{
    Gpu,
    device::{Device, Kernel, Timer},
};
use crate::render::RenderError;
use aogauge_scenes::View;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// The shader, with what it shares with seeing by rays.
pub(super) const SHADER: &str = concat!(
    include_str!("shaders/sampler.wgsl"),
    include_str!("shaders/surface.wgsl"),
    include_str!("shaders/ao.wgsl"),
    include_str!("shaders/raster.wgsl")
);

/// Triangles of one submission, so that none runs for seconds.
const TRIANGLES: u32 = 1 << 20;

const VISIBLE: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// `Projection` of raster.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Projection {
    x: [f32; 3],
    perspective: u32,
    y: [f32; 3],
    width: f32,
    depth: [f32; 3],
    height: f32,
    origin: [f32; 3],
    near: f32,
}

/// The images that one scene is drawn into, at one resolution.
pub(super) struct Raster {
    pipeline: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
    projection: wgpu::Buffer,
    visible: wgpu::TextureView,
    depth: wgpu::TextureView,
    triangles: u32,
}

/// Whether an adapter can draw triangles from a storage buffer.
///
/// # Errors
/// [`RenderError::Raster`] where it cannot.
pub(super) fn check(adapter: &wgpu::Adapter) -> Result<(), RenderError> {
    if adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::VERTEX_STORAGE) {
        return Ok(());
    }
    let name = adapter.get_info().name;
    Err(RenderError::Raster(format!("the vertex shaders of {name} cannot read storage buffers")))
}

impl Raster {
    /// `triangles` is the buffer that rays are traced against, with its binding,
    /// and holds `count` triangles.
    ///
    /// # Errors
    /// [`RenderError::Raster`] where the resolution is larger than the adapter
    /// draws, [`RenderError::Device`] where it refuses the shaders.
    pub fn new(
        gpu: &Gpu,
        params: &wgpu::Buffer,
        triangles: (u32, wgpu::BindingResource<'_>),
        count: u32,
        resolution: [u32; 2],
    ) -> Result<Self, RenderError> {
        let device = &gpu.device;
        let most = device.device.limits().max_texture_dimension_2d;
        let [width, height] = resolution;
        if width.max(height) > most {
            return Err(RenderError::Raster(format!(
                "the view has {width} x {height} pixels, and the adapter draws at most {most} each way"
            )));
        }
        let pipeline = pipeline(gpu);
        let projection = device.uniform("projection", &Projection::zeroed())?;
        let bound = [(0, params.as_entire_binding()), triangles, (12, projection.as_entire_binding())];
        let group = device.group(&pipeline.get_bind_group_layout(0), &bound);
        let visible = image(device, resolution, VISIBLE, wgpu::TextureUsages::TEXTURE_BINDING);
        let depth = image(device, resolution, DEPTH, wgpu::TextureUsages::empty());
        Ok(Raster { pipeline, group, projection, visible, depth, triangles: count })
    }

    /// The kernel that takes the points to shade from what was drawn.
    pub fn resolve<'a>(
        &'a self,
        gpu: &Gpu,
        mut bound: Vec<(u32, wgpu::BindingResource<'a>)>,
    ) -> Result<(Arc<Kernel>, wgpu::BindGroup), RenderError> {
        let kernel = gpu.tracing_kernel(SHADER, "resolve", vec![])?;
        bound.push((13, wgpu::BindingResource::TextureView(&self.visible)));
        let group = gpu.device.bind(&kernel, &bound);
        Ok((kernel, group))
    }

    /// Draws all triangles, in pieces that are each a submission of their own.
    /// `near` is the distance under which a perspective view sees nothing, metres.
    ///
    /// # Errors
    /// [`RenderError::Raster`] for a view that is neither orthographic nor
    /// perspective.
    pub fn draw(&self, device: &Device, view: &View, near: f32, timer: Option<&Timer>) -> Result<(), RenderError> {
        let projection = projection(view, near)?;
        device.queue.write_buffer(&self.projection, 0, bytemuck::bytes_of(&projection));
        for piece in 0..self.pieces() {
            let first = piece as u32 * TRIANGLES;
            let last = self.triangles.min(first.saturating_add(TRIANGLES));
            self.draw_piece(device, first..last, timer.map(|t| (t, piece)));
        }
        Ok(())
    }

    /// Submissions of [`Self::draw`]. A scene without triangles leaves an empty
    /// image, too.
    pub fn pieces(&self) -> u64 {
        self.triangles.div_ceil(TRIANGLES).max(1).into()
    }

    /// Draws some triangles; the first piece clears what was there.
    fn draw_piece(&self, device: &Device, triangles: std::ops::Range<u32>, timer: Option<(&Timer, u64)>) {
        fn load<T>(first: bool, clear: T) -> wgpu::LoadOp<T> {
            if first { wgpu::LoadOp::Clear(clear) } else { wgpu::LoadOp::Load }
        }
        let first = triangles.start == 0;
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let store = wgpu::StoreOp::Store;
            let color = wgpu::RenderPassColorAttachment {
                view: &self.visible,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: load(first, wgpu::Color::TRANSPARENT), store },
            };
            let depth = wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations { load: load(first, 1.0), store }),
                stencil_ops: None,
            };
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("visible"),
                color_attachments: &[Some(color)],
                depth_stencil_attachment: Some(depth),
                timestamp_writes: timer.map(|(t, _)| t.of_draw()),
                ..wgpu::RenderPassDescriptor::default()
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.group, &[]);
            pass.draw(triangles.start * 3..triangles.end * 3, 0..1);
        }
        if let Some((t, slot)) = timer {
            t.note(&mut encoder, slot);
        }
        device.queue.submit([encoder.finish()]);
    }
}

/// The view's way from points to its image.
fn projection(view: &View, near: f32) -> Result<Projection, RenderError> {
    let seen = view
        .world_to_image()
        .ok_or_else(|| RenderError::Raster("the view is neither orthographic nor perspective".into()))?;
    let rows = seen.to_image.transpose();
    let [width, height] = view.resolution.map(|n| n as f32);
    Ok(Projection {
        x: rows.x_axis.to_array(),
        perspective: u32::from(seen.perspective),
        y: rows.y_axis.to_array(),
        width,
        depth: rows.z_axis.to_array(),
        height,
        origin: seen.origin.to_array(),
        near,
    })
}

/// Draws both sides of triangles, nearest first.
fn pipeline(gpu: &Gpu) -> wgpu::RenderPipeline {
    let module = gpu.device.module("raster", &[gpu.trace(), SHADER].concat());
    let compilation_options = wgpu::PipelineCompilationOptions::default;
    gpu.device.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("raster"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("project"),
            compilation_options: compilation_options(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("show"),
            compilation_options: compilation_options(),
            targets: &[Some(VISIBLE.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn image(
    device: &Device,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::TextureView {
    let texture = device.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("visible"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
