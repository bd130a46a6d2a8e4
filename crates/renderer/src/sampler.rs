/// How the samples of one pixel are spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Pattern {
    /// One sample in each cell of a grid, and in each of `n` columns and rows.
    #[default]
    Stratified,
    /// Each sample by itself.
    Random,
}

/// Random numbers as a pure function of (pixel, sample, dimension, seed).
///
/// All arithmetic is on integers, so every device computes the same bits. Numbers lie in `[0, 1)` and are multiples
/// of 2⁻²⁴, exact in `f32`.
///
/// The stratified pattern is after Kensler 2013, *Correlated Multi-Jittered Sampling*, with hash and permutation of
/// our own: for `n = a·b` samples each cell of an `a × b` grid receives exactly one, and so does each of the `n`
/// columns and each of the `n` rows. A prime `n` has `a = 1` and is a Latin square. Nothing is truncated, so no `n`
/// leaves a part of the square empty.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    pattern: Pattern,
    seed: u32,
    /// Cells along x; the divisor of the sample count next below its square root.
    columns: u32,
    /// Cells along y.
    rows: u32,
}

impl Sampler {
    /// A sampler for `samples` samples a pixel; zero counts as one.
    #[must_use]
    pub fn new(pattern: Pattern, samples: u32, seed: u32) -> Self {
        let samples = samples.max(1);
        let columns = (1..=samples.isqrt()).rev().find(|a| samples.is_multiple_of(*a)).unwrap_or(1);
        Self { pattern, seed, columns, rows: samples / columns }
    }

    /// A point of the unit square for sample `sample` of pixel `pixel`; each use along a path has its own `dimension`.
    ///
    /// Strata hold for `sample` below the count given to [`Sampler::new`]; later samples begin again with cell 0.
    #[must_use]
    pub fn pair(&self, pixel: u32, sample: u32, dimension: u32) -> [f32; 2] {
        // The permutations are of the pixel and dimension, the jitter of the sample too.
        let key = mix(mix(mix(self.seed) ^ pixel) ^ dimension);
        let jitter_x = mix(mix(key ^ 1) ^ sample);
        let jitter_y = mix(jitter_x ^ 2);
        if self.pattern == Pattern::Random {
            return [unit(jitter_x >> 8), unit(jitter_y >> 8)];
        }
        let n = self.columns * self.rows;
        let cell = permuted(sample % n, n, mix(key ^ 3));
        let (column, row) = (cell % self.columns, cell / self.columns);
        // Inside its cell a sample takes the column of its row and the row of its column.
        let x_stratum = column * self.rows + permuted(row, self.rows, mix(key ^ 4));
        let y_stratum = row * self.columns + permuted(column, self.columns, mix(key ^ 5));
        [jittered(x_stratum, n, jitter_x), jittered(y_stratum, n, jitter_y)]
    }
}

/// Steps of the numbers produced in the unit interval: 2⁻²⁴ is what `f32` resolves just below 1.
const STEPS: u64 = 1 << 24;

/// The multiple of 2⁻²⁴ with this number of steps.
#[expect(clippy::cast_precision_loss, reason = "below 2^24: exact")]
fn unit(steps: u32) -> f32 {
    steps as f32 * (1.0 / STEPS as f32)
}

/// A number of stratum `k` of `n`: a multiple `x` of 2⁻²⁴ with `k/n <= x < (k + 1)/n`, exactly.
///
/// From 2²⁴ strata on, some hold no such multiple; the one next above serves them.
fn jittered(k: u32, n: u32, random: u32) -> f32 {
    let first = |k: u64| (k * STEPS).div_ceil(u64::from(n));
    let (low, high) = (first(u64::from(k)), first(u64::from(k) + 1));
    let steps = low + ((u64::from(random) * (high - low)) >> 32);
    unit(steps.min(STEPS - 1) as u32)
}

/// Image of `i < n` under a permutation of `0..n` chosen by `key`.
///
/// Rounds that are each a bijection of `0..2^k` for the least `2^k >= n`; values outside `0..n` walk on along their
/// cycle until they are inside (cycle walking, Black and Rogaway 2002), which takes fewer than two turns on average.
/// A rotation of `0..n` at the end makes every place equally likely, however small `n`.
#[expect(clippy::cast_possible_truncation, reason = "remainder by a u32")]
fn permuted(mut i: u32, n: u32, key: u32) -> u32 {
    let bits = u32::BITS - (n - 1).leading_zeros();
    let mask = if bits == u32::BITS { u32::MAX } else { (1 << bits) - 1 };
    let shift = bits.div_ceil(2).max(1);
    let keys = [mix(key), mix(key ^ 1), mix(key ^ 2)];
    loop {
        for key in keys {
            // Sum and odd factor modulo 2^k, then the high half folded onto the low: all invertible.
            i = i.wrapping_add(key).wrapping_mul(key >> 16 | 1) & mask;
            i ^= i >> shift;
        }
        if i < n {
            break;
        }
    }
    let turn = (u64::from(mix(key ^ 3)) * u64::from(n)) >> 32;
    ((u64::from(i) + turn) % u64::from(n)) as u32
}

/// A bijection of 32 bits in which every input bit flips about half of the output bits.
///
/// Two rounds of xor-shift and odd multiplication; the constants are those Wellons found by search in 2018 ("low
/// bias"). The sum moves zero off its fixed point.
fn mix(x: u32) -> u32 {
    let x = x.wrapping_add(0x9e37_79b9);
    let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_permutation_is_one() {
        for n in (1..=70).chain([97, 128, 1000, 1024, 1025]) {
            for key in 0..20 {
                let mut seen = vec![false; n as usize];
                for i in 0..n {
                    assert!(!std::mem::replace(&mut seen[permuted(i, n, mix(key)) as usize], true), "n {n} key {key}");
                }
            }
        }
    }

    /// Over random keys each index should land on each place equally often: Pearson's statistic of the counts has
    /// mean `n - 1` and variance `2(n - 1)`, so six standard deviations leave no room for chance.
    #[test]
    fn permutations_favour_no_place() {
        const KEYS: u32 = 20_000;
        for n in [2_u32, 3, 5, 6, 7, 16, 24] {
            for i in 0..n {
                let mut counts = vec![0_u32; n as usize];
                for key in 0..KEYS {
                    counts[permuted(i, n, mix(key)) as usize] += 1;
                }
                let expected = f64::from(KEYS) / f64::from(n);
                let statistic: f64 = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
                let freedom = f64::from(n - 1);
                assert!(statistic < freedom + 6.0 * (2.0 * freedom).sqrt(), "n {n} i {i}: {statistic}");
            }
        }
    }

    /// All permutations of few things occur, none much more often than another.
    #[test]
    fn small_permutations_are_all_possible() {
        for n in 2..=4_u32 {
            let mut counts = std::collections::HashMap::new();
            for key in 0..24_000 {
                let image: Vec<u32> = (0..n).map(|i| permuted(i, n, mix(key))).collect();
                *counts.entry(image).or_insert(0_u32) += 1;
            }
            let n_permutations: u32 = (1..=n).product();
            assert_eq!(counts.len(), n_permutations as usize);
            let fair = 24_000 / n_permutations;
            assert!(counts.values().all(|&c| 2 * c > fair && c < 2 * fair), "n {n}: {counts:?}");
        }
    }

    #[test]
    fn strata_keep_their_closed_and_open_ends() {
        for n in [1_u32, 3, 6, 7, 24, 1009, 65_535] {
            for k in [0, n / 2, n - 1] {
                for random in [0, 1, u32::MAX / 2, u32::MAX] {
                    let steps = f64::from(jittered(k, n, random)) * f64::from(n);
                    // A product of a 24-bit and a 32-bit integer times a power of two could round, but not past an
                    // integer: integers are representable.
                    assert!(f64::from(k) <= steps && steps < f64::from(k + 1), "stratum {k} of {n}: {steps}");
                }
            }
        }
    }
}
