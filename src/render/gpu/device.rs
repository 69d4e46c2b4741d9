//! A thin layer over wgpu: one device, kernels, buffers, and dispatches whose
//! errors come back as results.

use crate::render::RenderError;
use bytemuck::Pod;
use std::{
    sync::{Arc, Mutex},
    time::Duration,
};
use wgpu::util::DeviceExt;

/// Threads of a workgroup, as every kernel says.
pub(super) const WORKGROUP: u32 = 64;

/// A device that has not finished by then counts as hung.
const PATIENCE: Duration = Duration::from_secs(120);

/// An opened adapter.
pub(super) struct Device {
    pub info: wgpu::AdapterInfo,
    checks: Checks,
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// Nanoseconds a tick, where the device has timestamp queries.
    tick: Option<f32>,
    /// What went wrong outside an error scope: a lost device, a driver's refusal.
    trouble: Arc<Mutex<Option<String>>>,
}

/// Whether shaders check every index and bound every loop at run time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Checks {
    /// They do: for tests.
    On,
    /// They do not: some drivers take a sixth longer with them.
    #[default]
    Off,
}

/// An entry point of a shader that runs on workgroups of [`WORKGROUP`] threads.
pub(super) struct Kernel {
    pipeline: wgpu::ComputePipeline,
}

impl Device {
    /// Opens an adapter with the largest buffers it has.
    pub fn open(adapter: &wgpu::Adapter, checks: Checks) -> Result<Self, RenderError> {
        let has = adapter.limits();
        let required_limits = wgpu::Limits {
            max_storage_buffer_binding_size: has.max_storage_buffer_binding_size,
            max_buffer_size: has.max_buffer_size,
            max_texture_dimension_2d: has.max_texture_dimension_2d,
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
        let tick = (!timestamps.is_empty()).then(|| queue.get_timestamp_period());
        Ok(Device { info: adapter.get_info(), checks, device, queue, tick, trouble })
    }

    /// Whether the adapter computes on the CPU, as Mesa's software driver does.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Compiles an entry point of some WGSL, for these values of its `override`
    /// constants. Its buffers are all in group 0.
    pub fn kernel(&self, source: &str, entry: &str, constants: &[(&str, f64)]) -> Result<Kernel, RenderError> {
        self.guarded(|| {
            let descriptor =
                wgpu::ShaderModuleDescriptor { label: Some(entry), source: wgpu::ShaderSource::Wgsl(source.into()) };
            let module = match self.checks {
                Checks::On => self.device.create_shader_module(descriptor),
                // SAFETY: all indices of our shaders come from what this program
                // uploads (nodes and triangles of one tree, pixels of images that are
                // as large as the dispatch says), and loops end with the tree, whose
                // depth is checked against the stack. Tested by `checks_change_nothing`
                // in tests/gpu.rs, which renders the same with every check on.
                Checks::Off => unsafe {
                    self.device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked())
                },
            };
            let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants,
                    zero_initialize_workgroup_memory: false,
                },
                cache: None,
            });
            Ok(Kernel { pipeline })
        })
    }

    /// A buffer that kernels read and write.
    pub fn storage(&self, label: &'static str, bytes: u64) -> Result<wgpu::Buffer, RenderError> {
        self.fits(label, bytes)?;
        Ok(self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        }))
    }

    /// A buffer that kernels read.
    pub fn upload(&self, label: &'static str, contents: &[u8]) -> Result<wgpu::Buffer, RenderError> {
        self.fits(label, contents.len() as u64)?;
        Ok(self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents,
            usage: wgpu::BufferUsages::STORAGE,
        }))
    }

    /// A uniform buffer.
    pub fn uniform<T: Pod>(&self, label: &'static str, value: &T) -> wgpu::Buffer {
        self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents: bytemuck::bytes_of(value),
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        })
    }

    /// Gives a kernel its buffers: exactly those that its entry point uses.
    pub fn bind(&self, kernel: &Kernel, buffers: &[(u32, &wgpu::Buffer)]) -> wgpu::BindGroup {
        let entries: Vec<wgpu::BindGroupEntry<'_>> = buffers
            .iter()
            .map(|&(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &kernel.pipeline.get_bind_group_layout(0),
            entries: &entries,
        })
    }

    /// Submits one dispatch; a timer notes when it began and ended.
    pub fn run_timed(&self, kernel: &Kernel, group: &wgpu::BindGroup, invocations: u32, timer: Option<(&Timer, u64)>) {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: None,
                timestamp_writes: timer.map(|(t, _)| wgpu::ComputePassTimestampWrites {
                    query_set: &t.queries,
                    beginning_of_pass_write_index: Some(0),
                    end_of_pass_write_index: Some(1),
                }),
            });
            pass.set_pipeline(&kernel.pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(invocations.div_ceil(WORKGROUP), 1, 1);
        }
        if let Some((t, slot)) = timer {
            encoder.resolve_query_set(&t.queries, 0..2, &t.resolved, 0);
            encoder.copy_buffer_to_buffer(&t.resolved, 0, &t.ticks, slot * TICKS, TICKS);
        }
        self.queue.submit([encoder.finish()]);
    }

    /// Waits until all that was submitted has run.
    pub fn wait(&self) -> Result<(), RenderError> {
        self.device
            .poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(PATIENCE) })
            .map_err(|e| RenderError::Device(e.to_string()))?;
        self.check()
    }

    /// Whether dispatches can be timed by the device itself.
    pub fn has_timestamps(&self) -> bool {
        self.tick.is_some()
    }

    /// Copies buffers into others of their size.
    pub fn copy(&self, pairs: &[(&wgpu::Buffer, &wgpu::Buffer)]) {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (from, to) in pairs {
            encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
        }
        self.queue.submit([encoder.finish()]);
    }

    /// Copies a buffer back, once all that was submitted has run.
    pub fn read<T: Pod>(&self, source: &wgpu::Buffer) -> Result<Vec<T>, RenderError> {
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("staging"),
            size: source.size(),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(source, 0, &staging, 0, source.size());
        self.queue.submit([encoder.finish()]);
        let (sender, receiver) = std::sync::mpsc::channel();
        staging.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // A receiver that is gone has stopped waiting.
            let _ = sender.send(result);
        });
        let device_error = |e: &dyn std::fmt::Display| RenderError::Device(e.to_string());
        self.wait()?;
        match receiver.try_recv() {
            Ok(Ok(())) => {}
            Ok(Err(e)) => return Err(device_error(&e)),
            Err(_) => return Err(RenderError::Device(format!("it did not finish within {} s", PATIENCE.as_secs()))),
        }
        let mapped = staging.slice(..).get_mapped_range().map_err(|e| device_error(&e))?;
        Ok(bytemuck::pod_collect_to_vec(&mapped))
    }

    /// Runs `work` with the device's errors caught, and returns the first of them.
    pub fn guarded<T>(&self, work: impl FnOnce() -> Result<T, RenderError>) -> Result<T, RenderError> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let result = work();
        let errors = [pollster::block_on(validation.pop()), pollster::block_on(memory.pop())];
        if let Some(e) = errors.into_iter().flatten().next() {
            return Err(RenderError::Device(e.to_string()));
        }
        self.check()?;
        result
    }

    fn check(&self) -> Result<(), RenderError> {
        match self.trouble.lock().ok().and_then(|mut slot| slot.take()) {
            Some(message) => Err(RenderError::Device(message)),
            None => Ok(()),
        }
    }

    fn fits(&self, what: &'static str, needs: u64) -> Result<(), RenderError> {
        let limits = self.device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if needs > limit {
            return Err(RenderError::TooLarge { what, needs, limit });
        }
        Ok(())
    }
}

/// Bytes of a pair of timestamps.
const TICKS: u64 = 16;

/// Timestamps of a job's dispatches.
pub(super) struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    ticks: wgpu::Buffer,
    tick: f32,
}

impl Timer {
    /// A timer of as many dispatches; None where the device has no timestamps.
    pub fn new(device: &Device, dispatches: u64) -> Option<Self> {
        let tick = device.tick?;
        let buffer = |label, size, usage| {
            device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let (resolve, from, to) =
            (wgpu::BufferUsages::QUERY_RESOLVE, wgpu::BufferUsages::COPY_SRC, wgpu::BufferUsages::COPY_DST);
        Some(Timer {
            queries: device.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: None,
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: buffer("resolved", TICKS, resolve | from),
            ticks: buffer("ticks", dispatches * TICKS, to | from),
            tick,
        })
    }

    /// Seconds that each dispatch took.
    pub fn seconds(&self, device: &Device) -> Result<Vec<f64>, RenderError> {
        let ticks: Vec<[u64; 2]> = device.read(&self.ticks)?;
        let seconds = |[a, b]: &[u64; 2]| b.saturating_sub(*a) as f64 * f64::from(self.tick) * 1e-9;
        Ok(ticks.iter().map(seconds).collect())
    }
}
