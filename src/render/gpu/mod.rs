//! The GPU renderer: compute shaders through wgpu, on hardware or on a software
//! driver. Each WGSL stage stands beside its CPU twin under the same name.

mod loaded;
mod params;

use super::{Geometry, Loaded, RenderError, Renderer};
use loaded::LoadedGpu;
use std::sync::{Arc, Mutex};

/// The shader, its stages in order.
const SHADER: &str = concat!(
    include_str!("shaders/sampler.wgsl"),
    include_str!("shaders/trace.wgsl"),
    include_str!("shaders/ao.wgsl"),
    include_str!("shaders/indirect.wgsl")
);

/// A device with its pipelines.
pub struct Gpu {
    info: wgpu::AdapterInfo,
    device: wgpu::Device,
    queue: wgpu::Queue,
    layout: wgpu::BindGroupLayout,
    see: wgpu::ComputePipeline,
    openness: wgpu::ComputePipeline,
    indirect: wgpu::ComputePipeline,
    /// Nanoseconds a tick, where the device has timestamp queries.
    tick: Option<f32>,
    /// What went wrong outside an error scope: a lost device, a driver's refusal.
    trouble: Arc<Mutex<Option<String>>>,
}

/// The backends that aogauge computes on.
fn backends() -> wgpu::Backends {
    wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12
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

impl Gpu {
    /// Opens the best adapter there is: hardware before software. Backends can be
    /// narrowed by `WGPU_BACKEND`.
    ///
    /// # Errors
    /// [`RenderError::NoAdapter`] where there is none, [`RenderError::Device`]
    /// where it cannot be opened or refuses the shaders.
    pub fn open() -> Result<Self, RenderError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
        descriptor.backends &= backends();
        let backends = descriptor.backends;
        let instance = wgpu::Instance::new(descriptor);
        let mut adapters = pollster::block_on(instance.enumerate_adapters(backends));
        adapters.sort_by_key(|a| preference(a.get_info().device_type));
        let adapter = adapters.into_iter().next().ok_or_else(|| {
            RenderError::NoAdapter(
                "no Vulkan, Metal or DirectX 12 driver answers; on Debian, `apt-get install mesa-vulkan-drivers libvulkan1` gives a software one"
                    .into(),
            )
        })?;
        Self::on(&adapter)
    }

    fn on(adapter: &wgpu::Adapter) -> Result<Self, RenderError> {
        let has = adapter.limits();
        let required_limits = wgpu::Limits {
            max_storage_buffer_binding_size: has.max_storage_buffer_binding_size,
            max_buffer_size: has.max_buffer_size,
            ..wgpu::Limits::default()
        };
        let timestamps = adapter.features() & wgpu::Features::TIMESTAMP_QUERY;
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("aogauge"),
            required_features: timestamps,
            required_limits,
            ..wgpu::DeviceDescriptor::default()
        }))
        .map_err(|e| RenderError::Device(e.to_string()))?;
        let trouble = Arc::new(Mutex::new(None));
        let note = trouble.clone();
        let put = move |message: String| {
            if let Ok(mut slot) = note.lock() {
                slot.get_or_insert(message);
            }
        };
        let lost = put.clone();
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| put(e.to_string())));
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                lost(format!("the device was lost: {message}"));
            }
        });
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("aogauge"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let layout = bindings(&device);
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = |stage: &str| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(stage),
                layout: Some(&pipeline_layout),
                module: &shader,
                entry_point: Some(stage),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        };
        let (see, openness, indirect) = (pipeline("see"), pipeline("openness"), pipeline("indirect"));
        if let Some(e) = pollster::block_on(scope.pop()) {
            return Err(RenderError::Device(e.to_string()));
        }
        let tick = (!timestamps.is_empty()).then(|| queue.get_timestamp_period());
        Ok(Gpu { info: adapter.get_info(), device, queue, layout, see, openness, indirect, tick, trouble })
    }

    /// Adapter, driver and backend, for people.
    pub fn describe(&self) -> String {
        let i = &self.info;
        let driver = [i.driver.as_str(), i.driver_info.as_str()].join(" ");
        format!("{}, {} ({})", i.name, driver.trim(), i.backend)
    }

    /// Whether the adapter computes on the CPU, as Mesa's software driver does.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    fn check(&self) -> Result<(), RenderError> {
        match self.trouble.lock().ok().and_then(|mut slot| slot.take()) {
            Some(message) => Err(RenderError::Device(message)),
            None => Ok(()),
        }
    }
}

fn bindings(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding: u32, ty: wgpu::BufferBindingType| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[
            entry(0, wgpu::BufferBindingType::Uniform),
            entry(1, storage(true)),
            entry(2, storage(true)),
            entry(3, storage(false)),
            entry(4, storage(false)),
            entry(5, storage(false)),
            entry(6, storage(true)),
        ],
    })
}

impl Renderer for Gpu {
    fn load<'a>(&'a self, geometry: &'a Geometry) -> Result<Box<dyn Loaded + 'a>, RenderError> {
        Ok(Box::new(LoadedGpu::new(self, geometry)?))
    }
}
