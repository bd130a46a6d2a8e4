//! An open device.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant},
};

use canted_shaders::MAX_STORAGE_BUFFERS;
use wgpu::{DeviceDescriptor, ExperimentalFeatures, Features, Limits, MemoryHints, PollType, SubmissionIndex, Trace};

use crate::memory::Memory;
use crate::{AdapterInfo, AdapterKind, Choice, GpuError, Kernel, Specialisation, adapter};

/// Longest wait for a submission, which should take about 100 ms: beyond this the device hangs. Systems that watch over GPUs reset
/// them after some 2 to 10 seconds.
const PATIENCE: Duration = Duration::from_secs(60);

/// The same of software drivers, which nobody watches over. They hang only in loops without end, and kernels have none; but they
/// share processors with all that runs there, and the first wait holds a compiler's second too: of a processor shared by a hundred
/// that is minutes.
const PATIENCE_WITH_SOFTWARE: Duration = Duration::from_secs(600);

/// How many times as long as the longest wait before it one may be: dispatches grow fourfold at most, and work of the same kind is
/// no more than that apart again.
const MOST_GROWTH: u32 = 16;

/// An open device with its queue, and the kernels compiled on it.
///
/// Errors that the driver reports late are kept and returned by the next call that can fail.
pub struct Gpu {
    facts: AdapterInfo,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    limits: Limits,
    trouble: Arc<Mutex<Option<GpuError>>>,
    pub(crate) memory: Memory,
    /// The longest wait that ended well.
    longest_wait: Mutex<Duration>,
    kernels: Mutex<HashMap<String, Arc<Kernel>>>,
}

impl Gpu {
    /// Opens the chosen adapter.
    ///
    /// # Errors
    /// No such adapter, or one that gives no device.
    pub fn open(choice: &Choice) -> Result<Self, GpuError> {
        Self::with_limits(choice, |limits| limits)
    }

    /// Opens the chosen adapter with limits that `lower` lowers: to see what weaker devices would do.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn with_limits(choice: &Choice, lower: impl FnOnce(Limits) -> Limits) -> Result<Self, GpuError> {
        let (adapter, facts) = adapter::choose(choice)?;
        // What every device has, raised only where our kernels need it: a device takes no more than was asked for.
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
        let trouble = Arc::new(Mutex::new(None));
        let (late, lost) = (trouble.clone(), trouble.clone());
        // Without a handler errors outside a scope panic.
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
            trouble,
            memory: Memory::unbounded(),
            longest_wait: Mutex::default(),
            kernels: Mutex::default(),
        })
    }

    /// What the adapter is.
    #[must_use]
    pub fn info(&self) -> &AdapterInfo {
        &self.facts
    }

    /// What the device allows.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Refuses buffers that together with those that there are take more than this: for drivers that give more than there is, and
    /// leave it to the system to end the process.
    pub fn limit_memory(&self, n_bytes: u64) {
        self.memory.bound(n_bytes);
    }

    /// Whether passes can be timed.
    #[must_use]
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(Features::TIMESTAMP_QUERY)
    }

    /// Kernel `name` as `chosen`, compiled once.
    ///
    /// # Errors
    /// A kernel that is not valid, or that the device's limits do not allow.
    pub fn kernel(&self, name: &str, chosen: &Specialisation) -> Result<Arc<Kernel>, GpuError> {
        let key = format!("{name} {chosen:?}");
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kernel) = kernels.get(&key) {
            return Ok(kernel.clone());
        }
        let kernel = Arc::new(Kernel::new(self, name, chosen)?);
        kernels.insert(key, kernel.clone());
        Ok(kernel)
    }

    /// The first error that the device reported since the last call, if any.
    ///
    /// # Errors
    /// That error.
    pub fn check(&self) -> Result<(), GpuError> {
        let mut trouble = self.trouble.lock().unwrap_or_else(PoisonError::into_inner);
        match &*trouble {
            None => Ok(()),
            // A lost device stays lost.
            Some(error @ GpuError::Lost { .. }) => Err(error.clone()),
            Some(_) => Err(trouble.take().expect("matched")),
        }
    }

    /// Waits until the device has done all that was submitted.
    ///
    /// # Errors
    /// A device that is lost, or does not finish.
    pub fn finish(&self) -> Result<(), GpuError> {
        // What is written to buffers goes with the next submission.
        let written = self.queue.submit([]);
        self.wait(Some(written))
    }

    /// Waits until the device has done a submission, or all of them.
    pub(crate) fn wait(&self, submission: Option<SubmissionIndex>) -> Result<(), GpuError> {
        let longest = || self.longest_wait.lock().unwrap_or_else(PoisonError::into_inner);
        let patience = patience(self.facts.kind, *longest());
        let start = Instant::now();
        match self.device.poll(PollType::Wait { submission_index: submission, timeout: Some(patience) }) {
            Ok(_) => {
                let mut longest = longest();
                *longest = start.elapsed().max(*longest);
                self.check()
            }
            Err(wgpu::PollError::Timeout) => Err(GpuError::TimedOut { seconds: patience.as_secs() }),
            Err(error) => Err(GpuError::Invalid { message: error.to_string() }),
        }
    }

    /// Loses the device as a driver would, to see what becomes of its callers.
    #[doc(hidden)]
    pub fn lose(&self) {
        keep(&self.trouble, GpuError::Lost { message: "destroyed by its owner".to_owned() });
        self.device.destroy();
    }
}

/// How long a device may take for a submission, after others that took `longest` at most.
fn patience(kind: AdapterKind, longest: Duration) -> Duration {
    let least = if kind == AdapterKind::Software { PATIENCE_WITH_SOFTWARE } else { PATIENCE };
    least.max(MOST_GROWTH * longest)
}

fn keep(trouble: &Mutex<Option<GpuError>>, error: GpuError) {
    // The first error is the cause; a loss outweighs what followed from it.
    let mut kept = trouble.lock().unwrap_or_else(PoisonError::into_inner);
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
    fn patience_grows_with_what_a_device_has_taken() {
        let seconds = Duration::from_secs;
        assert_eq!(patience(AdapterKind::Discrete, seconds(0)), seconds(60));
        assert_eq!(patience(AdapterKind::Discrete, seconds(30)), seconds(480));
        assert_eq!(patience(AdapterKind::Software, seconds(1)), seconds(600));
    }
}
