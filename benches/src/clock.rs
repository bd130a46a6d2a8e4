//! Wall-clock time and processor time.

use std::time::Instant;

use serde::Serialize;

/// Duration of some work, in seconds.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct Seconds {
    pub(crate) wall: f64,
    /// Processor time of this thread or of all threads, unaffected by other processes. Wall time where the system does
    /// not report it.
    pub(crate) cpu: f64,
}

/// Measures `work` on this thread.
pub(crate) fn time<T>(work: impl FnOnce() -> T) -> (T, Seconds) {
    measure(thread_seconds, work)
}

/// Measures `work` on all threads of this process.
pub(crate) fn time_all<T>(work: impl FnOnce() -> T) -> (T, Seconds) {
    measure(process_seconds, work)
}

fn measure<T>(processor: fn() -> Option<f64>, work: impl FnOnce() -> T) -> (T, Seconds) {
    let start = (Instant::now(), processor());
    let result = work();
    let (cpu_end, wall) = (processor(), start.0.elapsed().as_secs_f64());
    let cpu = start.1.zip(cpu_end).map_or(wall, |(start, end)| end - start);
    (result, Seconds { wall, cpu })
}

#[cfg(unix)]
fn thread_seconds() -> Option<f64> {
    Some(seconds_of(rustix::time::ClockId::ThreadCPUTime))
}

#[cfg(unix)]
fn process_seconds() -> Option<f64> {
    Some(seconds_of(rustix::time::ClockId::ProcessCPUTime))
}

#[cfg(unix)]
#[expect(clippy::cast_precision_loss, reason = "the seconds of a process's life fit 52 bits")]
fn seconds_of(clock: rustix::time::ClockId) -> f64 {
    let time = rustix::time::clock_gettime(clock);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

#[cfg(not(unix))]
fn thread_seconds() -> Option<f64> {
    None
}

#[cfg(not(unix))]
fn process_seconds() -> Option<f64> {
    None
}

#[cfg(test)]
mod tests {
    use std::{thread, time::Duration};

    use super::*;

    #[test]
    #[cfg(unix)]
    fn sleep_takes_wall_time_alone() {
        let pause = Duration::from_millis(60);
        let ((), seconds) = time(|| thread::sleep(pause));
        assert!(seconds.wall >= pause.as_secs_f64(), "{seconds:?}");
        assert!(seconds.cpu < 0.5 * seconds.wall, "{seconds:?}");
    }
}
