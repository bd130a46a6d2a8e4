//! The stages of a build with their times, if somebody asks: [`recorded`].
//!
//! A stage is timed on the thread that runs the build. The time in which that thread is in no loop of [`par`](crate::par) is *serial*: other
//! threads have nothing to do then, however many there are. Stages inside of each other do not count twice.

use std::{cell::RefCell, time::Instant};

/// Time of a stage of a build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// What is done.
    pub name: &'static str,
    /// Wall time, without the stages inside.
    pub seconds: f64,
    /// The part of it outside of parallel loops.
    pub serial_seconds: f64,
}

/// What is being recorded on a thread.
struct Recording {
    stages: Vec<Stage>,
    /// Indices of the stages that run, the outermost first.
    running: Vec<usize>,
    /// Start of the time that no stage has yet.
    since: Instant,
    /// Parallel loops that run, one inside of the other.
    n_loops: usize,
}

thread_local! {
    static RECORDING: RefCell<Option<Recording>> = const { RefCell::new(None) };
}

/// The result of `build`, and its stages in the order in which they began; stages of the same name are one.
///
/// ```
/// use canted_lbvh::stages;
/// let (sum, stages) = stages::recorded(|| stages::stage("sum", || (0..1000).sum::<u32>()));
/// assert_eq!((sum, stages[0].name), (499_500, "sum"));
/// assert!(stages[0].serial_seconds <= stages[0].seconds);
/// ```
pub fn recorded<T>(build: impl FnOnce() -> T) -> (T, Vec<Stage>) {
    let recording = Recording { stages: vec![], running: vec![], since: Instant::now(), n_loops: 0 };
    let outer = RECORDING.replace(Some(recording));
    let result = stage("the rest", build);
    let recording = RECORDING.replace(outer);
    let mut stages = recording.map_or_else(Vec::new, |recording| recording.stages);
    // What belongs to no stage is last.
    stages.rotate_left(1);
    (result, stages)
}

/// Calls `work` as a stage of the build that this thread records, if it does.
pub fn stage<T>(name: &'static str, work: impl FnOnce() -> T) -> T {
    let is_one = with_recording(|recording| recording.begin(name)) == Some(true);
    let result = work();
    if is_one {
        with_recording(|recording| {
            recording.add_time();
            recording.running.pop();
        });
    }
    result
}

/// Whether this thread records a build.
pub(crate) fn is_recording() -> bool {
    RECORDING.with_borrow(Option::is_some)
}

/// Calls `work`, which keeps several threads busy if `is_parallel`.
#[cfg(any(feature = "parallel", test))]
pub(crate) fn parallel<T>(is_parallel: bool, work: impl FnOnce() -> T) -> T {
    let n = usize::from(is_parallel);
    with_recording(|recording| {
        recording.add_time();
        recording.n_loops += n;
    });
    let result = work();
    with_recording(|recording| {
        recording.add_time();
        recording.n_loops -= n;
    });
    result
}

fn with_recording<T>(change: impl FnOnce(&mut Recording) -> T) -> Option<T> {
    RECORDING.with_borrow_mut(|recording| recording.as_mut().map(change))
}

impl Recording {
    /// Begins a stage; not inside of a loop, where a thread does parts of the work of all.
    fn begin(&mut self, name: &'static str) -> bool {
        if self.n_loops > 0 {
            return false;
        }
        self.add_time();
        let known = self.stages.iter().position(|stage| stage.name == name);
        self.running.push(known.unwrap_or(self.stages.len()));
        if known.is_none() {
            self.stages.push(Stage { name, seconds: 0.0, serial_seconds: 0.0 });
        }
        true
    }

    /// Adds the time since the last change to the innermost stage that runs.
    fn add_time(&mut self) {
        let now = Instant::now();
        let seconds = (now - self.since).as_secs_f64();
        self.since = now;
        if let Some(stage) = self.running.last().map(|&index| &mut self.stages[index]) {
            stage.seconds += seconds;
            if self.n_loops == 0 {
                stage.serial_seconds += seconds;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{thread::sleep, time::Duration};

    use super::*;

    const PAUSE: Duration = Duration::from_millis(20);

    #[test]
    fn loops_are_not_serial_and_inner_stages_count_once() {
        let ((), stages) = recorded(|| {
            sleep(PAUSE);
            stage("outer", || {
                stage("inner", || sleep(2 * PAUSE));
                parallel(true, || parallel(false, || stage("a part", || sleep(PAUSE))));
            });
            stage("outer", || sleep(PAUSE));
        });
        assert_eq!(stages.iter().map(|stage| stage.name).collect::<Vec<_>>(), ["outer", "inner", "the rest"]);
        let [outer, inner, rest] = stages[..] else { panic!("three stages") };
        let pause = PAUSE.as_secs_f64();
        assert!(outer.seconds >= 2.0 * pause && inner.seconds >= 2.0 * pause && rest.seconds >= pause);
        assert!(outer.serial_seconds >= pause && outer.seconds - outer.serial_seconds >= pause);
        assert_eq!([inner.seconds, rest.seconds], [inner.serial_seconds, rest.serial_seconds]);
    }

    #[test]
    fn nothing_is_recorded_unless_asked() {
        stage("unseen", || parallel(true, || assert!(!is_recording())));
        assert!(recorded(is_recording).0);
        assert!(!is_recording());
    }
}
