//! Timing of several contenders in one run, in turn, so that a machine's drift falls on all of them.

use std::time::Instant;

/// A contender: its name, and one measured piece of work.
pub(crate) struct Contender<'a> {
    pub(crate) name: String,
    pub(crate) work: Box<dyn FnMut() + 'a>,
}

impl<'a> Contender<'a> {
    pub(crate) fn new(name: impl Into<String>, work: impl FnMut() + 'a) -> Self {
        Self { name: name.into(), work: Box::new(work) }
    }
}

/// What one contender took.
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
        let (least, greatest) =
            self.seconds.iter().fold((f64::MAX, 0.0f64), |(least, greatest), &s| (least.min(s), greatest.max(s)));
        0.5 * (greatest - least) / self.median()
    }
}

pub(crate) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    if n == 0 { f64::NAN } else { 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]) }
}

/// One warm-up, then `rounds` rounds in which every contender works once, in turn.
pub(crate) fn run(rounds: usize, mut contenders: Vec<Contender<'_>>) -> Vec<Timing> {
    let mut seconds = vec![Vec::with_capacity(rounds); contenders.len()];
    for round in 0..=rounds {
        for (contender, seconds) in contenders.iter_mut().zip(&mut seconds) {
            let start = Instant::now();
            (contender.work)();
            let elapsed = start.elapsed().as_secs_f64();
            if round > 0 {
                seconds.push(elapsed);
            }
        }
    }
    let first = seconds[0].clone();
    contenders
        .into_iter()
        .zip(seconds)
        .map(|(contender, seconds)| {
            let ratios: Vec<f64> = first.iter().zip(&seconds).map(|(a, b)| a / b).collect();
            Timing { name: contender.name, seconds, speed_ratio: median(&ratios) }
        })
        .collect()
}
