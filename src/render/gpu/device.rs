//! A thin layer over wgpu: one device, kernels, buffers, and dispatches whose
//! errors come back as results.

use super::Options;
use crate::render::RenderError;
use bytemuck::Pod;
use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU32, Ordering},
    },
    time::Duration,
};

/// Threads of a workgroup, as every kernel says.
pub(super) const WORKGROUP: u32 = 64;

/// How a device is opened. Tests narrow it.
#[derive(Clone, Debug)]
pub(super) struct Setup {
    pub options: Options,
    pub flags: wgpu::InstanceFlags,
    /// Bytes of one binding at most, whatever the adapter takes.
    pub largest_binding: u64,
    /// A device that has not finished by then counts as hung.
    pub patience: Duration,
    #[cfg(test)]
    pub fuse: Option<Arc<super::tests::Fuse>>,
    /// Some text of the shaders and what stands in its place: a mistake made on purpose.
    #[cfg(test)]
    pub mistake: Option<[&'static str; 2]>,
}

impl Default for Setup {
    fn default() -> Self {
        Setup {
            options: Options::default(),
            flags: wgpu::InstanceFlags::empty(),
            largest_binding: u64::MAX,
            patience: Duration::from_secs(120),
            #[cfg(test)]
            fuse: None,
            #[cfg(test)]
            mistake: None,
        }
    }
}

/// Dispatches that are submitted before the device is waited for.
const IN_FLIGHT: u32 = 64;
/// The same by ray query on a software driver: Mesa 25's takes 5 s a dispatch.
const IN_FLIGHT_SLOW: u32 = 4;

/// An opened adapter.
pub(super) struct Device {
    pub info: wgpu::AdapterInfo,
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// Whether shaders may use ray query.
    pub ray_query: bool,
    /// Nanoseconds a tick, where the device has timestamp queries.
    tick: Option<f32>,
    trouble: Arc<Trouble>,
    setup: Setup,
    /// Dispatches so far.
    submitted: AtomicU32,
}

/// What went wrong outside an error scope: a lost device, a driver's refusal.
#[derive(Default)]
struct Trouble {
    message: Mutex<Option<String>>,
    /// Once and for all.
    lost: AtomicBool,
}

impl Trouble {
    fn note(&self, message: String) {
        self.message.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
    }

    fn lose(&self, message: String) {
        self.note(message);
        self.lost.store(true, Ordering::Release);
    }

    /// What there is; that a device is lost is told for ever.
    fn told(&self) -> Option<String> {
        let mut message = self.message.lock().unwrap_or_else(PoisonError::into_inner);
        if self.lost.load(Ordering::Acquire) { message.clone() } else { message.take() }
    }
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
    /// Opens an adapter with the largest buffers it has, and with ray query where
    /// that is asked for.
    pub fn open(adapter: &wgpu::Adapter, setup: &Setup, ray_query: bool) -> Result<Self, RenderError> {
        let has = adapter.limits();
        let info = adapter.get_info();
        let mut required_limits = wgpu::Limits {
            max_storage_buffer_binding_size: has.max_storage_buffer_binding_size.min(setup.largest_binding),
            max_buffer_size: has.max_buffer_size,
            max_texture_dimension_2d: has.max_texture_dimension_2d,
            ..wgpu::Limits::default()
        };
        let timestamps = adapter.features() & wgpu::Features::TIMESTAMP_QUERY;
        let mut required_features = timestamps;
        let mut experimental_features = wgpu::ExperimentalFeatures::disabled();
        if ray_query {
            required_features |= wgpu::Features::EXPERIMENTAL_RAY_QUERY;
            required_limits = required_limits.using_acceleration_structure_values(has);
            // SAFETY: the token says that wgpu may have bugs there that safe code
            // meets. This code stays within what its specification of ray query
            // asks for: structures are built from buffers that hold all their
            // vertices before any query, bind groups keep them, a query is
            // initialised before it goes on and not asked again once it ended.
            // Tested by tests/renderers/gpu_query.rs.
            experimental_features = unsafe { wgpu::ExperimentalFeatures::enabled() };
        }
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("aogauge"),
            required_features,
            required_limits,
            experimental_features,
            ..wgpu::DeviceDescriptor::default()
        }))
        .map_err(|e| RenderError::Device(format!("{} cannot be opened: {e}", info.name)))?;
        let trouble = Arc::new(Trouble::default());
        let (uncaptured, lost) = (trouble.clone(), trouble.clone());
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| uncaptured.note(in_a_line(&e.to_string()))));
        device.set_device_lost_callback(move |_, message| {
            lost.lose(["the device was lost", message.trim()].join(" ").trim().to_owned());
        });
        let tick = (!timestamps.is_empty()).then(|| queue.get_timestamp_period());
        Ok(Device { info, device, queue, ray_query, tick, trouble, setup: setup.clone(), submitted: AtomicU32::new(0) })
    }

    /// Whether the device is of no use any more.
    pub fn is_lost(&self) -> bool {
        self.trouble.lost.load(Ordering::Acquire)
    }

    /// Whether the adapter computes on the CPU, as Mesa's software driver does.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Some WGSL, for pipelines.
    pub fn module(&self, label: &str, source: &str) -> wgpu::ShaderModule {
        #[cfg(test)]
        let mistaken = self.setup.mistake.map_or_else(|| source.to_owned(), |[from, to]| source.replace(from, to));
        #[cfg(test)]
        let source = mistaken.as_str();
        let descriptor =
            wgpu::ShaderModuleDescriptor { label: Some(label), source: wgpu::ShaderSource::Wgsl(source.into()) };
        match self.setup.options.checks {
            Checks::On => self.device.create_shader_module(descriptor),
            // SAFETY: every index of our shaders is within its buffer. Nodes, triangles,
            // texels and numbers of triangles in images are those that this program
            // uploaded or its shaders wrote; a texel's place is wrapped into its texture.
            // Pixels are those of `pixel_of`, or are compared with the image's size
            // before they are used: taps of screen space, of history and of the filter.
            // A stack has an entry for each level of the tree, in the column of its own
            // invocation. Loops end with the rays, the lights, the taps or the tree.
            // Tested by `checks_change_nothing` in tests/renderers/gpu.rs, by
            // `no_kernel_has_validation_errors` in tests.rs and by tests/renderers/smoothing.rs,
            // which run all kernels but ray query's with every check on.
            Checks::Off => unsafe {
                self.device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked())
            },
        }
    }

    /// Compiles an entry point of some WGSL, for these values of its `override`
    /// constants. Its buffers are all in group 0.
    pub fn kernel(&self, source: &str, entry: &str, constants: &[(&str, f64)]) -> Result<Kernel, RenderError> {
        self.guarded(|| {
            let module = self.module(entry, source);
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
        // What a driver's tree is built of.
        let input = if self.ray_query { wgpu::BufferUsages::BLAS_INPUT } else { wgpu::BufferUsages::empty() };
        self.filled(label, contents, wgpu::BufferUsages::STORAGE | input)
    }

    /// A uniform buffer.
    pub fn uniform<T: Pod>(&self, label: &'static str, value: &T) -> Result<wgpu::Buffer, RenderError> {
        self.filled(label, bytemuck::bytes_of(value), wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST)
    }

    /// A buffer with contents, some words of four bytes. wgpu's own helper panics
    /// where the memory does not suffice.
    fn filled(&self, label: &str, contents: &[u8], usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, RenderError> {
        let size = contents.len() as u64;
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: true,
        });
        let refused = |e: wgpu::MapRangeError| RenderError::Device(format!("no memory for the {label}: {e}"));
        buffer.get_mapped_range_mut(..).map_err(refused)?.slice(..).copy_from_slice(contents);
        buffer.unmap();
        Ok(buffer)
    }

    /// Gives a kernel its buffers, and what else it has bound: exactly those that
    /// its entry point uses.
    pub fn bind(&self, kernel: &Kernel, resources: &[(u32, wgpu::BindingResource<'_>)]) -> wgpu::BindGroup {
        self.group(&kernel.pipeline.get_bind_group_layout(0), resources)
    }

    /// The same for any pipeline, by its layout.
    pub fn group(
        &self,
        layout: &wgpu::BindGroupLayout,
        resources: &[(u32, wgpu::BindingResource<'_>)],
    ) -> wgpu::BindGroup {
        let entries: Vec<wgpu::BindGroupEntry<'_>> = resources
            .iter()
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    }

    /// Submits one dispatch; a timer notes when it began and ended.
    pub fn run_timed(&self, kernel: &Kernel, group: &wgpu::BindGroup, invocations: u32, timer: Option<(&Timer, u64)>) {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: None,
                timestamp_writes: timer.map(|(t, _)| t.of_dispatch()),
            });
            pass.set_pipeline(&kernel.pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(invocations.div_ceil(WORKGROUP), 1, 1);
        }
        if let Some((t, slot)) = timer {
            t.note(&mut encoder, slot);
        }
        self.queue.submit([encoder.finish()]);
        // Patience is for a dispatch that hangs, not for a job of many. What goes wrong
        // is noted, and told by the next `check`.
        let in_flight = if self.ray_query && self.is_software() { IN_FLIGHT_SLOW } else { IN_FLIGHT };
        if self.submitted.fetch_add(1, Ordering::Relaxed) % in_flight == in_flight - 1 {
            match self.poll() {
                Err(wgpu::PollError::Timeout) => drop(self.abandon()),
                Err(e) => self.trouble.note(e.to_string()),
                Ok(_) => {}
            }
        }
    }

    fn poll(&self) -> Result<wgpu::PollStatus, wgpu::PollError> {
        self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(self.setup.patience) })
    }

    /// Waits until all that was submitted has run.
    pub fn wait(&self) -> Result<(), RenderError> {
        match self.poll() {
            Err(wgpu::PollError::Timeout) => Err(self.abandon()),
            Err(e) => Err(RenderError::Device(e.to_string())),
            Ok(_) => self.check(),
        }
    }

    /// Times by the CPU's clock from now on.
    pub fn ignore_timestamps(&mut self) {
        self.tick = None;
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
            Err(_) => return Err(self.abandon()),
        }
        let mapped = staging.slice(..).get_mapped_range().map_err(|e| device_error(&e))?;
        Ok(bytemuck::pod_collect_to_vec(&mapped))
    }

    /// Gives a hung device up. It is never closed: that would wait for it.
    fn abandon(&self) -> RenderError {
        std::mem::forget((self.device.clone(), self.queue.clone()));
        self.trouble.lose(format!("it did not finish within {} s", self.setup.patience.as_secs()));
        self.check().err().unwrap_or_else(|| RenderError::Device("it hangs".into()))
    }

    /// Runs `work` with the device's errors caught, and returns the first of them.
    ///
    /// wgpu panics where a driver loses the device while it is waited for. Then,
    /// too, the device counts as lost, and the program goes on.
    pub fn guarded<T>(&self, work: impl FnOnce() -> Result<T, RenderError>) -> Result<T, RenderError> {
        self.check()?;
        #[cfg(test)]
        self.burn();
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let result = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
            let said = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
            let message = said.unwrap_or("the driver failed");
            self.trouble.lose(in_a_line(message));
            self.check().and(Err(RenderError::Device(in_a_line(message))))
        });
        let errors = [pollster::block_on(validation.pop()), pollster::block_on(memory.pop())];
        self.check()?;
        if let Some(e) = errors.into_iter().flatten().next() {
            return Err(RenderError::Device(match e {
                wgpu::Error::OutOfMemory { .. } => "its memory does not suffice for this scene and view".into(),
                other => in_a_line(&other.to_string()),
            }));
        }
        result
    }

    fn check(&self) -> Result<(), RenderError> {
        self.trouble.told().map_or(Ok(()), |message| Err(RenderError::Device(message)))
    }

    /// Loses the device where a test asks for it.
    #[cfg(test)]
    fn burn(&self) {
        if self.setup.fuse.as_ref().is_some_and(|fuse| fuse.burns()) {
            self.device.destroy();
            self.device.poll(wgpu::PollType::Poll).unwrap();
        }
    }

    /// Whether so many bytes fit into one binding.
    pub fn fits(&self, what: &'static str, needs: u64) -> Result<(), RenderError> {
        let limits = self.device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if needs > limit {
            return Err(RenderError::TooLarge { what, needs, limit });
        }
        Ok(())
    }
}

/// wgpu's messages, in one line.
fn in_a_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
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

    /// For a compute pass whose beginning and end count.
    fn of_dispatch(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    /// For a render pass, likewise.
    pub fn of_draw(&self) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    /// After that pass: keeps its times in a slot.
    pub fn note(&self, encoder: &mut wgpu::CommandEncoder, slot: u64) {
        encoder.resolve_query_set(&self.queries, 0..2, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.ticks, slot * TICKS, TICKS);
    }

    /// Seconds that all dispatches took together; `wall`, the CPU's own count of
    /// them, where there is no timer.
    pub fn total(timer: Option<&Timer>, device: &Device, wall: f64) -> Result<f64, RenderError> {
        let Some(timer) = timer else { return Ok(wall) };
        let ticks: Vec<[u64; 2]> = device.read(&timer.ticks)?;
        let seconds = |[a, b]: &[u64; 2]| b.saturating_sub(*a) as f64 * f64::from(timer.tick) * 1e-9;
        Ok(ticks.iter().map(seconds).sum())
    }
}
