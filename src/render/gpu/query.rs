//! Rays by ray query: the acceleration structure that the driver builds and walks
//! in place of the renderer's own tree. The shader: `shaders/trace_query.wgsl`.

use super::{Traversal, device::Device};
use crate::render::RenderError;

/// Whether an adapter is to trace by ray query.
///
/// # Errors
/// [`RenderError::RayQuery`] where it is asked to and cannot.
pub(super) fn is_chosen(traversal: Traversal, adapter: &wgpu::Adapter) -> Result<bool, RenderError> {
    let info = adapter.get_info();
    let has = adapter.features().contains(wgpu::Features::EXPERIMENTAL_RAY_QUERY);
    match traversal {
        Traversal::Software => Ok(false),
        Traversal::RayQuery if has => Ok(true),
        Traversal::RayQuery => {
            Err(RenderError::RayQuery(format!("{} with this driver ({}) has none", info.name, info.backend)))
        }
    }
}

/// Has the driver build its structure over triangles: `count` of them in a buffer,
/// three corners of four floats each, the last of which does not count. A hit's
/// `primitive_index` is the triangle's place in the buffer.
///
/// # Errors
/// [`RenderError::RayQuery`] where there are more triangles than the driver takes.
pub(super) fn build(device: &Device, triangles: &wgpu::Buffer, count: usize) -> Result<wgpu::Tlas, RenderError> {
    let most = device.device.limits().max_blas_primitive_count.min(u32::MAX / 3);
    let vertices = u32::try_from(count).ok().filter(|&n| n <= most).map(|n| n * 3).ok_or_else(|| {
        RenderError::RayQuery(format!("the scene has {count} triangles, and the adapter takes at most {most}"))
    })?;
    let size = wgpu::BlasTriangleGeometrySizeDescriptor {
        vertex_format: wgpu::VertexFormat::Float32x3,
        vertex_count: vertices,
        index_format: None,
        index_count: None,
        flags: wgpu::AccelerationStructureGeometryFlags::empty(),
    };
    let flags = wgpu::AccelerationStructureFlags::PREFER_FAST_TRACE;
    let update_mode = wgpu::AccelerationStructureUpdateMode::Build;
    let blas = device.device.create_blas(
        &wgpu::CreateBlasDescriptor { label: Some("triangles"), flags, update_mode },
        wgpu::BlasGeometrySizeDescriptors::Triangles { descriptors: vec![size.clone()] },
    );
    let mut tlas = device.device.create_tlas(&wgpu::CreateTlasDescriptor {
        label: Some("scene"),
        max_instances: 1,
        flags,
        update_mode,
    });
    const IDENTITY: [f32; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    tlas[0] = Some(wgpu::TlasInstance::new(&blas, IDENTITY, 0, 0xff));
    let geometry = wgpu::BlasTriangleGeometry {
        size: &size,
        vertex_buffer: triangles,
        first_vertex: 0,
        vertex_stride: 16,
        index_buffer: None,
        first_index: None,
        transform_buffer: None,
        transform_buffer_offset: None,
    };
    let entry =
        wgpu::BlasBuildEntry { blas: &blas, geometry: wgpu::BlasGeometries::TriangleGeometries(vec![geometry]) };
    let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.build_acceleration_structures([&entry], [&tlas]);
    device.queue.submit([encoder.finish()]);
    Ok(tlas)
}
