//! What threads of the CPU spend their time on while they render.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time of all threads of the CPU together, by stage.
#[derive(Debug, Default)]
pub struct StageTimes(Mutex<[Duration; 4]>);

impl StageTimes {
    /// The stages: camera rays without tracing them, traversal, surfaces with lights and scattering, and sums of samples.
    pub const STAGES: [&str; 4] = ["camera", "rays", "shading", "film"];

    /// Seconds of each of [`StageTimes::STAGES`].
    #[must_use]
    pub fn seconds(&self) -> [f64; 4] {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).map(|time| time.as_secs_f64())
    }

    pub(crate) fn add(&self, times: &Times) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        for (sum, time) in all.iter_mut().zip(times.sums) {
            *sum += time;
        }
    }
}

/// Time of one thread by stage. A stage ends where the next one begins, so that nothing is left out.
#[derive(Debug)]
pub(crate) struct Times {
    last: Instant,
    sums: [Duration; 4],
}

/// An index of [`StageTimes::STAGES`].
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stage {
    Camera,
    Rays,
    Shading,
    Film,
}

impl Times {
    /// From now on.
    pub(crate) fn new() -> Self {
        Self { last: Instant::now(), sums: [Duration::ZERO; 4] }
    }

    /// Everything since the last end belongs to this stage.
    pub(crate) fn end(&mut self, stage: Stage) {
        let now = Instant::now();
        self.sums[stage as usize] += now - self.last;
        self.last = now;
    }
}
