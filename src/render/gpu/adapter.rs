//! Which adapters there are, and which of them computes.

use crate::render::RenderError;

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
        _ => format!("no Vulkan, Metal or DirectX 12 driver answers; {}", how_to_get_one()),
    }
}

/// What gives this system a software adapter at least.
pub(super) fn how_to_get_one() -> &'static str {
    "on Debian, `apt-get install mesa-vulkan-drivers libvulkan1` gives a software one"
}
