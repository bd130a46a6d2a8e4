//! One level of the wavelet transform: a sparse 5 x 5 kernel that avoids edges.

use rayon::prelude::*;

use super::{Denoise, Feature, Light};

/// The B3 spline, by distance from its center in steps.
const SPLINE: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];

/// The 3 x 3 Gaussian that smooths variances, by distance from its center.
const GAUSS: [f32; 2] = [1.0 / 2.0, 1.0 / 4.0];

/// Color difference that counts as none, relative to the color: rounding.
const ROUNDING: f32 = 1e-6;

/// Share of the depth that two pixels of one surface may differ by without a slope.
const FLAT: f32 = 2e-3;

/// Filters `light` into `next` with steps of `step` pixels.
pub(super) fn level(
    light: &[Light],
    features: &[Feature],
    next: &mut [Light],
    size: [usize; 2],
    step: usize,
    config: &Denoise,
) {
    next.par_chunks_mut(size[0].max(1)).enumerate().for_each(|(y, row)| {
        for (x, out) in row.iter_mut().enumerate() {
            *out = filtered(light, features, size, [x, y], step, config);
        }
    });
}

fn filtered(
    light: &[Light],
    features: &[Feature],
    size: [usize; 2],
    [x, y]: [usize; 2],
    step: usize,
    config: &Denoise,
) -> Light {
    let p = y * size[0] + x;
    let (own, feature) = (light[p], features[p]);
    if !feature.is_present {
        return Light::default();
    }
    let slope = slope(features, size, [x, y]);
    let brightest = own.color.into_iter().fold(0.0, |a: f32, c| a.max(c.abs()));
    let tolerance = config.color * smoothed_variance(light, features, size, [x, y]).sqrt() + ROUNDING * brightest;
    let center = SPLINE[0] * SPLINE[0];
    let (mut color, mut variance, mut weights) =
        (own.color.map(|c| center * c), center * center * own.variance, center);
    for (q, offset) in taps(size, [x, y], 2, step) {
        let of_color = difference(own.color, light[q].color) / tolerance.max(f32::MIN_POSITIVE);
        let [i, j] = offset.map(|d| d.unsigned_abs() / step);
        let edges = of_color + distance(&feature, &features[q], slope, offset, config);
        let weight = SPLINE[i] * SPLINE[j] * (-edges).exp();
        // False for NaN, too.
        if weight > 0.0 {
            color.iter_mut().zip(light[q].color).for_each(|(sum, c)| *sum += weight * c);
            variance += weight * weight * light[q].variance;
            weights += weight;
        }
    }
    Light { color: color.map(|sum| sum / weights), variance: variance / (weights * weights) }
}

/// Root mean square of the differences of the channels.
fn difference(a: [f32; 3], b: [f32; 3]) -> f32 {
    (squared(a, b) / 3.0).sqrt()
}

fn squared(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.into_iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// The pixels of a sparse square around a pixel, without itself, with their offsets.
pub(super) fn taps(
    [width, height]: [usize; 2],
    [x, y]: [usize; 2],
    radius: usize,
    step: usize,
) -> impl Iterator<Item = (usize, [isize; 2])> {
    let along = move |at: usize, n: usize| {
        let reach = radius.cast_signed();
        (-reach..=reach).filter_map(move |i| {
            let offset = i * step.cast_signed();
            at.checked_add_signed(offset).filter(|&at| at < n).map(|at| (at, offset))
        })
    };
    along(y, height)
        .flat_map(move |(row, dy)| along(x, width).map(move |(column, dx)| (row * width + column, [dx, dy])))
        .filter(|&(_, offset)| offset != [0, 0])
}

/// How different two surfaces are: the sum of the differences over those of the configuration. Infinite for a pixel without samples.
pub(super) fn distance(p: &Feature, q: &Feature, slope: [f32; 2], offset: [isize; 2], config: &Denoise) -> f32 {
    if !q.is_present {
        return f32::INFINITY;
    }
    let normal = squared(p.normal, q.normal) / (config.normal * config.normal);
    let albedo = squared(p.albedo, q.albedo) / (3.0 * config.albedo * config.albedo);
    #[expect(clippy::cast_precision_loss, reason = "offsets of a few pixels")]
    let explained = (slope[0] * offset[0] as f32 + slope[1] * offset[1] as f32).abs();
    let depth = (p.depth - q.depth).abs() / (config.depth * explained + FLAT * p.depth + f32::MIN_POSITIVE);
    normal + albedo + depth
}

/// Change of the depth from a pixel to the next one, by column and by row: the lesser of the differences to both sides, which does
/// not cross a silhouette.
pub(super) fn slope(features: &[Feature], size: [usize; 2], [x, y]: [usize; 2]) -> [f32; 2] {
    let depth = features[y * size[0] + x].depth;
    let along = |at: usize, n: usize, index: &dyn Fn(usize) -> usize| {
        let before = at.checked_sub(1).map(|at| depth - features[index(at)].depth);
        let after = (at + 1 < n).then(|| features[index(at + 1)].depth - depth);
        match (before, after) {
            (Some(a), Some(b)) => {
                if a.abs() < b.abs() {
                    a
                } else {
                    b
                }
            }
            (a, b) => a.or(b).unwrap_or(0.0),
        }
    };
    [along(x, size[0], &|x| y * size[0] + x), along(y, size[1], &|y| y * size[0] + x)]
}

/// The variance, smoothed over the neighbors.
fn smoothed_variance(light: &[Light], features: &[Feature], size: [usize; 2], [x, y]: [usize; 2]) -> f32 {
    let p = y * size[0] + x;
    let (mut sum, mut weights) = (GAUSS[0] * GAUSS[0] * light[p].variance, GAUSS[0] * GAUSS[0]);
    for (q, [dx, dy]) in taps(size, [x, y], 1, 1) {
        if features[q].is_present {
            let weight = GAUSS[dx.unsigned_abs()] * GAUSS[dy.unsigned_abs()];
            sum += weight * light[q].variance;
            weights += weight;
        }
    }
    sum / weights
}
