use std::ops::Add;

use crate::compare::REL_MSE_FLOOR;
use crate::srgb::luminance;

/// Sample sums of one pixel in `f64`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Sum of linear RGB, minus that of samples with negative weight.
    pub sum: [f64; 3],
    /// Sum of the squares of linear RGB.
    pub sum_of_squares: [f64; 3],
    /// Samples in the sums.
    pub n_samples: u32,
    /// Samples in the sums with negative weight.
    pub n_negative: u32,
    /// Samples that were dropped because they were not finite.
    pub n_dropped: u32,
}

impl Pixel {
    /// One sample, which is dropped if a channel is not finite.
    #[must_use]
    pub fn of(radiance: [f32; 3]) -> Self {
        if !radiance.iter().all(|x| x.is_finite()) {
            return Self { n_dropped: 1, ..Self::default() };
        }
        let sum = radiance.map(f64::from);
        Self { sum, sum_of_squares: sum.map(|x| x * x), n_samples: 1, ..Self::default() }
    }

    /// One sample with a weight of 1 or -1.
    #[must_use]
    pub fn weighted(radiance: [f32; 3], weight: f32) -> Self {
        let sample = Self::of(radiance);
        if weight >= 0.0 {
            return sample;
        }
        Self { sum: sample.sum.map(|x| -x), n_negative: sample.n_samples, ..sample }
    }

    /// Samples that were summed elsewhere: their sum, minus that of samples with negative weight, and the sum of squared deviations of
    /// these terms from their mean. The numbers are those of [`Pixel::n_samples`], [`Pixel::n_negative`] and [`Pixel::n_dropped`].
    #[must_use]
    pub fn of_sums(sum: [f64; 3], squared_deviations: [f64; 3], [n_samples, n_negative, n_dropped]: [u32; 3]) -> Self {
        let n = f64::from(n_samples.max(1));
        let sum_of_squares = std::array::from_fn(|k| squared_deviations[k] + sum[k] * sum[k] / n);
        Self { sum, sum_of_squares, n_samples, n_negative, n_dropped }
    }

    /// Samples taken, including dropped ones.
    #[must_use]
    pub fn n_taken(&self) -> u32 {
        self.n_samples + self.n_dropped
    }

    /// Weighted mean of the finite samples; black without samples.
    #[must_use]
    pub fn mean(&self) -> [f64; 3] {
        let weight = self.weight();
        self.sum.map(|sum| sum / weight)
    }

    /// The mean in `f32`.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "a mean of f32 values lies in their range")]
    pub(crate) fn rounded_mean(&self) -> [f32; 3] {
        self.mean().map(|x| x as f32)
    }

    /// Sum of the weights; 1 where the sum is zero.
    fn weight(&self) -> f64 {
        let weight = f64::from(self.n_samples) - 2.0 * f64::from(self.n_negative);
        if weight == 0.0 { 1.0 } else { weight }
    }

    /// Unbiased variance of the mean of independent samples; zero for fewer than two samples.
    ///
    /// It overestimates the variance of stratified samples, and of samples with negative weights, because it treats the sum of
    /// weights as a constant.
    #[must_use]
    pub fn variance_of_mean(&self) -> [f64; 3] {
        if self.n_samples < 2 {
            return [0.0; 3];
        }
        let n = f64::from(self.n_samples);
        let by_weight = (n / self.weight()).powi(2);
        std::array::from_fn(|k| {
            let squares = self.sum_of_squares[k] - self.sum[k] * self.sum[k] / n;
            squares.max(0.0) / (n * (n - 1.0)) * by_weight
        })
    }

    /// Square of the relative standard error of the mean luminance, `s² / (Y² + ε)`, with `ε` = [`REL_MSE_FLOOR`].
    ///
    /// The floor makes the error of pixels darker than a tenth of white absolute. `s` is the weighted sum of the channels'
    /// standard errors, which is an upper bound of that of the luminance (Cauchy-Schwarz). Infinite for fewer than two samples.
    #[must_use]
    pub fn squared_error(&self) -> f64 {
        if self.n_samples < 2 {
            return f64::INFINITY;
        }
        let error = luminance(self.variance_of_mean().map(f64::sqrt));
        let mean = luminance(self.mean());
        error * error / (mean * mean + REL_MSE_FLOOR)
    }
}

impl Add for Pixel {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            sum: std::array::from_fn(|k| self.sum[k] + other.sum[k]),
            sum_of_squares: std::array::from_fn(|k| self.sum_of_squares[k] + other.sum_of_squares[k]),
            n_samples: self.n_samples + other.n_samples,
            n_negative: self.n_negative + other.n_negative,
            n_dropped: self.n_dropped + other.n_dropped,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_variances_of_few_samples() {
        let pixel = Pixel::default();
        assert_eq!(pixel.mean(), [0.0; 3]);
        assert_eq!(pixel.variance_of_mean(), [0.0; 3]);
        let pixel = Pixel::of([1.0, 2.0, 4.0]);
        assert_eq!(pixel.mean(), [1.0, 2.0, 4.0]);
        assert_eq!(pixel.variance_of_mean(), [0.0; 3]);
        let pixel = pixel + Pixel::of([3.0, 2.0, 8.0]);
        // Two samples a and b: the variance of their mean is ((a - b) / 2)².
        assert_eq!(pixel.mean(), [2.0, 2.0, 6.0]);
        assert_eq!(pixel.variance_of_mean(), [1.0, 0.0, 4.0]);
    }

    #[test]
    fn negative_weights_are_subtracted() {
        let sample = |x: f32, weight: f32| Pixel::weighted([x; 3], weight);
        let pixel = sample(2.0, 1.0) + sample(3.0, 1.0) + sample(1.0, -1.0);
        assert_eq!((pixel.n_samples, pixel.n_negative, pixel.mean()), (3, 1, [4.0; 3]));
        assert_eq!(sample(2.0, -1.0).mean(), [2.0; 3]);
        // The sum of the weights is zero.
        assert_eq!((sample(2.0, -1.0) + sample(2.0, 1.0)).mean(), [0.0; 3]);
        let lost = sample(f32::NAN, -1.0);
        assert_eq!((lost.n_samples, lost.n_negative, lost.n_dropped), (0, 0, 1));
        // Equal samples vary by their weights.
        assert!((sample(1.0, 1.0) + sample(1.0, 1.0) + sample(1.0, -1.0)).squared_error() > 0.0);
    }

    #[test]
    fn samples_summed_elsewhere_are_those_of_one_after_the_other() {
        let sample = |x: f32, weight: f32| Pixel::weighted([x, 2.0 * x, 0.0], weight);
        let each =
            sample(1.0, 1.0) + sample(3.0, 1.0) + sample(2.0, -1.0) + Pixel::of([f32::NAN; 3]) + sample(6.0, 1.0);
        // The terms 1, 3, -2 and 6 have the mean 2 and deviate by 1, 1, 4 and 4.
        assert_eq!(Pixel::of_sums([8.0, 16.0, 0.0], [34.0, 136.0, 0.0], [4, 1, 1]), each);
        assert_eq!(Pixel::of_sums([0.0; 3], [0.0; 3], [0, 0, 1]), Pixel::of([f32::NAN; 3]));
    }

    #[test]
    fn the_error_of_gray_samples_is_that_of_their_luminance() {
        let pixel = Pixel::of([0.5; 3]) + Pixel::of([1.5; 3]);
        // Mean 1, standard error 1/2; the luminance weights sum to one but for rounding.
        assert!((pixel.squared_error() - 0.25 / (1.0 + REL_MSE_FLOOR)).abs() < 1e-15);
        let black = Pixel::of([0.0; 3]) + Pixel::of([0.0; 3]);
        assert_eq!(black.squared_error(), 0.0);
        assert_eq!(Pixel::of([0.5; 3]).squared_error(), f64::INFINITY, "one sample has no estimate");
    }

    #[test]
    fn long_sums_keep_growing() {
        // An f32 sum of ones stops at 2^24.
        let start = Pixel { sum: [16_777_216.0; 3], n_samples: 16_777_216, ..Pixel::default() };
        let pixel = (0..1000).fold(start, |pixel, _| pixel + Pixel::of([1.0; 3]));
        assert_eq!(pixel.sum, [16_778_216.0; 3]);
        assert_eq!(pixel.mean(), [1.0; 3]);
    }

    #[test]
    fn samples_that_are_not_finite_are_counted_and_dropped() {
        let mut pixel = Pixel::of([0.5; 3]);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            pixel = pixel + Pixel::of([0.25, bad, 0.25]);
        }
        assert_eq!((pixel.n_samples, pixel.n_dropped, pixel.n_taken()), (1, 3, 4));
        assert_eq!(pixel.mean(), [0.5; 3]);
    }
}
