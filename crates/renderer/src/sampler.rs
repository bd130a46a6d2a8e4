mod sobol;
mod stratified;

use stratified::{jittered, permuted};

/// Distribution of the samples of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Pattern {
    /// One sample in each cell of a grid, and in each of `n` columns and rows.
    #[default]
    Stratified,
    /// Independent samples.
    Random,
    /// An Owen-scrambled Sobol sequence. Every aligned block of `2^m` samples is stratified in all elementary
    /// intervals. Samples do not depend on the total count, so ranges of samples of an image can be rendered
    /// separately.
    Sobol,
}

/// Random numbers as a pure function of (pixel, sample, dimension, seed).
///
/// All arithmetic is on integers, so every device computes the same bits. Numbers are multiples of 2⁻²⁴ in `[0, 1)`,
/// exact in `f32`.
///
/// The stratified pattern follows Kensler 2013, *Correlated Multi-Jittered Sampling*, with a different hash and
/// permutation. For `n = a·b` samples, each cell of an `a × b` grid contains exactly one, and so does each of the `n`
/// columns and rows. A prime `n` has `a = 1` and is a Latin square. Every `n` covers the entire square.
///
/// The Sobol pattern follows Burley 2020, *Practical Hash-based Owen Scrambling*: each pair of pixel and dimension has
/// its own scrambled and shuffled two-dimensional sequence.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    pattern: Pattern,
    /// The seed, hashed.
    seed: u32,
    /// Cells along x: the largest divisor of the sample count up to its square root.
    columns: u32,
    /// Cells along y.
    rows: u32,
}

impl Sampler {
    /// A sampler for `samples` samples per pixel; zero counts as one.
    #[must_use]
    pub fn new(pattern: Pattern, samples: u32, seed: u32) -> Self {
        let samples = samples.max(1);
        let columns = (1..=samples.isqrt()).rev().find(|a| samples.is_multiple_of(*a)).unwrap_or(1);
        Self { pattern, seed: mix(seed), columns, rows: samples / columns }
    }

    /// Columns and rows of the grid of strata, one cell per sample.
    #[must_use]
    pub fn grid(&self) -> [u32; 2] {
        [self.columns, self.rows]
    }

    /// A point of the unit square. Each use along a path has its own `dimension`.
    ///
    /// Strata hold for `sample` below the count given to [`Sampler::new`]; after that they repeat. The Sobol pattern
    /// has no limit.
    #[must_use]
    pub fn pair(&self, pixel: u32, sample: u32, dimension: u32) -> [f32; 2] {
        // The permutations depend on pixel and dimension, the jitter also on the sample.
        let key = self.key(pixel, dimension);
        if self.pattern == Pattern::Sobol {
            return sobol::pair(sample, [3, 4, 5].map(|salt| mix(key ^ salt))).map(|x| unit(x >> 8));
        }
        let jitter_x = mix(mix(key ^ 1) ^ sample);
        let jitter_y = mix(jitter_x ^ 2);
        if self.pattern == Pattern::Random {
            return [unit(jitter_x >> 8), unit(jitter_y >> 8)];
        }
        let n = self.columns * self.rows;
        let cell = permuted(sample % n, n, mix(key ^ 3));
        let (column, row) = (cell % self.columns, cell / self.columns);
        // Correlated multi-jitter: permute the columns within a row and the rows within a column.
        let x_stratum = column * self.rows + permuted(row, self.rows, mix(key ^ 4));
        let y_stratum = row * self.columns + permuted(column, self.columns, mix(key ^ 5));
        [jittered(x_stratum, n, jitter_x), jittered(y_stratum, n, jitter_y)]
    }

    /// A number in `[0, 1)`, independent of [`Sampler::pair`] of the same dimension.
    ///
    /// Stratified like a coordinate of it: one sample in each of the `n` strata.
    #[must_use]
    pub fn single(&self, pixel: u32, sample: u32, dimension: u32) -> f32 {
        let key = self.key(pixel, dimension);
        let jitter = mix(mix(key ^ 6) ^ sample);
        let n = self.columns * self.rows;
        match self.pattern {
            Pattern::Random => unit(jitter >> 8),
            Pattern::Stratified => jittered(permuted(sample % n, n, mix(key ^ 7)), n, jitter),
            Pattern::Sobol => unit(sobol::single(sample, [8, 9].map(|salt| mix(key ^ salt))) >> 8),
        }
    }

    /// Random bits that do not depend on the pattern, independent of [`Sampler::pair`] of the same dimension.
    #[must_use]
    pub fn bits(&self, pixel: u32, sample: u32, dimension: u32) -> u32 {
        mix(mix(self.key(pixel, dimension) ^ 10) ^ sample)
    }

    /// The hash of a pixel and dimension.
    fn key(&self, pixel: u32, dimension: u32) -> u32 {
        mix(mix(self.seed ^ pixel) ^ dimension)
    }
}

/// Random numbers are multiples of 2⁻²⁴, the resolution of `f32` just below 1.
const STEPS: u64 = 1 << 24;

/// The number with this many steps of 2⁻²⁴.
#[expect(clippy::cast_precision_loss, reason = "below 2^24: exact")]
pub(crate) fn unit(steps: u32) -> f32 {
    steps as f32 * (1.0 / STEPS as f32)
}

/// A 32-bit hash: a bijection in which every input bit flips about half of the output bits.
///
/// Two rounds of xor-shift and odd multiplication, with the constants of Wellons 2018 ("lowbias32"). The addition
/// removes the fixed point at zero.
#[inline]
pub(crate) fn mix(x: u32) -> u32 {
    let x = x.wrapping_add(0x9e37_79b9);
    let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}
