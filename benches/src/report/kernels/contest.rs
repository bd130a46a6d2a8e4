//! Tests that run in turn, round by round, each on all pairs of a case.

use super::super::samples::Samples;
use crate::interleave::{self, Contender};

/// Minimum tests per round: a few hundred take microseconds, close to the clock's resolution.
const LEAST_TESTS: usize = 20_000;

/// A method that tests all pairs of a case.
pub(super) struct Test<'a, A> {
    pub(super) name: String,
    /// The answer for each pair.
    pub(super) answers: Vec<A>,
    /// The timed repetition of the tests.
    pub(super) work: Box<dyn Fn() + 'a>,
    /// Number of tests in `work`.
    pub(super) n_tests: usize,
}

/// A timed method.
pub(super) struct Tested<A> {
    pub(super) name: String,
    pub(super) answers: Vec<A>,
    /// Nanoseconds per test.
    pub(super) ns: Samples,
}

/// Times all after a warm-up, in turn.
pub(super) fn run<A>(tests: Vec<Test<'_, A>>, rounds: usize) -> Vec<Tested<A>> {
    let repeats = |n_tests: usize| LEAST_TESTS.div_ceil(n_tests.max(1));
    let contenders = tests.iter().map(|test| {
        let n = repeats(test.n_tests);
        Contender::new(&*test.name, move || (0..n).for_each(|_| (test.work)()))
    });
    let timings = interleave::run(rounds, contenders.collect());
    let tested = |(test, timing): (Test<'_, A>, interleave::Timing)| {
        #[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
        let to_ns = 1e9 / (repeats(test.n_tests) * test.n_tests.max(1)) as f64;
        Tested { name: test.name, answers: test.answers, ns: Samples::from(timing.seconds).scaled(to_ns) }
    };
    tests.into_iter().zip(timings).map(tested).collect()
}

#[cfg(test)]
mod tests {
    use std::{cell::Cell, thread, time::Duration};

    use super::*;

    #[test]
    fn times_are_of_one_test() {
        let n_runs = Cell::new(0);
        let pause = Duration::from_millis(2);
        let work = || {
            n_runs.set(n_runs.get() + 1);
            thread::sleep(pause);
        };
        let test = Test { name: "a".to_owned(), answers: vec![7], work: Box::new(work), n_tests: LEAST_TESTS / 2 };
        let tested = run(vec![test], 3);
        // Twice per round, and a round before the first.
        assert_eq!((n_runs.get(), &tested[0].answers[..], tested[0].ns.values().len()), (8, &[7][..], 3));
        #[expect(clippy::cast_precision_loss, reason = "a small number")]
        let least = 2.0 * pause.as_secs_f64() * 1e9 / LEAST_TESTS as f64;
        assert!(tested[0].ns.range()[0] >= least, "{:?} {least}", tested[0].ns);
    }
}
