//! What threads of the CPU spend their time on while they render.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time of all threads of the CPU together, by stage.
#[derive(Debug, Default)]
pub struct StageTimes(Mutex<[Duration; 4]>);

impl StageTimes {
    /// The stages: camera rays without tracing them, traversal, surfaces with lights and scattering, and sums of samples with all that
    /// receives
    /// finished tiles.
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

/// Time of one thread by stage. A stage ends where the next one begins, so the sum is all of the time until the last end.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_moment_belongs_to_the_stage_that_ends_next() {
        let all = StageTimes::default();
        let start = Instant::now();
        let mut times = Times::new();
        for (stage, milliseconds) in [(Stage::Rays, 4), (Stage::Shading, 2), (Stage::Camera, 0), (Stage::Rays, 4)] {
            std::thread::sleep(Duration::from_millis(milliseconds));
            times.end(stage);
        }
        let elapsed = start.elapsed().as_secs_f64();
        all.add(&times);
        let [camera, rays, shading, film] = all.seconds();
        assert!(rays >= 0.008 && shading >= 0.002 && film == 0.0, "{rays} {shading} {film}");
        // What is between the two clocks is a few instructions, unless another process runs.
        let sum = camera + rays + shading;
        assert!(sum <= elapsed && sum >= 0.010, "{sum} of {elapsed}");
        all.add(&times);
        assert_eq!(all.seconds(), [camera, rays, shading, film].map(|seconds| 2.0 * seconds));
    }
}
