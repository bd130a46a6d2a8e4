mod sobol;
mod stratified;

use stratified::{jittered, permuted};

/// How the samples of one pixel are spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Pattern {
    /// One sample in each cell of a grid, and in each of `n` columns and rows.
    #[default]
    Stratified,
    /// Each sample by itself.
    Random,
    /// A scrambled Sobol sequence: one sample in each of many intervals, for every `2^m` samples that begin at a
    /// multiple of `2^m`. No sample depends on how many there are, so ranges of samples of one picture can be made
    /// apart.
    Sobol,
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
///
/// The Sobol pattern is after Burley 2020, *Practical Hash-based Owen Scrambling*: each pair of pixel and dimension has a
/// two-dimensional sequence scrambled and shuffled for itself.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    pattern: Pattern,
    /// The seed, mixed.
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
        Self { pattern, seed: mix(seed), columns, rows: samples / columns }
    }

    /// Columns and rows of the grid of cells, one for each sample.
    #[must_use]
    pub fn grid(&self) -> [u32; 2] {
        [self.columns, self.rows]
    }

    /// A point of the unit square for sample `sample` of pixel `pixel`; each use along a path has its own `dimension`.
    ///
    /// Strata hold for `sample` below the count given to [`Sampler::new`]; later samples begin again with cell 0. The Sobol
    /// pattern goes on without end.
    #[must_use]
    pub fn pair(&self, pixel: u32, sample: u32, dimension: u32) -> [f32; 2] {
        // The permutations are of the pixel and dimension, the jitter of the sample too.
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
        // Inside its cell a sample takes the column of its row and the row of its column.
        let x_stratum = column * self.rows + permuted(row, self.rows, mix(key ^ 4));
        let y_stratum = row * self.columns + permuted(column, self.columns, mix(key ^ 5));
        [jittered(x_stratum, n, jitter_x), jittered(y_stratum, n, jitter_y)]
    }

    /// A number of the unit interval, for choices; independent of [`Sampler::pair`] of the same dimension.
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

    /// Random bits, the same whatever the pattern; independent of what [`Sampler::pair`] of the same dimension gives.
    #[must_use]
    pub fn bits(&self, pixel: u32, sample: u32, dimension: u32) -> u32 {
        mix(mix(self.key(pixel, dimension) ^ 10) ^ sample)
    }

    /// What tells the uses of the random numbers apart.
    fn key(&self, pixel: u32, dimension: u32) -> u32 {
        mix(mix(self.seed ^ pixel) ^ dimension)
    }
}

/// Steps of the numbers produced in the unit interval: 2⁻²⁴ is what `f32` resolves just below 1.
const STEPS: u64 = 1 << 24;

/// The multiple of 2⁻²⁴ with this number of steps.
#[expect(clippy::cast_precision_loss, reason = "below 2^24: exact")]
pub(crate) fn unit(steps: u32) -> f32 {
    steps as f32 * (1.0 / STEPS as f32)
}

/// A bijection of 32 bits in which every input bit flips about half of the output bits.
///
/// Two rounds of xor-shift and odd multiplication; the constants are those Wellons found by search in 2018 ("low
/// bias"). The sum moves zero off its fixed point.
#[inline]
pub(crate) fn mix(x: u32) -> u32 {
    let x = x.wrapping_add(0x9e37_79b9);
    let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}
