//! The variance of each pixel, as far as few samples and its neighbors show it.

use rayon::prelude::*;

use super::wavelet::{distance, taps};
use super::{Denoise, Feature, Light};

/// Radius of the square in which the variance is estimated, in pixels.
pub(super) const RADIUS: u32 = 3;

/// Replaces the variances by their means over similar pixels; unknown ones by the variance of the colors of similar pixels.
///
/// The variance of few samples is itself noisy: where all of four samples miss a small light, it is zero.
pub(super) fn estimate(light: &mut [Light], features: &[Feature], size: [usize; 2], config: &Denoise) {
    let noisy: &[Light] = light;
    let row = |y: usize| -> Vec<f32> { (0..size[0]).map(|x| at(noisy, features, size, [x, y], config)).collect() };
    let estimated: Vec<Vec<f32>> = (0..size[1]).into_par_iter().map(row).collect();
    for (light, variance) in light.iter_mut().zip(estimated.into_iter().flatten()) {
        light.variance = variance;
    }
}

fn at(light: &[Light], features: &[Feature], size: [usize; 2], [x, y]: [usize; 2], config: &Denoise) -> f32 {
    let p = y * size[0] + x;
    let own = light[p].variance;
    let slope = super::wavelet::slope(features, size, [x, y]);
    let (mut sum, mut weights) = (own.max(0.0), f32::from(own >= 0.0));
    let (mut moments, mut n) = ([light[p].color, light[p].color.map(|c| c * c)], 1.0);
    for (q, offset) in taps(size, [x, y], RADIUS as usize, 1) {
        let weight = (-distance(&features[p], &features[q], slope, offset, config)).exp();
        // False for NaN, too.
        if weight > 0.0 {
            if light[q].variance >= 0.0 {
                sum += weight * light[q].variance;
                weights += weight;
            }
            for (k, &c) in light[q].color.iter().enumerate() {
                moments[0][k] += weight * c;
                moments[1][k] += weight * c * c;
            }
            n += weight;
        }
    }
    if weights > 0.0 {
        return (sum / weights).max(own);
    }
    let of_channel = |k: usize| (moments[1][k] / n - (moments[0][k] / n).powi(2)).max(0.0);
    (0..3).map(of_channel).sum::<f32>() / 3.0
}
