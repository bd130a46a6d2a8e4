use crate::Picture;

/// The samples of one pixel, summed in `f64` in the order of their numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Sum of linear RGB.
    pub sum: [f64; 3],
    /// Sum of the squares of linear RGB.
    pub sum_of_squares: [f64; 3],
    /// Samples in the sums.
    pub n_samples: u32,
    /// Samples that were not finite: counted, in no sum.
    pub n_dropped: u32,
}

impl Pixel {
    /// Adds a sample, or counts it as dropped where a channel is infinite or not a number.
    pub fn add(&mut self, radiance: [f32; 3]) {
        if !radiance.iter().all(|x| x.is_finite()) {
            self.n_dropped += 1;
            return;
        }
        self.n_samples += 1;
        for (k, x) in radiance.map(f64::from).into_iter().enumerate() {
            self.sum[k] += x;
            self.sum_of_squares[k] += x * x;
        }
    }

    /// Mean of the finite samples; black where there is none.
    #[must_use]
    pub fn mean(&self) -> [f64; 3] {
        let n = f64::from(self.n_samples.max(1));
        self.sum.map(|sum| sum / n)
    }

    /// Variance of the mean of independent samples, unbiased; zero where fewer than two samples say nothing about it.
    ///
    /// Stratified samples vary less than this estimate says.
    #[must_use]
    pub fn variance_of_mean(&self) -> [f64; 3] {
        if self.n_samples < 2 {
            return [0.0; 3];
        }
        let n = f64::from(self.n_samples);
        std::array::from_fn(|k| {
            let squares = self.sum_of_squares[k] - self.sum[k] * self.sum[k] / n;
            squares.max(0.0) / (n * (n - 1.0))
        })
    }
}

/// The pixels of a picture while and after its samples are summed, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    pixels: Vec<Pixel>,
    n_rays: u64,
}

impl Film {
    pub(crate) fn new(width: u32, height: u32) -> Self {
        Self { width, height, pixels: vec![Pixel::default(); width as usize * height as usize], n_rays: 0 }
    }

    /// Puts a finished run of pixels at column `x` of row `y`.
    pub(crate) fn put(&mut self, x: u32, y: u32, run: &[Pixel]) {
        let first = y as usize * self.width as usize + x as usize;
        self.pixels[first..first + run.len()].copy_from_slice(run);
    }

    pub(crate) fn count_rays(&mut self, n: u64) {
        self.n_rays += n;
    }

    /// Pixels in a row.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All pixels, row by row.
    #[must_use]
    pub fn pixels(&self) -> &[Pixel] {
        &self.pixels
    }

    /// Samples that were not finite.
    #[must_use]
    pub fn n_dropped(&self) -> u64 {
        self.pixels.iter().map(|pixel| u64::from(pixel.n_dropped)).sum()
    }

    /// Rays traced, shadow rays included.
    #[must_use]
    pub fn n_rays(&self) -> u64 {
        self.n_rays
    }

    /// The means, rounded to `f32`.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "a mean of f32 values lies in their range")]
    pub fn picture(&self) -> Picture {
        let pixels = self.pixels.iter().map(|pixel| pixel.mean().map(|x| x as f32)).collect();
        Picture { width: self.width, height: self.height, pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_variances_of_few_samples() {
        let mut pixel = Pixel::default();
        assert_eq!(pixel.mean(), [0.0; 3]);
        assert_eq!(pixel.variance_of_mean(), [0.0; 3]);
        pixel.add([1.0, 2.0, 4.0]);
        assert_eq!(pixel.mean(), [1.0, 2.0, 4.0]);
        assert_eq!(pixel.variance_of_mean(), [0.0; 3]);
        pixel.add([3.0, 2.0, 8.0]);
        // Two samples a and b: the variance of their mean is ((a - b) / 2)².
        assert_eq!(pixel.mean(), [2.0, 2.0, 6.0]);
        assert_eq!(pixel.variance_of_mean(), [1.0, 0.0, 4.0]);
    }

    #[test]
    fn long_sums_do_not_stall() {
        // An f32 sum of ones would stop at 2^24; this one starts there.
        let mut pixel = Pixel { sum: [16_777_216.0; 3], n_samples: 16_777_216, ..Pixel::default() };
        for _ in 0..1000 {
            pixel.add([1.0; 3]);
        }
        assert_eq!(pixel.sum, [16_778_216.0; 3]);
        assert_eq!(pixel.mean(), [1.0; 3]);
    }

    #[test]
    fn what_is_not_finite_is_counted_and_left_out() {
        let mut pixel = Pixel::default();
        pixel.add([0.5; 3]);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            pixel.add([0.25, bad, 0.25]);
        }
        assert_eq!((pixel.n_samples, pixel.n_dropped), (1, 3));
        assert_eq!(pixel.mean(), [0.5; 3]);
    }
}
