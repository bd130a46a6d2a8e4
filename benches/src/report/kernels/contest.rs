//! Tests that run in turn, round by round, each on all pairs of a case, and the error of an answer compared with exact fractions.

use canted_tests::exact::Piercing;

use crate::{
    report::samples::Samples,
    timing::{self, Contender},
};
pub(super) use canted_tests::extremes::triangle::Pair;

/// What a logarithmic axis shows for zero error.
pub(super) const LEAST_ULPS: f64 = 1e-3;

/// Boxes of a node.
pub(super) const LANES: usize = 8;

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
    let timings = timing::run(rounds, contenders.collect());
    let tested = |(test, timing): (Test<'_, A>, timing::Timing)| {
        #[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
        let to_ns = 1e9 / (repeats(test.n_tests) * test.n_tests.max(1)) as f64;
        Tested { name: test.name, answers: test.answers, ns: Samples::from(timing.seconds).scaled(to_ns) }
    };
    tests.into_iter().zip(timings).map(tested).collect()
}

/// `t`, `u`, `v` of a hit; unreported weights are NaN.
pub(super) type Answer = Option<[f32; 3]>;

/// Where the ray intersects the triangle's plane, and whether that point is in the triangle.
pub(super) struct ExactHit {
    piercing: Option<Piercing>,
    is_hit: bool,
}

impl ExactHit {
    pub(super) fn of((ray, corners): &Pair) -> Self {
        let piercing = Piercing::of(ray, *corners);
        let is_hit = piercing.as_ref().is_some_and(|piercing| piercing.is_hit(ray));
        Self { piercing, is_hit }
    }
}

/// The results of one kernel.
pub(super) struct Accuracy {
    /// Error of `t` of each true hit.
    pub(super) t_ulps: Samples,
    /// The greater error of `u` and `v` of each hit.
    pub(super) uv_ulps: Samples,
    /// Share of rays that only the kernel hits.
    pub(super) wrong_hits: f64,
    /// Share of rays that only the kernel misses.
    pub(super) wrong_misses: f64,
}

impl Accuracy {
    #[expect(clippy::cast_precision_loss, reason = "small counts")]
    pub(super) fn of(truths: &[ExactHit], answers: &[Answer]) -> Self {
        let (mut t, mut uv) = (vec![], vec![]);
        let (mut wrong_hits, mut wrong_misses) = (0usize, 0usize);
        for (truth, answer) in truths.iter().zip(answers) {
            match (truth.is_hit, answer) {
                (false, Some(_)) => wrong_hits += 1,
                (true, None) => wrong_misses += 1,
                (true, &Some([t_found, u, v])) => {
                    let Some(piercing) = &truth.piercing else { continue };
                    let has_weights = u.is_finite() && v.is_finite();
                    let [of_t, of_u, of_v] =
                        piercing.error_ulps(if has_weights { [t_found, u, v] } else { [t_found, 0.0, 0.0] });
                    t.push(of_t);
                    uv.extend(has_weights.then_some(of_u.max(of_v)));
                }
                (false, None) => {}
            }
        }
        let share = |count: usize| count as f64 / truths.len().max(1) as f64;
        let (wrong_hits, wrong_misses) = (share(wrong_hits), share(wrong_misses));
        Self { t_ulps: t.into(), uv_ulps: uv.into(), wrong_hits, wrong_misses }
    }
}

#[cfg(test)]
mod tests {
    use canted_trace::Ray;
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

    #[test]
    fn wrong_answers_and_errors_are_distinguished() {
        let corners = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 1.0]];
        let ray = |x: f32| Ray::new([x, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let truths: Vec<ExactHit> = [1.0, 1.0, 3.5, 3.5].map(|x| ExactHit::of(&(ray(x), corners))).into();
        let found = Accuracy::of(&truths, &[Some([1.0f32.next_up(), 0.25, 0.25]), None, Some([1.0, 0.9, 0.2]), None]);
        assert_eq!((found.wrong_hits, found.wrong_misses), (0.25, 0.25));
        assert_eq!((found.t_ulps.values(), found.uv_ulps.values()), (&[1.0][..], &[0.0][..]));
    }
}
