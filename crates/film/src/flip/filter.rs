//! Separable filters; borders repeat the outermost pixel.

use rayon::prelude::*;

use super::Plane;

/// The weights of each channel at integer distances from `-radius` to `radius`.
pub(super) struct Taps<const N: usize> {
    radius: usize,
    weights: Vec<[f64; N]>,
}

impl<const N: usize> Taps<N> {
    /// Weights by distance in pixels.
    pub(super) fn new(radius: usize, weight: impl Fn(f64) -> [f64; N]) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "a radius of few pixels")]
        let distance = |i: usize| i as f64 - radius as f64;
        Self { radius, weights: (0..=2 * radius).map(|i| weight(distance(i))).collect() }
    }

    /// The sum of each channel's weights.
    pub(super) fn sums(&self) -> [f64; N] {
        self.weights.iter().fold([0.0; N], |sums, weight| std::array::from_fn(|k| sums[k] + weight[k]))
    }

    /// Scales each channel so that its positive weights sum to 1 and its negative weights to -1.
    pub(super) fn normalized(mut self) -> Self {
        for channel in 0..N {
            let sum = |sign: f64| self.weights.iter().map(|w| (sign * w[channel]).max(0.0)).sum::<f64>();
            let sums = [sum(1.0), sum(-1.0)];
            for weight in &mut self.weights {
                weight[channel] /= if weight[channel] < 0.0 { sums[1] } else { sums[0] };
            }
        }
        self
    }

    /// Filters each channel along rows.
    pub(super) fn along_rows(&self, plane: &Plane<N>) -> Plane<N> {
        let mut values = vec![[0.0; N]; plane.values.len()];
        let width = plane.width;
        values.par_chunks_mut(width).zip(plane.values.par_chunks(width)).for_each(|(out, row)| {
            for (x, out) in out.iter_mut().enumerate() {
                for (k, weight) in self.weights.iter().enumerate() {
                    add(out, weight, &row[(x + k).saturating_sub(self.radius).min(width - 1)]);
                }
            }
        });
        Plane { width, values }
    }

    /// Filters each channel along columns.
    pub(super) fn along_columns(&self, plane: &Plane<N>) -> Plane<N> {
        let mut values = vec![[0.0; N]; plane.values.len()];
        let width = plane.width;
        let height = plane.values.len() / width;
        values.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
            for (k, weight) in self.weights.iter().enumerate() {
                let row = (y + k).saturating_sub(self.radius).min(height - 1) * width;
                for (out, value) in out.iter_mut().zip(&plane.values[row..row + width]) {
                    add(out, weight, value);
                }
            }
        });
        Plane { width, values }
    }
}

#[inline]
fn add<const N: usize>(sums: &mut [f64; N], weights: &[f64; N], values: &[f64; N]) {
    for channel in 0..N {
        sums[channel] += weights[channel] * values[channel];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_repeat_and_axes_differ() {
        let plane = Plane { width: 3, values: vec![[1.0], [2.0], [4.0], [8.0], [16.0], [32.0]] };
        let before = Taps::new(1, |x| [if x < 0.0 { 1.0 } else { 0.0 }]);
        assert_eq!(before.along_rows(&plane).values.as_flattened(), [1.0, 1.0, 2.0, 8.0, 8.0, 16.0]);
        assert_eq!(before.along_columns(&plane).values.as_flattened(), [1.0, 2.0, 4.0, 1.0, 2.0, 4.0]);
    }

    #[test]
    fn signs_are_normalized_separately() {
        let taps = Taps::new(2, |x| [x, 1.0]).normalized();
        let column = |channel: usize| taps.weights.iter().map(|w| w[channel]).collect::<Vec<_>>();
        assert_eq!(column(0), [-2.0 / 3.0, -1.0 / 3.0, 0.0, 1.0 / 3.0, 2.0 / 3.0]);
        assert_eq!(column(1), [0.2; 5]);
    }
}
