//! Sums of samples: bad ones, many, few, and in any order of parts.

use canted_renderer::Pixel;

use super::{Oracle, Promise, Row};

const fn promise(case: &'static str, promise: &'static str, bound: f64, unit: &'static str) -> Promise {
    Promise { station: "film", case, promise, oracle: Oracle::Known, bound, unit }
}

pub(super) fn rows() -> Vec<Row> {
    const BAD: Promise = promise("a sample NaN or infinite", "counted, and in no sum", 0.0, "samples told otherwise");
    const LONG: Promise = promise(
        "2^24 samples, then a million more",
        "no sum stalls",
        // A million and more additions of exact numbers below 2^53.
        0.0,
        "of the mean",
    );
    const FEW: Promise =
        promise("no sample, and one", "mean and variance are numbers, the error is unknown", 0.0, "that are not so");
    const NEAR: Promise = promise(
        "a million samples of 1e4, varying by 1e-3",
        "the variance of the mean is not negative and near the true one",
        // The squares sum to 1e14, whose f64 steps are 2^-6: relative to the true sum of squared differences, of about
        // 1, n roundings of the sum could be as much as 1; pairwise they are 40 · 2^-53 · 1e14 = 0.45.
        0.45,
        "relative error",
    );
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let wrong = bad.iter().filter(|&&x| {
        let pixel = Pixel::of([0.5; 3]) + Pixel::of([0.25, x, 0.25]);
        (pixel.n_samples, pixel.n_dropped) != (1, 1) || pixel.mean() != [0.5; 3]
    });
    let n_more: u32 = 1 << 20;
    let start = Pixel { sum: [16_777_216.0; 3], n_samples: 1 << 24, ..Pixel::default() };
    let long = (0..n_more).fold(start, |sum, _| sum + Pixel::of([1.0; 3]));
    let few = [Pixel::default(), Pixel::of([2.0, 0.0, -0.0]), Pixel { n_dropped: 1, ..Pixel::default() }];
    let is_wrong = |pixel: &&Pixel| {
        let numbers = [pixel.mean(), pixel.variance_of_mean()].concat();
        numbers.iter().any(|x| !x.is_finite()) || pixel.squared_error() != f64::INFINITY
    };
    vec![
        BAD.count("Pixel", bad.len(), wrong.count()),
        LONG.row("Pixel", n_more as usize, (long.mean()[0] - 1.0).abs()),
        FEW.count("Pixel", few.len(), few.iter().filter(is_wrong).count()),
        NEAR.row("Pixel, pairwise", 1 << 20, variance_error()),
    ]
}

/// Relative error of the variance of the mean of 2^20 samples of 1e4, half of them 2^-10 more; summed in halves.
fn variance_error() -> f64 {
    let step = 2.0f32.powi(-10);
    let mut sums: Vec<Pixel> =
        (0..1u32 << 20).map(|i| Pixel::of([1e4 + if i % 2 == 0 { step } else { 0.0 }; 3])).collect();
    while sums.len() > 1 {
        sums = sums.chunks(2).map(|pair| pair.iter().copied().reduce(|a, b| a + b).unwrap_or_default()).collect();
    }
    let n = f64::from(1u32 << 20);
    // Half a step from the mean, each of them.
    let truth = (0.5 * f64::from(step)).powi(2) / (n - 1.0);
    (sums[0].variance_of_mean()[0] / truth - 1.0).abs()
}
