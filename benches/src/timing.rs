//! Wall-clock time and processor time, and timing of several contenders in one run, in turn, so that a machine's drift affects all
//! of them.

use std::{convert::Infallible, time::Instant};

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

/// A contender: its name and the measured work.
pub(crate) struct Contender<'a, T = ()> {
    pub(crate) name: String,
    pub(crate) work: Box<dyn FnMut() -> T + 'a>,
}

impl<'a, T> Contender<'a, T> {
    pub(crate) fn new(name: impl Into<String>, work: impl FnMut() -> T + 'a) -> Self {
        Self { name: name.into(), work: Box::new(work) }
    }
}

/// The times of one contender.
pub(crate) struct Timing {
    pub(crate) name: String,
    /// Seconds of each round.
    pub(crate) seconds: Vec<f64>,
    /// Median over rounds of the first contender's time over this one's in the same round: above 1 is faster.
    pub(crate) speed_ratio: f64,
}

impl Timing {
    pub(crate) fn median(&self) -> f64 {
        median(&self.seconds)
    }

    /// Half the distance between the slowest and the fastest round, over the median.
    pub(crate) fn spread(&self) -> f64 {
        spread(&self.seconds)
    }
}

pub(crate) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    if n == 0 { f64::NAN } else { 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]) }
}

/// The least and the greatest.
pub(crate) fn range(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &x| [low.min(x), high.max(x)])
}

/// Half the distance between least and greatest, over the median.
pub(crate) fn spread(values: &[f64]) -> f64 {
    let [low, high] = range(values);
    0.5 * (high - low) / median(values).abs()
}

/// One warm-up, then `rounds` rounds in which every contender runs once, in turn.
pub(crate) fn run<'a>(rounds: usize, contenders: Vec<Contender<'a>>) -> Vec<Timing> {
    let never_fails = |Contender { name, mut work }: Contender<'a>| {
        Contender::new(name, move || -> Result<(), Infallible> {
            work();
            Ok(())
        })
    };
    let Ok(timings) = try_run(rounds, contenders.into_iter().map(never_fails).collect());
    timings
}

/// As [`run`], for work that may fail: the first failure ends it.
pub(crate) fn try_run<E>(rounds: usize, mut contenders: Vec<Contender<'_, Result<(), E>>>) -> Result<Vec<Timing>, E> {
    let mut seconds = vec![Vec::with_capacity(rounds); contenders.len()];
    for round in 0..=rounds {
        for (contender, seconds) in contenders.iter_mut().zip(&mut seconds) {
            let start = Instant::now();
            (contender.work)()?;
            let elapsed = start.elapsed().as_secs_f64();
            if round > 0 {
                seconds.push(elapsed);
            }
        }
    }
    let first = seconds[0].clone();
    let timing = |(contender, seconds): (Contender<'_, _>, Vec<f64>)| {
        let speed_ratio = ratio(&first, &seconds);
        Timing { name: contender.name, seconds, speed_ratio }
    };
    Ok(contenders.into_iter().zip(seconds).map(timing).collect())
}

/// Median over rounds of one contender's time over another's in the same round.
pub(crate) fn ratio(of: &[f64], over: &[f64]) -> f64 {
    median(&of.iter().zip(over).map(|(a, b)| a / b).collect::<Vec<_>>())
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

    #[test]
    fn contenders_run_in_turn_until_one_fails() {
        let log = std::cell::RefCell::new(String::new());
        let append = |word: &'static str| {
            let log = &log;
            Contender::new(word, move || {
                log.borrow_mut().push_str(word);
                if log.borrow().len() < 5 { Ok(()) } else { Err("tired") }
            })
        };
        let timings = try_run(1, vec![append("a"), append("b")]);
        assert!(timings.is_ok_and(|timings| timings.len() == 2 && timings.iter().all(|t| t.seconds.len() == 1)));
        assert_eq!(*log.borrow(), "abab");
        assert_eq!(try_run(1, vec![append("c"), append("d")]).err(), Some("tired"));
        assert_eq!(*log.borrow(), "ababc");
    }

    #[test]
    fn ratios_are_of_the_same_round() {
        // The machine slows down tenfold; the second stays twice as fast.
        assert_eq!(ratio(&[1.0, 10.0, 5.0], &[0.5, 5.0, 2.5]), 2.0);
        assert_eq!((median(&[3.0, 1.0]), median(&[5.0, 1.0, 2.0])), (2.0, 2.0));
    }
}
