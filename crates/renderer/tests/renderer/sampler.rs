use canted_renderer::sampling::{Basis, Hemisphere, cosine_density, cosine_hemisphere, uniform_hemisphere};
use canted_renderer::{Pattern, Sampler};

use crate::common::{U, cross, dot};

const PATTERNS: [Pattern; 3] = [Pattern::Stratified, Pattern::Random, Pattern::Sobol];

const COUNTS: [u32; 17] = [1, 2, 3, 4, 5, 6, 7, 12, 13, 16, 24, 31, 36, 64, 97, 100, 210];

/// The index of the stratum of `n` that contains `x`; exact, because `x` has 24 bits and `n` few.
fn stratum(x: f32, n: u32) -> usize {
    (f64::from(x) * f64::from(n)) as usize
}

fn columns(n: u32) -> u32 {
    (1..=n).filter(|a| n.is_multiple_of(*a) && a * a <= n).max().unwrap()
}

/// Whether each cell of the grid, each column and each row contains one sample.
fn is_stratified(samples: &[[f32; 2]]) -> bool {
    let n = u32::try_from(samples.len()).unwrap();
    let a = columns(n);
    let each_once = |index: &dyn Fn(&[f32; 2]) -> usize| {
        let mut seen = vec![false; n as usize];
        samples.iter().all(|sample| !std::mem::replace(&mut seen[index(sample)], true))
    };
    each_once(&|s| stratum(s[0], a) + a as usize * stratum(s[1], n / a))
        && each_once(&|s| stratum(s[0], n))
        && each_once(&|s| stratum(s[1], n))
}

fn samples(pattern: Pattern, n: u32, pixel: u32, dimension: u32, seed: u32) -> Vec<[f32; 2]> {
    let sampler = Sampler::new(pattern, n, seed);
    (0..n).map(|sample| sampler.pair(pixel, sample, dimension)).collect()
}

#[test]
fn every_stratum_contains_one_sample() {
    for n in COUNTS {
        for pixel in 0..50 {
            assert!(is_stratified(&samples(Pattern::Stratified, n, pixel, 3, 7)), "n {n} pixel {pixel}");
        }
    }
}

#[test]
fn test_detects_random_points() {
    assert!(!is_stratified(&samples(Pattern::Random, 24, 0, 0, 0)));
}

#[test]
fn numbers_are_below_one_and_depend_on_every_argument() {
    let base = Sampler::new(Pattern::Stratified, 6, 1).pair(2, 3, 4);
    assert_eq!(base, Sampler::new(Pattern::Stratified, 6, 1).pair(2, 3, 4));
    for other in [
        Sampler::new(Pattern::Stratified, 6, 2).pair(2, 3, 4),
        Sampler::new(Pattern::Stratified, 6, 1).pair(9, 3, 4),
        Sampler::new(Pattern::Stratified, 6, 1).pair(2, 5, 4),
        Sampler::new(Pattern::Stratified, 6, 1).pair(2, 3, 5),
        Sampler::new(Pattern::Random, 6, 1).pair(2, 3, 4),
        Sampler::new(Pattern::Sobol, 6, 1).pair(2, 3, 4),
    ] {
        assert_ne!(base, other);
    }
    for pattern in PATTERNS {
        for pixel in 0..20_000 {
            for x in Sampler::new(pattern, 5, 0).pair(pixel, 4, 0) {
                assert!((0.0..1.0).contains(&x));
            }
        }
    }
}

/// The bits that the GPU implementation has to reproduce, in units of 2⁻²⁴.
#[test]
fn sequence_is_fixed() {
    let steps = |pattern, n, pixel, sample, dimension| {
        Sampler::new(pattern, n, 42).pair(pixel, sample, dimension).map(|x| f64::from(x) * 16_777_216.0)
    };
    let pinned = [
        steps(Pattern::Stratified, 24, 0, 0, 0),
        steps(Pattern::Stratified, 7, 123_456, 6, 2),
        steps(Pattern::Random, 24, u32::MAX, 1, 1),
        steps(Pattern::Sobol, 7, 123_456, 6, 2),
    ];
    let wanted = [[4602683.0, 6366645.0], [13985805.0, 6325651.0], [10716237.0, 15084637.0], [4553338.0, 15300717.0]];
    assert_eq!(pinned, wanted);
}

/// Over the pixels, the correlation of independent numbers has the standard deviation `1/√n`.
#[test]
fn neighboring_pixels_are_uncorrelated() {
    const N: u32 = 100_000;
    let bound = 5.0 / f64::from(N).sqrt();
    for pattern in PATTERNS {
        let sampler = Sampler::new(pattern, 6, 0);
        let x = |pixel, sample, dimension| sampler.pair(pixel, sample, dimension).map(f64::from);
        for axis in 0..2 {
            let pixels = correlation((0..N).map(|p| (x(p, 0, 0)[axis], x(p + 1, 0, 0)[axis])));
            let rows = correlation((0..N).map(|p| (x(p, 0, 0)[axis], x(p + 1920, 0, 0)[axis])));
            let choices = correlation((0..N).map(|p| (x(p, 0, 0)[axis], f64::from(sampler.single(p, 0, 0)))));
            let dimensions = correlation((0..N).map(|p| (x(p, 0, 1)[axis], x(p, 0, 2)[axis])));
            let seeds = correlation(
                (0..N).map(|p| (x(p, 0, 0)[axis], f64::from(Sampler::new(pattern, 6, 1).pair(p, 0, 0)[axis]))),
            );
            for r in [pixels, rows, choices, dimensions, seeds] {
                assert!(r.abs() < bound, "{pattern:?} axis {axis}: {r}");
            }
        }
        let axes = correlation((0..N).map(|p| (x(p, 0, 0)[0], x(p, 0, 0)[1])));
        assert!(axes.abs() < bound, "{pattern:?}: {axes}");
    }
    let itself = correlation((0..N).map(|p| (f64::from(p), f64::from(p))));
    assert!(itself > 0.999, "the measure detects correlation: {itself}");
}

fn correlation(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let [mut n, mut a, mut b, mut aa, mut bb, mut ab] = [0.0; 6];
    for (x, y) in pairs {
        n += 1.0;
        a += x;
        b += y;
        aa += x * x;
        bb += y * y;
        ab += x * y;
    }
    (ab - a * b / n) / ((aa - a * a / n) * (bb - b * b / n)).sqrt()
}

/// Variance of the mean of `n` samples of a quarter disk's indicator function: stratification leaves only the cells
/// that the arc crosses.
#[test]
fn stratified_has_less_variance_than_random() {
    for n in [6, 7, 16, 24] {
        let variance = |pattern| {
            let estimates: Vec<f64> = (0..4000)
                .map(|pixel| {
                    let inside = samples(pattern, n, pixel, 0, 0).iter().filter(|[x, y]| x * x + y * y < 1.0).count();
                    f64::from(u32::try_from(inside).unwrap()) / f64::from(n)
                })
                .collect();
            let mean = estimates.iter().sum::<f64>() / 4000.0;
            let variance = estimates.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 3999.0;
            // Both are unbiased: the mean matches the area to five standard errors.
            let area = std::f64::consts::FRAC_PI_4;
            assert!((mean - area).abs() < 5.0 * (variance / 4000.0).sqrt(), "{pattern:?} n {n}: {mean}");
            variance
        };
        let (stratified, random) = (variance(Pattern::Stratified), variance(Pattern::Random));
        assert!(stratified < 0.6 * random, "n {n}: {stratified} against {random}");
    }
}

/// One sample in each of `n` strata; for Sobol only if `n` is a power of two.
#[test]
fn single_numbers_are_stratified() {
    let fills = |pattern, n: u32, pixel| {
        let sampler = Sampler::new(pattern, n, 1);
        let mut seen = vec![false; n as usize];
        (0..n).all(|sample| !std::mem::replace(&mut seen[stratum(sampler.single(pixel, sample, 5), n)], true))
    };
    for pixel in 0..50 {
        assert!(COUNTS.iter().all(|&n| fills(Pattern::Stratified, n, pixel)), "pixel {pixel}");
        assert!((0..10).all(|m| fills(Pattern::Sobol, 1 << m, pixel)), "pixel {pixel}");
        assert!(!fills(Pattern::Random, 24, pixel), "pixel {pixel}");
    }
}

/// A Sobol sample depends only on its index, so the samples of an image can be rendered in parts.
#[test]
fn sobol_does_not_depend_on_the_count() {
    for n in COUNTS {
        let (few, many) = (Sampler::new(Pattern::Sobol, n, 3), Sampler::new(Pattern::Sobol, 1 << 20, 3));
        for sample in 0..n {
            assert_eq!(few.pair(9, sample, 2), many.pair(9, sample, 2));
            assert_eq!(few.single(9, sample, 2), many.single(9, sample, 2));
        }
    }
}

/// Samples of one pixel in two dimensions are paired at random. The sum over a net of products of centered numbers
/// would detect a common order.
#[test]
fn dimensions_of_one_pixel_are_uncorrelated() {
    const N: u32 = 64;
    const PIXELS: u32 = 2000;
    for pattern in PATTERNS {
        let sampler = Sampler::new(pattern, N, 0);
        let pairs = |other: fn(&Sampler, u32, u32) -> f32| {
            correlation((0..PIXELS).flat_map(|pixel| {
                (0..N).map(move |i| (f64::from(sampler.pair(pixel, i, 1)[0]), f64::from(other(&sampler, pixel, i))))
            }))
        };
        // Each pixel's correlation of independent orders has deviation 1/√(N - 1), that of all pixels 1/√PIXELS of it.
        let bound = 5.0 / f64::from((N - 1) * PIXELS).sqrt();
        assert!(pairs(|s, p, i| s.pair(p, i, 2)[0]).abs() < bound, "{pattern:?}");
        assert!(pairs(|s, p, i| s.pair(p, i, 2)[1]).abs() < bound, "{pattern:?}");
        assert!(pairs(|s, p, i| s.single(p, i, 1)).abs() < bound, "{pattern:?}");
        assert!(pairs(|s, p, i| s.pair(p, i, 1)[0]).abs() > bound, "the measure detects correlation");
    }
}

/// Mean 1/2 and variance 1/12 of the uniform distribution, over all samples and for each sample index.
///
/// Over `n` independent pixels the mean of one number has the deviation `√(1/12n)`, its centered square
/// `√(1/180n)`: the fourth central moment is 1/80.
#[test]
fn each_sample_is_uniform() {
    const PIXELS: u32 = 50_000;
    for pattern in PATTERNS {
        for (n, sample) in [(1, 0), (3, 2), (7, 0), (16, 15)] {
            let sampler = Sampler::new(pattern, n, 4);
            for number in [
                |s: &Sampler, p, i| s.pair(p, i, 0)[0],
                |s: &Sampler, p, i| s.pair(p, i, 0)[1],
                |s: &Sampler, p, i| s.single(p, i, 0),
            ] {
                let (mut sum, mut squares) = (0.0, 0.0);
                for pixel in 0..PIXELS {
                    let x = f64::from(number(&sampler, pixel, sample)) - 0.5;
                    sum += x;
                    squares += x * x;
                }
                let n = f64::from(PIXELS);
                assert!((sum / n).abs() < 5.0 * (1.0 / (12.0 * n)).sqrt(), "{pattern:?} sample {sample}: {}", sum / n);
                let variance = squares / n;
                let bound = 5.0 * (1.0 / (180.0 * n)).sqrt();
                assert!((variance - 1.0 / 12.0).abs() < bound, "{pattern:?} sample {sample}: {variance}");
            }
        }
    }
}

/// Error of a smooth integral: `n^-1/2` for random points, `n^-3/2` up to logarithms for a scrambled net (Owen 1997).
#[test]
fn smooth_integrals_converge_faster_than_random() {
    let error = |pattern, n: u32| {
        let sampler = Sampler::new(pattern, n, 0);
        let square = |pixel: u32| {
            let sum: f64 = (0..n)
                .map(|i| sampler.pair(pixel, i, 0).map(f64::from))
                .map(|[x, y]| (x + 0.5 * y).exp() * (1.0 + x * y))
                .sum();
            sum / f64::from(n)
        };
        let estimates: Vec<f64> = (0..200).map(square).collect();
        let mean = estimates.iter().sum::<f64>() / 200.0;
        (estimates.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 199.0).sqrt()
    };
    // 200 pixels give both deviations to 5 %: five of that, twice.
    const ROOM: f64 = 1.6;
    let gain = |pattern| error(pattern, 16) / error(pattern, 1024);
    assert!(gain(Pattern::Random) < 8.0 * ROOM && gain(Pattern::Random) > 8.0 / ROOM);
    // The variance has one more logarithm, log 1024 / log 16 = 2.5, and the error its square root.
    assert!(gain(Pattern::Sobol) > 512.0 / 2.5_f64.sqrt() / ROOM, "{}", gain(Pattern::Sobol));
    assert!(error(Pattern::Sobol, 16) < error(Pattern::Random, 16));
}

// Hemisphere sampling follows its PDF. Uniform sampling serves for comparison.

const N: u32 = 100_000;

fn squares(n: u32) -> impl Iterator<Item = [f32; 2]> {
    let sampler = Sampler::new(Pattern::Random, n, 5);
    (0..n).map(move |i| sampler.pair(i, 0, 0))
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
    for density in Hemisphere::ALL.map(|hemisphere| move |cosine| hemisphere.density(cosine)) {
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

/// A weight is Lambert's density over that of the direction.
#[test]
fn weights_are_quotients_of_densities() {
    for hemisphere in Hemisphere::ALL {
        for [_, _, z] in squares(N).map(|square| hemisphere.direction(square)) {
            let (weight, want) = (hemisphere.weight(z), cosine_density(z) / hemisphere.density(z));
            assert!((weight - want).abs() <= 2.0 * f32::EPSILON * want, "{hemisphere:?} {z}: {weight}, not {want}");
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
    let of = |hemisphere: Hemisphere| {
        let weighed = |d: [f32; 3]| visible(d) * f64::from(hemisphere.weight(d[2]));
        estimate(squares(N).map(|square| weighed(hemisphere.direction(square))).collect())
    };
    let [(cosine, cosine_variance), (uniform, uniform_variance)] = Hemisphere::ALL.map(of);
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
