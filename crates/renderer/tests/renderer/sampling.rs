//! Hemisphere sampling follows its PDF. Uniform sampling serves for comparison.

use std::f32::consts::TAU;

use canted_renderer::sampling::{Basis, cosine_density, cosine_hemisphere};
use canted_renderer::{Pattern, Sampler};

use crate::common::{U, cross, dot};

const N: u32 = 100_000;

fn squares(n: u32) -> impl Iterator<Item = [f32; 2]> {
    let sampler = Sampler::new(Pattern::Random, n, 5);
    (0..n).map(move |i| sampler.pair(i, 0, 0))
}

/// A direction around +z with PDF `1/(2π)`, from a point of the unit square.
fn uniform_hemisphere(square: [f32; 2]) -> [f32; 3] {
    let cosine = 1.0 - square[0];
    // (1 - c)(1 + c) keeps its digits near the pole, 1 - c² does not.
    let sine = (square[0] * (1.0 + cosine)).sqrt();
    let (s, c) = (TAU * square[1]).sin_cos();
    [sine * c, sine * s, cosine]
}

/// PDF of [`uniform_hemisphere`] at a polar cosine.
fn uniform_density(cosine: f32) -> f32 {
    if cosine >= 0.0 { 1.0 / TAU } else { 0.0 }
}

/// Midpoint rule in the polar cosine; the PDF does not depend on the azimuth.
fn integral(density: impl Fn(f32) -> f32) -> f64 {
    const STEPS: u32 = 10_000;
    let value = |i: u32| f64::from(density(((f64::from(i) + 0.5) / f64::from(STEPS)) as f32));
    std::f64::consts::TAU * (0..STEPS).map(value).sum::<f64>() / f64::from(STEPS)
}

/// The midpoint rule is exact for linear and constant PDFs up to rounding: in `f32`, cosine, π and quotient round once
/// each, and a mean of positive numbers preserves this. The fourth rounding covers `f64` and second-order terms.
const DENSITY_ERROR: f64 = 4.0 * U;

#[test]
fn pdfs_integrate_to_one() {
    for density in [cosine_density, uniform_density] {
        assert!((integral(density) - 1.0).abs() < DENSITY_ERROR);
        assert_eq!(density(-0.5), 0.0);
    }
}

/// Pearson's statistic over 8 rings by 16 sectors that are equally probable by the PDF's distribution function.
fn chi_square(directions: impl Iterator<Item = [f32; 3]>, distribution: impl Fn(f64) -> f64) -> f64 {
    let mut counts = [0_u32; 128];
    let mut n = 0;
    for [x, y, z] in directions {
        let turn = f64::from(y).atan2(f64::from(x)) / std::f64::consts::TAU + 0.5;
        let (ring, sector) = ((distribution(f64::from(z)) * 8.0) as usize, (turn * 16.0) as usize);
        counts[ring.min(7) * 16 + sector.min(15)] += 1;
        n += 1;
    }
    let expected = f64::from(n) / 128.0;
    counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum()
}

#[test]
fn directions_match_their_pdfs() {
    // 127 degrees of freedom: mean 127, standard deviation √254; the limit is six of them.
    let limit = 127.0 + 6.0 * 254.0_f64.sqrt();
    // Probability of a polar cosine below c: c² for cosine sampling, c for uniform sampling.
    let cosine = chi_square(squares(N).map(cosine_hemisphere), |c| c * c);
    let uniform = chi_square(squares(N).map(uniform_hemisphere), |c| c);
    assert!(cosine < limit && uniform < limit, "{cosine} {uniform}");
    let wrong = chi_square(squares(N).map(uniform_hemisphere), |c| c * c);
    assert!(wrong > limit, "the test detects a wrong PDF: {wrong}");
}

#[test]
fn directions_are_unit_and_above_the_horizon() {
    let corners = [[0.0, 0.0], [1.0 - f32::EPSILON / 2.0, 0.0], [0.0, 1.0 - f32::EPSILON / 2.0]];
    for square in squares(N).chain(corners) {
        for direction in [cosine_hemisphere(square), uniform_hemisphere(square)] {
            let d = direction.map(f64::from);
            // Root, sine or cosine, and product round once each: at most four units of rounding per component.
            assert!((dot(d, d) - 1.0).abs() < 8.0 * f64::from(f32::EPSILON), "{direction:?}");
            assert!(direction[2] > 0.0, "{direction:?}");
        }
    }
}

/// Both estimators of `(1/π) ∫ V·cosθ dω`, for the visibility past a wall, and their variances.
#[test]
fn estimators_agree_and_cosine_sampling_has_less_variance() {
    let visible = |d: [f32; 3]| f64::from(u8::from(d[0] + 0.5 * d[2] > 0.0));
    let estimate = |weights: Vec<f64>| {
        let n = f64::from(N);
        let mean = weights.iter().sum::<f64>() / n;
        (mean, weights.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / (n - 1.0))
    };
    let weight = |d: [f32; 3], density: f32| visible(d) * f64::from(d[2] / density) / std::f64::consts::PI;
    let (cosine, cosine_variance) =
        estimate(squares(N).map(cosine_hemisphere).map(|d| weight(d, cosine_density(d[2]))).collect());
    let (uniform, uniform_variance) =
        estimate(squares(N).map(uniform_hemisphere).map(|d| weight(d, uniform_density(d[2]))).collect());
    // The visible part projects onto half a disk and half an ellipse: (1 + sin(atan(1/2)))/2.
    let exact = 0.5 * (1.0 + 1.0 / 5.0_f64.sqrt());
    for (mean, variance) in [(cosine, cosine_variance), (uniform, uniform_variance)] {
        assert!((mean - exact).abs() < 5.0 * (variance / f64::from(N)).sqrt(), "{mean} for {exact}");
    }
    // The error is at least a tenth smaller, i.e. the variance a third; the source reports about 30 %.
    let error_ratio = (cosine_variance / uniform_variance).sqrt();
    assert!(error_ratio < 0.8, "{error_ratio}");
}

#[test]
fn basis_is_orthonormal_and_right_handed() {
    let ugly =
        [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, -0.0, -1.0], [1.0, 0.0, -0.0], [0.6, 0.8, -0.0], [1e-20, 0.0, -1.0]];
    let random = squares(10_000).flat_map(|square| {
        let [x, y, z] = uniform_hemisphere(square);
        [[x, y, z], [x, y, -z]]
    });
    for normal in ugly.into_iter().chain(random) {
        let basis = Basis::about(normal);
        let [t, b, n] =
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| basis.direction(axis).map(f64::from));
        // The normal is unit to 8 units of rounding, and 1/(1 + |z|) is at most 1: sixteen cover the products.
        let bound = 16.0 * f64::from(f32::EPSILON);
        for (value, want) in [(dot(t, t), 1.0), (dot(b, b), 1.0), (dot(t, b), 0.0), (dot(t, n), 0.0), (dot(b, n), 0.0)]
        {
            assert!((value - want).abs() < bound, "{normal:?}: {value} for {want}");
        }
        assert!((dot(cross(t, b), n) - 1.0).abs() < bound, "{normal:?}");
        assert_eq!(basis.direction([0.0, 0.0, 1.0]).map(f64::from), normal.map(f64::from));
    }
}
