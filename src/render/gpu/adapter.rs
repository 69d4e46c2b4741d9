//! Which adapters there are, and which of them computes.

use super::drivers::System;
use crate::render::RenderError;
use serde::Serialize;

/// The backends that aogauge computes on.
const BACKENDS: wgpu::Backends = wgpu::Backends::VULKAN.union(wgpu::Backends::METAL).union(wgpu::Backends::DX12);

/// The adapters that `WGPU_BACKEND` leaves, hardware before software.
pub(super) fn adapters(flags: wgpu::InstanceFlags) -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    descriptor.backends &= BACKENDS;
    descriptor.flags |= flags;
    let backends = descriptor.backends;
    let instance = wgpu::Instance::new(descriptor);
    let mut adapters = pollster::block_on(instance.enumerate_adapters(backends));
    adapters.sort_by_key(|a| preference(a.get_info().device_type));
    adapters
}

/// Hardware before software.
fn preference(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// What an adapter's name must contain, in any case: `WGPU_ADAPTER_NAME`.
pub(super) fn wanted() -> Option<String> {
    std::env::var("WGPU_ADAPTER_NAME").ok().filter(|name| !name.is_empty())
}

/// Whether an adapter's name is as wanted.
pub(super) fn is_wanted(adapter: &wgpu::Adapter, wanted: Option<&str>) -> bool {
    wanted.is_none_or(|w| adapter.get_info().name.to_lowercase().contains(&w.to_lowercase()))
}

/// The adapter that computes: the first one of the wanted name.
///
/// # Errors
/// [`RenderError::NoAdapter`] where there is none.
pub(super) fn best(flags: wgpu::InstanceFlags) -> Result<wgpu::Adapter, RenderError> {
    let adapters = adapters(flags);
    let wanted = wanted();
    if let Some(adapter) = adapters.iter().find(|a| is_wanted(a, wanted.as_deref())) {
        return Ok(adapter.clone());
    }
    Err(RenderError::NoAdapter(match wanted {
        Some(wanted) if !adapters.is_empty() => {
            let names: Vec<String> = adapters.iter().map(|a| a.get_info().name).collect();
            format!("none has '{wanted}' in its name, as WGPU_ADAPTER_NAME asks; there is {}", names.join(", "))
        }
        _ => nothing_answers(),
    }))
}

/// Why there are no adapters at all.
fn nothing_answers() -> String {
    match std::env::var("WGPU_BACKEND") {
        Ok(narrowed) if !BACKENDS.intersects(wgpu::Backends::from_comma_list(&narrowed)) => {
            format!("WGPU_BACKEND is '{narrowed}': aogauge computes on vulkan, metal and dx12")
        }
        _ => format!("no Vulkan, Metal or DirectX 12 driver answers; {}", System::here().software()),
    }
}

/// An adapter that answers, and what of it matters here.
#[derive(Clone, Debug, Serialize)]
pub struct Adapter {
    /// The adapter's name.
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub kind: &'static str,
    /// `vulkan`, `metal` or `dx12`.
    pub backend: String,
    /// The driver and its version.
    pub driver: String,
    /// Whether aogauge chooses it.
    pub used: bool,
    /// Whether its name is as `WGPU_ADAPTER_NAME` asks.
    pub wanted: bool,
    /// What it can do.
    pub features: Features,
    /// How much it takes.
    pub limits: Limits,
}

/// Features of an adapter that matter here.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Features {
    /// Times are taken by the device's own clock.
    pub timestamps: bool,
    /// Invocations that work in step, least and most; None without subgroups.
    pub subgroups: Option<[u32; 2]>,
    /// 16-bit floats.
    pub f16: bool,
    /// Ray queries: hardware, or the driver's software, traces.
    pub ray_query: bool,
    /// Bytes of immediates; None without them.
    pub immediates: Option<u32>,
}

/// Limits of an adapter that matter here.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Limits {
    /// Bytes of one binding: triangles, nodes, textures, an image.
    pub binding: u64,
    /// Bytes of one buffer.
    pub buffer: u64,
    /// Bytes that a workgroup shares.
    pub workgroup_memory: u32,
    /// Invocations of a workgroup.
    pub workgroup: u32,
    /// Texels along an edge of a texture.
    pub texture: u32,
}

/// All adapters that `WGPU_BACKEND` leaves, in the order of preference.
pub fn survey() -> Vec<Adapter> {
    let wanted = wanted();
    let all = adapters(wgpu::InstanceFlags::empty());
    let of = |a: &wgpu::Adapter| Adapter { wanted: is_wanted(a, wanted.as_deref()), ..Adapter::of(a) };
    let mut all: Vec<Adapter> = all.iter().map(of).collect();
    if let Some(first) = all.iter_mut().find(|a| a.wanted) {
        first.used = true;
    }
    all
}

impl Adapter {
    fn of(adapter: &wgpu::Adapter) -> Self {
        let (info, has, limits) = (adapter.get_info(), adapter.features(), adapter.limits());
        let subgroups = [info.subgroup_min_size, info.subgroup_max_size];
        Adapter {
            kind: match info.device_type {
                wgpu::DeviceType::DiscreteGpu => "discrete",
                wgpu::DeviceType::IntegratedGpu => "integrated",
                wgpu::DeviceType::VirtualGpu => "virtual",
                wgpu::DeviceType::Cpu => "software",
                wgpu::DeviceType::Other => "other",
            },
            backend: info.backend.to_string(),
            driver: [info.driver.as_str(), info.driver_info.as_str()].join(" ").trim().to_owned(),
            used: false,
            wanted: true,
            features: Features {
                timestamps: has.contains(wgpu::Features::TIMESTAMP_QUERY),
                subgroups: has.contains(wgpu::Features::SUBGROUP).then_some(subgroups),
                f16: has.contains(wgpu::Features::SHADER_F16),
                ray_query: has.contains(wgpu::Features::EXPERIMENTAL_RAY_QUERY),
                immediates: has.contains(wgpu::Features::IMMEDIATES).then_some(limits.max_immediate_size),
            },
            limits: Limits {
                binding: limits.max_storage_buffer_binding_size,
                buffer: limits.max_buffer_size,
                workgroup_memory: limits.max_compute_workgroup_storage_size,
                workgroup: limits.max_compute_invocations_per_workgroup,
                texture: limits.max_texture_dimension_2d,
            },
            name: info.name,
        }
    }
}
