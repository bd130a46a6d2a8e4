//! How long a program waits for a device. Browsers decide themselves.

use std::{
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use wgpu::{PollError, PollType, SubmissionIndex};

use crate::GpuError;
use crate::adapter::AdapterKind;

/// Time after which a device counts as hung. A submission should take about 100 ms, and operating systems reset GPUs after
/// about 2 to 10 seconds.
const TIMEOUT: Duration = Duration::from_secs(60);

/// The same for software drivers, which no system resets. They share the processor with other programs, and the first
/// submission includes shader compilation.
const SOFTWARE_TIMEOUT: Duration = Duration::from_secs(600);

/// A wait may take this many times as long as the longest previous one. Dispatches grow at most fourfold, and the time per item
/// varies by about as much.
const MAX_GROWTH: u32 = 16;

/// The longest successful wait for a device so far.
#[derive(Default)]
pub(crate) struct AdaptiveTimeout(Mutex<Duration>);

impl AdaptiveTimeout {
    /// Waits for a submission.
    ///
    /// # Errors
    /// The device does not finish in time.
    pub(crate) fn wait(
        &self,
        device: &wgpu::Device,
        submission: SubmissionIndex,
        kind: AdapterKind,
    ) -> Result<(), GpuError> {
        let longest = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let timeout = timeout(kind, *longest());
        let start = Instant::now();
        match device.poll(PollType::Wait { submission_index: Some(submission), timeout: Some(timeout) }) {
            Ok(_) => {
                let mut longest = longest();
                *longest = start.elapsed().max(*longest);
                Ok(())
            }
            Err(PollError::Timeout) => Err(GpuError::TimedOut { seconds: timeout.as_secs() }),
            Err(error) => Err(GpuError::Invalid { message: error.to_string() }),
        }
    }
}

/// How long to wait for a submission, given the longest previous wait.
fn timeout(kind: AdapterKind, longest: Duration) -> Duration {
    let least = if kind == AdapterKind::Software { SOFTWARE_TIMEOUT } else { TIMEOUT };
    least.max(MAX_GROWTH * longest)
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
