//! An open device.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, OnceLock, PoisonError},
    time::{Duration, Instant},
};

use canted_shaders::MAX_STORAGE_BUFFERS;
use wgpu::{DeviceDescriptor, ExperimentalFeatures, Features, Limits, MemoryHints, PollType, SubmissionIndex, Trace};

use crate::kept::KeptBuffers;
use crate::memory::Memory;
use crate::traffic::Counters;
use crate::{AdapterInfo, AdapterKind, Choice, GpuError, Kernel, Specialisation, adapter};

/// Time after which a device counts as hung. A submission should take about 100 ms, and operating systems reset GPUs after
/// about 2 to 10 seconds.
const TIMEOUT: Duration = Duration::from_secs(60);

/// The same for software drivers, which no system resets. They share the processor with other programs, and the first
/// submission includes shader compilation.
const SOFTWARE_TIMEOUT: Duration = Duration::from_secs(600);

/// A wait may take this many times as long as the longest previous one. Dispatches grow at most fourfold, and the time per item
/// varies by about as much.
const MAX_GROWTH: u32 = 16;

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
    /// The longest successful wait.
    longest_wait: Mutex<Duration>,
    kernels: Mutex<HashMap<String, Arc<Kernel>>>,
    pub(crate) kept: Mutex<Option<KeptBuffers>>,
    pub(crate) counters: Counters,
    /// See [`crate::loop_check`].
    pub(crate) longest_loop: OnceLock<u32>,
}

impl Gpu {
    /// Opens an adapter.
    ///
    /// # Errors
    /// No matching adapter, or the adapter provides no device.
    pub fn open(choice: &Choice) -> Result<Self, GpuError> {
        Self::with_limits(choice, |limits| limits)
    }

    /// Opens an adapter with limits reduced by `lower`, to emulate weaker devices.
    ///
    /// # Errors
    /// As for [`Gpu::open`].
    pub fn with_limits(choice: &Choice, lower: impl FnOnce(Limits) -> Limits) -> Result<Self, GpuError> {
        let (adapter, facts) = adapter::choose(choice)?;
        // Default limits, raised only where the kernels need it. A device grants no more than was requested.
        let most = adapter.limits();
        let limits = lower(Limits {
            max_storage_buffer_binding_size: most.max_storage_buffer_binding_size,
            max_buffer_size: most.max_buffer_size,
            max_storage_buffers_per_shader_stage: most.max_storage_buffers_per_shader_stage.min(MAX_STORAGE_BUFFERS),
            max_compute_workgroup_storage_size: most.max_compute_workgroup_storage_size.min(32_768),
            max_color_attachment_bytes_per_sample: most.max_color_attachment_bytes_per_sample.min(64),
            ..Limits::defaults()
        });
        let (device, queue) = pollster::block_on(adapter.request_device(&DeviceDescriptor {
            label: Some("canted"),
            required_features: adapter.features() & Features::TIMESTAMP_QUERY,
            required_limits: limits.clone(),
            experimental_features: ExperimentalFeatures::disabled(),
            memory_hints: MemoryHints::Performance,
            trace: Trace::Off,
        }))
        .map_err(|error| GpuError::Refused { adapter: facts.name.clone(), message: error.to_string() })?;
        let stored_error = Arc::new(Mutex::new(None));
        let (late, lost) = (stored_error.clone(), stored_error.clone());
        // Without a handler, uncaptured errors panic.
        device.on_uncaptured_error(Arc::new(move |error| keep(&late, from_wgpu(&error))));
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                keep(&lost, GpuError::Lost { message });
            }
        });
        Ok(Self {
            facts,
            device,
            queue,
            limits,
            stored_error,
            memory: Memory::unbounded(),
            longest_wait: Mutex::default(),
            kernels: Mutex::default(),
            kept: Mutex::default(),
            counters: Counters::default(),
            longest_loop: OnceLock::new(),
        })
    }

    /// A program's own device and queue, of the version of `wgpu` that this crate re-exports.
    ///
    /// The program keeps its handlers: errors that are found when buffers and kernels are made are returned, others go to the handlers.
    /// For the loss of the device, see [`Gpu::lost_handler`].
    /// Kernels need as many storage buffers per stage as [`GpuError::Limit`] says; seven are enough to trace one level.
    ///
    /// ```no_run
    /// # fn example(device: wgpu::Device, queue: wgpu::Queue) -> Result<(), canted_gpu::GpuError> {
    /// use canted_gpu::{Gpu, TracedScene, build::BuildConfig};
    ///
    /// let gpu = Gpu::from_wgpu(device, queue);
    /// let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let scene = TracedScene::build_single_level(&gpu, &[triangle], &[0], BuildConfig::default())?;
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn from_wgpu(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let limits = device.limits();
        let facts = adapter::facts_of(device.adapter_info(), &limits, device.features());
        Self {
            facts,
            device,
            queue,
            limits,
            stored_error: Arc::default(),
            memory: Memory::unbounded(),
            longest_wait: Mutex::default(),
            kernels: Mutex::default(),
            kept: Mutex::default(),
            counters: Counters::default(),
            longest_loop: OnceLock::new(),
        }
    }

    /// A handler of lost devices, for [`wgpu::Device::set_device_lost_callback`] or to be called from a program's own one. After the
    /// device has reported its loss to it, every call returns [`GpuError::Lost`].
    ///
    /// [`Gpu::open`] sets one; a device of a program's own has the program's.
    pub fn lost_handler(&self) -> impl Fn(wgpu::DeviceLostReason, String) + Send + Sync + 'static {
        let lost = self.stored_error.clone();
        move |reason, message| {
            let message = if message.is_empty() { format!("{reason:?}") } else { message };
            keep(&lost, GpuError::Lost { message });
        }
    }

    /// What `make` makes; its errors as a result, whatever handlers the device has.
    pub(crate) fn guarded<T>(&self, make: impl FnOnce() -> T) -> Result<T, GpuError> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let invalid = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make();
        let errors = [pollster::block_on(invalid.pop()), pollster::block_on(memory.pop())];
        match errors.into_iter().flatten().next() {
            None => Ok(made),
            Some(error) => Err(from_wgpu(&error)),
        }
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

    /// Compiles kernel `name` with these choices; repeated calls return the same kernel.
    ///
    /// # Errors
    /// The kernel is invalid or exceeds the limits of the device.
    pub fn kernel(&self, name: &str, chosen: &Specialisation) -> Result<Arc<Kernel>, GpuError> {
        let key = format!("{name} {chosen:?}");
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kernel) = kernels.get(&key) {
            return Ok(kernel.clone());
        }
        self.check()?;
        let kernel = Arc::new(self.guarded(|| Kernel::new(&self.device, &self.limits, name, chosen))??);
        self.check()?;
        kernels.insert(key, kernel.clone());
        Ok(kernel)
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
    pub fn finish(&self) -> Result<(), GpuError> {
        // Buffer writes are executed with the next submission.
        let written = self.queue.submit([]);
        self.wait(Some(written))
    }

    /// Waits for a submission, or for all of them.
    pub(crate) fn wait(&self, submission: Option<SubmissionIndex>) -> Result<(), GpuError> {
        let longest = || self.longest_wait.lock().unwrap_or_else(PoisonError::into_inner);
        let timeout = timeout(self.facts.kind, *longest());
        let start = Instant::now();
        match self.device.poll(PollType::Wait { submission_index: submission, timeout: Some(timeout) }) {
            Ok(_) => {
                let mut longest = longest();
                *longest = start.elapsed().max(*longest);
                self.check()
            }
            Err(wgpu::PollError::Timeout) => Err(GpuError::TimedOut { seconds: timeout.as_secs() }),
            Err(error) => Err(GpuError::Invalid { message: error.to_string() }),
        }
    }

    /// Simulates the loss of the device, to test error handling.
    #[doc(hidden)]
    pub fn lose(&self) {
        keep(&self.stored_error, GpuError::Lost { message: "destroyed by its owner".to_owned() });
        self.device.destroy();
    }
}

/// How long to wait for a submission, given the longest previous wait.
fn timeout(kind: AdapterKind, longest: Duration) -> Duration {
    let least = if kind == AdapterKind::Software { SOFTWARE_TIMEOUT } else { TIMEOUT };
    least.max(MAX_GROWTH * longest)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timeout_grows_with_the_longest_wait() {
        let seconds = Duration::from_secs;
        assert_eq!(timeout(AdapterKind::Discrete, seconds(0)), seconds(60));
        assert_eq!(timeout(AdapterKind::Discrete, seconds(30)), seconds(480));
        assert_eq!(timeout(AdapterKind::Software, seconds(1)), seconds(600));
    }
}
