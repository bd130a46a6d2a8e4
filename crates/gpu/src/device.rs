//! An open device.

#[cfg(not(target_family = "wasm"))]
use std::panic::resume_unwind;
use std::{
    collections::HashMap,
    path::Path,
    sync::{
        Arc, Mutex, OnceLock, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use canted_shaders::{MAX_STORAGE_BUFFERS, ShaderName};
use wgpu::{DeviceDescriptor, ExperimentalFeatures, Features, Limits, MemoryHints, SubmissionIndex, Trace};

use crate::adapter::{AdapterInfo, Choice, choose, facts_of};
use crate::block_on;
use crate::memory::{Counters, FrameBuffers, Memory, Staging, WorkBuffers};
use crate::pipelines::KeptPipelines;
#[cfg(not(target_family = "wasm"))]
use crate::timeout::AdaptiveTimeout;
use crate::{GpuError, Kernel, Variant, trusted};

/// An open device with its queue and compiled kernels.
///
/// Errors that the driver reports asynchronously are stored and returned by the next fallible call.
pub struct Gpu {
    facts: AdapterInfo,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    limits: Limits,
    stored_error: Arc<Mutex<Option<GpuError>>>,
    pub(crate) memory: Memory,
    #[cfg(not(target_family = "wasm"))]
    timeout: AdaptiveTimeout,
    kernels: Mutex<HashMap<String, Arc<Kernel>>>,
    /// See [`Gpu::keep_pipelines`].
    pipelines: Option<KeptPipelines>,
    pub(crate) frame_buffers: Mutex<Option<FrameBuffers>>,
    pub(crate) counters: Counters,
    /// Whether all kernels keep the checks of `wgpu`; see [`crate::trusted`].
    is_checked: AtomicBool,
    pub(crate) staging: Staging,
    /// See [`Gpu::work_buffer`].
    pub(crate) work_buffers: WorkBuffers,
    /// See [`crate::commands::longest_loop`].
    pub(crate) longest_loop: OnceLock<u32>,
}

impl Gpu {
    /// Opens an adapter. In a browser there is no choice but [`Choice::Best`].
    ///
    /// # Errors
    /// No matching adapter, or the adapter provides no device.
    pub async fn open(choice: &Choice) -> Result<Self, GpuError> {
        Self::with_limits(choice, |limits| limits).await
    }

    /// Opens an adapter with limits reduced by `lower`, to emulate weaker devices.
    ///
    /// # Errors
    /// As for [`Gpu::open`].
    pub async fn with_limits(choice: &Choice, lower: impl FnOnce(Limits) -> Limits) -> Result<Self, GpuError> {
        let chosen = choose(choice).await?;
        Self::opened(chosen, lower, Features::empty(), ExperimentalFeatures::disabled()).await
    }

    /// Opens an adapter with the ray queries of its driver, for [`Source::DriverRayQueries`](crate::Source::DriverRayQueries). All else is
    /// as after [`Gpu::open`], which does not ask for them: `wgpu` calls them experimental.
    ///
    /// # Errors
    /// As for [`Gpu::open`]; [`GpuError::Unsupported`] if the adapter has none.
    pub async fn with_ray_queries(choice: &Choice) -> Result<Self, GpuError> {
        let (adapter, facts) = choose(choice).await?;
        if !facts.has_ray_queries {
            return Err(GpuError::Unsupported {
                what: format!("ray queries of the driver by adapter '{}'", facts.name),
            });
        }
        let most = adapter.limits();
        let raise = |limits: Limits| limits.using_acceleration_structure_values(most);
        Self::opened((adapter, facts), raise, Features::EXPERIMENTAL_RAY_QUERY, trusted::experimental()).await
    }

    async fn opened(
        (adapter, facts): (wgpu::Adapter, AdapterInfo),
        change: impl FnOnce(Limits) -> Limits,
        features: Features,
        experimental_features: ExperimentalFeatures,
    ) -> Result<Self, GpuError> {
        // Default limits, raised only where the kernels need it. A device grants no more than was requested.
        let (most, usual) = (adapter.limits(), Limits::defaults());
        let most_buffers = MAX_STORAGE_BUFFERS + usual.max_uniform_buffers_per_shader_stage;
        let limits = change(Limits {
            max_storage_buffer_binding_size: most.max_storage_buffer_binding_size,
            max_buffer_size: most.max_buffer_size,
            max_storage_buffers_per_shader_stage: most.max_storage_buffers_per_shader_stage.min(MAX_STORAGE_BUFFERS),
            max_buffers_and_acceleration_structures_per_shader_stage: most
                .max_buffers_and_acceleration_structures_per_shader_stage
                .min(most_buffers),
            max_compute_workgroup_storage_size: most.max_compute_workgroup_storage_size.min(32_768),
            max_color_attachment_bytes_per_sample: most.max_color_attachment_bytes_per_sample.min(64),
            ..usual
        });
        let descriptor = DeviceDescriptor {
            label: Some("canted"),
            required_features: features | adapter.features() & (Features::TIMESTAMP_QUERY | Features::PIPELINE_CACHE),
            required_limits: limits.clone(),
            experimental_features,
            memory_hints: MemoryHints::Performance,
            trace: Trace::Off,
        };
        let opened = adapter.request_device(&descriptor).await;
        let (device, queue) =
            opened.map_err(|error| GpuError::Refused { adapter: facts.name.clone(), message: error.to_string() })?;
        let stored_error = Arc::new(Mutex::new(None));
        let (late, lost) = (stored_error.clone(), stored_error.clone());
        // Without a handler, uncaptured errors panic.
        device.on_uncaptured_error(Arc::new(move |error| keep(&late, from_wgpu(&error))));
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                keep(&lost, GpuError::Lost { message });
            }
        });
        Ok(Self::of_parts(facts, device, queue, limits, stored_error))
    }

    /// A program's own device and queue, of the version of `wgpu` that this crate re-exports. The front page of this crate lists the limits that
    /// the device needs.
    ///
    /// The program keeps its handlers: errors that are found when buffers and kernels are made are returned, others go to the handlers.
    /// For the loss of the device, see [`Gpu::lost_handler`].
    ///
    /// ```no_run
    /// # fn example(device: wgpu::Device, queue: wgpu::Queue) -> Result<(), canted_gpu::GpuError> {
    /// use canted_gpu::{Gpu, Options, Source, TracedScene, block_on, build::BuildConfig};
    ///
    /// let gpu = Gpu::from_wgpu(device, queue);
    /// let mesh = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]];
    /// let source = Source::build([&mesh], BuildConfig::default());
    /// let scene = block_on(TracedScene::new(&gpu, source, Options::default()))?;
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn from_wgpu(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let limits = device.limits();
        let facts = facts_of(device.adapter_info(), &limits, device.features());
        Self::of_parts(facts, device, queue, limits, Arc::default())
    }

    fn of_parts(
        facts: AdapterInfo,
        device: wgpu::Device,
        queue: wgpu::Queue,
        limits: Limits,
        stored_error: Arc<Mutex<Option<GpuError>>>,
    ) -> Self {
        Self {
            facts,
            device,
            queue,
            limits,
            stored_error,
            memory: Memory::unbounded(),
            #[cfg(not(target_family = "wasm"))]
            timeout: AdaptiveTimeout::default(),
            kernels: Mutex::default(),
            pipelines: None,
            frame_buffers: Mutex::default(),
            counters: Counters::default(),
            is_checked: AtomicBool::new(false),
            staging: Staging::default(),
            work_buffers: WorkBuffers::default(),
            longest_loop: OnceLock::new(),
        }
    }

    /// A handler of lost devices. After the device has reported its loss to it, every call returns [`GpuError::Lost`].
    ///
    /// [`Gpu::open`] sets it. [`Gpu::from_wgpu`] does not: pass it to [`wgpu::Device::set_device_lost_callback`], or call it from the program's own handler.
    /// To continue, make a new device, and on it a [`Gpu`], scene, pipeline and bind group.
    pub fn lost_handler(&self) -> impl Fn(wgpu::DeviceLostReason, String) + Send + Sync + 'static {
        let lost = self.stored_error.clone();
        move |reason, message| {
            let message = if message.is_empty() { format!("{reason:?}") } else { message };
            keep(&lost, GpuError::Lost { message });
        }
    }

    /// What `make` makes; its errors as a result, whatever handlers the device has.
    ///
    /// A browser reports errors later: a device that this crate opened returns them with the next call, that of a program passes
    /// them to the program's handlers.
    pub(crate) fn guarded<T>(&self, make: impl FnOnce() -> T) -> Result<T, GpuError> {
        if cfg!(target_family = "wasm") {
            return Ok(make());
        }
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let invalid = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make();
        let errors = block_on(async { Ok([invalid.pop().await, memory.pop().await]) })?;
        match errors.into_iter().flatten().next() {
            None => Ok(made),
            Some(error) => Err(from_wgpu(&error)),
        }
    }

    /// The device itself, for a program's own buffers, pipelines and encoders.
    #[must_use]
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// The queue of the device.
    #[must_use]
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// Properties of the adapter.
    #[must_use]
    pub fn info(&self) -> &AdapterInfo {
        &self.facts
    }

    /// Limits of the device.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Limits the total size of all buffers. For drivers that allocate more memory than exists, where the system would end the
    /// process.
    pub fn limit_memory(&self, n_bytes: u64) {
        self.memory.bound(n_bytes);
    }

    /// Whether the device supports timestamp queries.
    #[must_use]
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(Features::TIMESTAMP_QUERY)
    }

    /// Whether the device was opened with ray queries of the driver.
    #[must_use]
    pub fn has_ray_queries(&self) -> bool {
        self.device.features().contains(Features::EXPERIMENTAL_RAY_QUERY)
    }

    /// Reads pipelines that an earlier run compiled from a folder of the user, and writes them there when this value is dropped. The folder has a
    /// file for each model of device. A file that is damaged or of another driver is ignored, and written again.
    ///
    /// Returns whether the driver can give its pipelines away: those for Vulkan do. Others, and a program's own device without
    /// [`Features::PIPELINE_CACHE`], compile again in each run, unless their system keeps pipelines by itself.
    ///
    /// ```no_run
    /// # fn example() -> Result<(), canted_gpu::GpuError> {
    /// use canted_gpu::{Choice, Gpu, block_on};
    ///
    /// let mut gpu = block_on(Gpu::open(&Choice::Best))?;
    /// gpu.keep_pipelines(&std::env::temp_dir().join("pipelines"));
    /// # Ok(())
    /// # }
    /// ```
    pub fn keep_pipelines(&mut self, folder: &Path) -> bool {
        let opened = self.guarded(|| KeptPipelines::open(&self.device, folder));
        self.pipelines = opened.ok().flatten();
        self.pipelines.is_some()
    }

    /// What an earlier run compiled.
    pub(crate) fn pipeline_cache(&self) -> Option<&wgpu::PipelineCache> {
        self.pipelines.as_ref().map(|kept| &kept.cache)
    }

    /// Compiles kernel `name` with these choices; repeated calls return the same kernel.
    ///
    /// # Errors
    /// The kernel is invalid or exceeds the limits of the device.
    pub fn kernel(&self, name: ShaderName, chosen: &Variant) -> Result<Arc<Kernel>, GpuError> {
        let key = format!("{name} {chosen:?}");
        let kernels = || self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kernel) = kernels().get(&key) {
            return Ok(kernel.clone());
        }
        self.check()?;
        let is_checked = self.is_checked.load(Ordering::Relaxed);
        let cache = self.pipeline_cache();
        let make = || Kernel::new(&self.device, &self.limits, name, chosen, is_checked, cache);
        // Not while others wait for the lock, so that several threads compile at the same time.
        let kernel = Arc::new(self.guarded(make)??);
        self.check()?;
        Ok(kernels().entry(key).or_insert(kernel).clone())
    }

    /// Compiles several kernels at the same time, each on a thread of its own; in browsers one after another.
    ///
    /// # Errors
    /// As for [`Gpu::kernel`].
    #[cfg(not(target_family = "wasm"))]
    pub fn kernels(&self, wanted: &[(ShaderName, Variant)]) -> Result<Vec<Arc<Kernel>>, GpuError> {
        std::thread::scope(|scope| {
            let compile = |(name, chosen): &'_ (ShaderName, Variant)| self.kernel(*name, chosen);
            let threads: Vec<_> = wanted.iter().map(|wanted| scope.spawn(move || compile(wanted))).collect();
            let done = threads.into_iter().map(|thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic)));
            done.collect()
        })
    }

    /// Compiles several kernels.
    ///
    /// # Errors
    /// As for [`Gpu::kernel`].
    #[cfg(target_family = "wasm")]
    pub fn kernels(&self, wanted: &[(ShaderName, Variant)]) -> Result<Vec<Arc<Kernel>>, GpuError> {
        wanted.iter().map(|(name, chosen)| self.kernel(*name, chosen)).collect()
    }

    /// Returns the first error that the device reported since the last call.
    ///
    /// # Errors
    /// That error.
    pub fn check(&self) -> Result<(), GpuError> {
        let mut stored_error = self.stored_error.lock().unwrap_or_else(PoisonError::into_inner);
        match &*stored_error {
            None => Ok(()),
            // A lost device stays lost.
            Some(error @ GpuError::Lost { .. }) => Err(error.clone()),
            Some(_) => Err(stored_error.take().expect("matched")),
        }
    }

    /// Waits until the device has finished all submitted work.
    ///
    /// # Errors
    /// The device is lost or does not finish.
    pub async fn finish(&self) -> Result<(), GpuError> {
        // Buffer writes are executed with the next submission.
        let written = self.queue.submit([]);
        self.wait(written).await
    }

    /// Waits for a submission.
    #[cfg(not(target_family = "wasm"))]
    #[expect(clippy::unused_async, reason = "it waits in browsers")]
    pub(crate) async fn wait(&self, submission: SubmissionIndex) -> Result<(), GpuError> {
        self.timeout.wait(&self.device, submission, self.facts.kind)?;
        self.check()
    }

    /// Waits for all submissions so far. Browsers reset devices that hang.
    #[cfg(target_family = "wasm")]
    pub(crate) async fn wait(&self, _: SubmissionIndex) -> Result<(), GpuError> {
        let (done, finished) = crate::wait::slot();
        self.queue.on_submitted_work_done(move || done.send(()));
        finished.receive().await;
        self.check()
    }

    /// Compiles kernels with the checks of `wgpu` from now on, to compare their answers with those of kernels without them.
    #[doc(hidden)]
    pub fn check_all_kernels(&self) {
        self.is_checked.store(true, Ordering::Relaxed);
    }

    /// Simulates the loss of the device, to test error handling.
    #[doc(hidden)]
    pub fn lose(&self) {
        keep(&self.stored_error, GpuError::Lost { message: "destroyed by its owner".to_owned() });
        self.device.destroy();
    }
}

fn keep(stored_error: &Mutex<Option<GpuError>>, error: GpuError) {
    // The first error is the cause, but a device loss has priority.
    let mut kept = stored_error.lock().unwrap_or_else(PoisonError::into_inner);
    if kept.is_none() || matches!(error, GpuError::Lost { .. }) {
        *kept = Some(error);
    }
}

fn from_wgpu(error: &wgpu::Error) -> GpuError {
    match error {
        wgpu::Error::OutOfMemory { source } => GpuError::OutOfMemory { what: source.to_string() },
        error => GpuError::Invalid { message: error.to_string().replace('\n', " ") },
    }
}
