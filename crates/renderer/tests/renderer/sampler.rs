use canted_renderer::{Pattern, Sampler};

const COUNTS: [u32; 17] = [1, 2, 3, 4, 5, 6, 7, 12, 13, 16, 24, 31, 36, 64, 97, 100, 210];

/// The index of the stratum of `n` that `x` lies in; exact, as `x` has 24 bits and `n` few.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "x is in [0, 1)")]
fn stratum(x: f32, n: u32) -> usize {
    (f64::from(x) * f64::from(n)) as usize
}

fn columns(n: u32) -> u32 {
    (1..=n).filter(|a| n.is_multiple_of(*a) && a * a <= n).max().unwrap()
}

/// Whether one sample lies in each cell of the grid, each column and each row.
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
fn every_count_fills_every_stratum_once() {
    for n in COUNTS {
        for pixel in 0..50 {
            assert!(is_stratified(&samples(Pattern::Stratified, n, pixel, 3, 7)), "n {n} pixel {pixel}");
        }
    }
}

#[test]
fn the_check_of_strata_sees_plain_random_points() {
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
    ] {
        assert_ne!(base, other);
    }
    for pattern in [Pattern::Stratified, Pattern::Random] {
        for pixel in 0..20_000 {
            for x in Sampler::new(pattern, 5, 0).pair(pixel, 4, 0) {
                assert!((0.0..1.0).contains(&x));
            }
        }
    }
}

/// The bits that a twin on another device has to reproduce, in units of 2⁻²⁴.
#[test]
fn the_sequence_is_pinned() {
    let steps = |pattern, n, pixel, sample, dimension| {
        Sampler::new(pattern, n, 42).pair(pixel, sample, dimension).map(|x| f64::from(x) * 16_777_216.0)
    };
    let pinned = [
        steps(Pattern::Stratified, 24, 0, 0, 0),
        steps(Pattern::Stratified, 7, 123_456, 6, 2),
        steps(Pattern::Random, 24, u32::MAX, 1, 1),
    ];
    assert_eq!(pinned, [[4602683.0, 6366645.0], [13985805.0, 6325651.0], [10716237.0, 15084637.0]]);
}

/// Over the pixels, correlation of independent numbers has standard deviation `1/√n`.
#[test]
fn neighbours_are_not_correlated() {
    const N: u32 = 100_000;
    let bound = 5.0 / f64::from(N).sqrt();
    for pattern in [Pattern::Stratified, Pattern::Random] {
        let sampler = Sampler::new(pattern, 6, 0);
        let x = |pixel, sample, dimension| sampler.pair(pixel, sample, dimension).map(f64::from);
        for axis in 0..2 {
            let pixels = correlation((0..N).map(|p| (x(p, 0, 0)[axis], x(p + 1, 0, 0)[axis])));
            let rows = correlation((0..N).map(|p| (x(p, 0, 0)[axis], x(p + 1920, 0, 0)[axis])));
            let dimensions = correlation((0..N).map(|p| (x(p, 0, 1)[axis], x(p, 0, 2)[axis])));
            let seeds = correlation(
                (0..N).map(|p| (x(p, 0, 0)[axis], f64::from(Sampler::new(pattern, 6, 1).pair(p, 0, 0)[axis]))),
            );
            for r in [pixels, rows, dimensions, seeds] {
                assert!(r.abs() < bound, "{pattern:?} axis {axis}: {r}");
            }
        }
        let axes = correlation((0..N).map(|p| (x(p, 0, 0)[0], x(p, 0, 0)[1])));
        assert!(axes.abs() < bound, "{pattern:?}: {axes}");
    }
    let itself = correlation((0..N).map(|p| (f64::from(p), f64::from(p))));
    assert!(itself > 0.999, "the measure must see what is correlated: {itself}");
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

/// Variance of the mean of `n` samples of a quarter disc's indicator: stratification leaves only the cells that the
/// arc crosses.
#[test]
fn stratified_varies_less_than_random() {
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
            // Both are unbiased: the mean is the area within five standard errors.
            let area = std::f64::consts::FRAC_PI_4;
            assert!((mean - area).abs() < 5.0 * (variance / 4000.0).sqrt(), "{pattern:?} n {n}: {mean}");
            variance
        };
        let (stratified, random) = (variance(Pattern::Stratified), variance(Pattern::Random));
        assert!(stratified < 0.6 * random, "n {n}: {stratified} against {random}");
    }
}
