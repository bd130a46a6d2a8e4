//! Numbers of many samples side by side. One sample is one lane, so [`Sampler::pair`] has the same bits.
//!
//! Everything is a loop over lanes that the compiler turns into vectors of the machine: therefore `#[inline(always)]` and no closures. The
//! number of strata is the same in all lanes, so that branches on it are outside of the loops.

use canted_wide::{Loops, SimdPath};

use super::{Pattern, STEPS, Sampler, mix, net_pair, net_single, unit};

/// Samples that are computed side by side: those of a vector of AVX-512.
const LANES: usize = 16;

/// The numbers of some samples in some dimensions.
pub(crate) struct Numbers {
    sampler: Sampler,
    simd: SimdPath,
    /// Pixels and samples. The last lanes are filled with zeros.
    of: Vec<[[u32; LANES]; 2]>,
    /// For each dimension, as many as `of`.
    pairs: Vec<[[f32; LANES]; 2]>,
    singles: Vec<[f32; LANES]>,
}

impl Numbers {
    pub(crate) fn new(sampler: Sampler) -> Self {
        Self { sampler, simd: SimdPath::detect(), of: vec![], pairs: vec![], singles: vec![] }
    }

    /// Draws pairs and single numbers of some dimensions for each of some pixels and samples.
    pub(crate) fn draw(&mut self, of: impl Iterator<Item = (u32, u32)>, pairs: &[u32], singles: &[u32]) {
        self.of.clear();
        for (i, (pixel, sample)) in of.enumerate() {
            if i % LANES == 0 {
                self.of.push([[0; LANES]; 2]);
            }
            let [pixels, samples] = &mut self.of[i / LANES];
            (pixels[i % LANES], samples[i % LANES]) = (pixel, sample);
        }
        self.pairs.resize(pairs.len() * self.of.len(), [[0.0; LANES]; 2]);
        self.singles.resize(singles.len() * self.of.len(), [0.0; LANES]);
        let Self { sampler, simd, of, pairs: found_pairs, singles: found_singles } = self;
        simd.run(Draw { sampler, of, dimensions: [pairs, singles], pairs: found_pairs, singles: found_singles });
    }

    /// The numbers of the `sample`-th of the samples.
    pub(crate) fn of(&self, sample: usize) -> Drawn<'_> {
        Drawn { numbers: self, sample }
    }
}

/// The numbers of one sample. Dimensions are counted in the order in which they were drawn.
#[derive(Clone, Copy)]
pub(crate) struct Drawn<'a> {
    numbers: &'a Numbers,
    sample: usize,
}

impl Drawn<'_> {
    /// [`Sampler::pair`].
    pub(crate) fn pair(&self, dimension: usize) -> [f32; 2] {
        let Numbers { of, pairs, .. } = self.numbers;
        let [x, y] = &pairs[dimension * of.len() + self.sample / LANES];
        [x[self.sample % LANES], y[self.sample % LANES]]
    }

    /// [`Sampler::single`].
    pub(crate) fn single(&self, dimension: usize) -> f32 {
        let Numbers { of, singles, .. } = self.numbers;
        singles[dimension * of.len() + self.sample / LANES][self.sample % LANES]
    }
}

struct Draw<'a> {
    sampler: &'a Sampler,
    of: &'a [[[u32; LANES]; 2]],
    /// Of pairs and of single numbers.
    dimensions: [&'a [u32]; 2],
    pairs: &'a mut [[[f32; LANES]; 2]],
    singles: &'a mut [[f32; LANES]],
}

impl Loops for Draw<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let n = self.of.len();
        for (d, &dimension) in self.dimensions[0].iter().enumerate() {
            for (i, [pixels, samples]) in self.of.iter().enumerate() {
                self.pairs[d * n + i] = pairs(self.sampler, pixels, samples, dimension);
            }
        }
        for (d, &dimension) in self.dimensions[1].iter().enumerate() {
            for (i, [pixels, samples]) in self.of.iter().enumerate() {
                self.singles[d * n + i] = singles(self.sampler, pixels, samples, dimension);
            }
        }
    }
}

/// [`Sampler::pair`], by coordinate.
#[inline(always)]
pub(super) fn pairs<const N: usize>(
    sampler: &Sampler,
    pixels: &[u32; N],
    samples: &[u32; N],
    dimension: u32,
) -> [[f32; N]; 2] {
    let &Sampler { pattern, columns, rows, .. } = sampler;
    let keys = keys(sampler, pixels, dimension);
    let [mut x, mut y] = [[0; N]; 2];
    if pattern == Pattern::Sobol {
        for i in 0..N {
            [x[i], y[i]] = net_pair(samples[i], [mix(keys[i] ^ 3), mix(keys[i] ^ 4), mix(keys[i] ^ 5)]);
        }
        return [top(&x), top(&y)];
    }
    for i in 0..N {
        x[i] = mix(mix(keys[i] ^ 1) ^ samples[i]);
        y[i] = mix(x[i] ^ 2);
    }
    if pattern == Pattern::Random {
        return [top(&x), top(&y)];
    }
    // Correlated multi-jitter: permutes the cells, the rows within a column and the columns within a row.
    let n = columns * rows;
    let cells = permuted(&divided(samples, n)[1], n, &salted(&keys, 3));
    let [row, column] = divided(&cells, columns);
    let in_column = permuted(&row, rows, &salted(&keys, 4));
    let in_row = permuted(&column, columns, &salted(&keys, 5));
    let [mut across, mut down] = [[0; N]; 2];
    for i in 0..N {
        across[i] = column[i] * rows + in_column[i];
        down[i] = row[i] * columns + in_row[i];
    }
    [jittered(&across, n, &x), jittered(&down, n, &y)]
}

/// [`Sampler::single`].
#[inline(always)]
pub(super) fn singles<const N: usize>(
    sampler: &Sampler,
    pixels: &[u32; N],
    samples: &[u32; N],
    dimension: u32,
) -> [f32; N] {
    let keys = keys(sampler, pixels, dimension);
    let mut x = [0; N];
    if sampler.pattern == Pattern::Sobol {
        for i in 0..N {
            x[i] = net_single(samples[i], keys[i]);
        }
        return top(&x);
    }
    for i in 0..N {
        x[i] = mix(mix(keys[i] ^ 6) ^ samples[i]);
    }
    if sampler.pattern == Pattern::Random {
        return top(&x);
    }
    let n = sampler.columns * sampler.rows;
    jittered(&permuted(&divided(samples, n)[1], n, &salted(&keys, 7)), n, &x)
}

/// The upper 24 bits as numbers.
#[inline(always)]
fn top<const N: usize>(bits: &[u32; N]) -> [f32; N] {
    let mut numbers = [0.0; N];
    for i in 0..N {
        numbers[i] = unit(bits[i] >> 8);
    }
    numbers
}

#[inline(always)]
fn keys<const N: usize>(sampler: &Sampler, pixels: &[u32; N], dimension: u32) -> [u32; N] {
    let mut keys = [0; N];
    for i in 0..N {
        keys[i] = sampler.key(pixels[i], dimension);
    }
    keys
}

/// A hash of each key.
#[inline(always)]
fn salted<const N: usize>(keys: &[u32; N], salt: u32) -> [u32; N] {
    let mut hashes = [0; N];
    for i in 0..N {
        hashes[i] = mix(keys[i] ^ salt);
    }
    hashes
}

/// Quotients and remainders by the same `n`.
#[inline(always)]
fn divided<const N: usize>(numbers: &[u32; N], n: u32) -> [[u32; N]; 2] {
    let [mut quotients, mut remainders] = [[0; N]; 2];
    if n.is_power_of_two() {
        for i in 0..N {
            quotients[i] = numbers[i] >> n.trailing_zeros();
            remainders[i] = numbers[i] & (n - 1);
        }
        return [quotients, remainders];
    }
    for i in 0..N {
        // No vector divides integers. Both are below 2^32, so their quotient in `f64` does not round up to an integer above it.
        quotients[i] = (f64::from(numbers[i]) / f64::from(n)) as u32;
        remainders[i] = numbers[i] - quotients[i] * n;
    }
    [quotients, remainders]
}

/// The images of indices below `n`, each by the permutation of `0..n` that its key selects.
///
/// Each round is a bijection of `0..2^k` for the smallest `2^k >= n`. Values outside `0..n` are permuted again (cycle
/// walking, Black and Rogaway 2002), less than twice on average. The final rotation of `0..n` makes every image equally
/// likely for small `n` too.
#[inline(always)]
pub(super) fn permuted<const N: usize>(indices: &[u32; N], n: u32, keys: &[u32; N]) -> [u32; N] {
    let bits = u32::BITS - (n - 1).leading_zeros();
    let mask = u32::MAX.checked_shr(u32::BITS - bits).unwrap_or(0);
    let shift = bits.div_ceil(2).max(1);
    let rounds = [salted(keys, 0), salted(keys, 1), salted(keys, 2)];
    let mut images = *indices;
    let mut is_outside = [true; N];
    loop {
        let mut is_any_outside = false;
        for i in 0..N {
            let mut image = images[i];
            for keys in &rounds {
                // Addition and odd multiplication modulo 2^k, then xor-shift: all are invertible.
                image = image.wrapping_add(keys[i]).wrapping_mul(keys[i] >> 16 | 1) & mask;
                image ^= image >> shift;
            }
            images[i] = if is_outside[i] { image } else { images[i] };
            is_outside[i] = images[i] >= n;
            is_any_outside |= is_outside[i];
        }
        if !is_any_outside {
            break;
        }
    }
    for i in 0..N {
        let rotation = ((u64::from(mix(keys[i] ^ 3)) * u64::from(n)) >> 32) as u32;
        // The sum modulo n, without overflow.
        let remaining = n - rotation;
        images[i] = if images[i] < remaining { images[i] + rotation } else { images[i] - remaining };
    }
    images
}

/// A number in stratum `k` of `n`: a multiple `x` of 2⁻²⁴ with `k/n <= x < (k + 1)/n`, exactly; beyond 2²⁹ strata it may be the next one.
///
/// For more than 2²⁴ strata, some contain no such multiple; they use the next larger one.
#[inline(always)]
pub(super) fn jittered<const N: usize>(strata: &[u32; N], n: u32, random: &[u32; N]) -> [f32; N] {
    let mut numbers = [0.0; N];
    if n.is_power_of_two() && n <= STEPS {
        // Same result as below, without divisions.
        let width = STEPS >> n.trailing_zeros();
        for i in 0..N {
            numbers[i] = unit(strata[i] * width + share(random[i], width));
        }
        return numbers;
    }
    for i in 0..N {
        let (k, n) = (f64::from(strata[i]), f64::from(n));
        let (low, next) = (first_step(k, n), first_step(k + 1.0, n));
        numbers[i] = unit((low + share(random[i], next - low)).min(STEPS - 1));
    }
    numbers
}

/// The first multiple of 2⁻²⁴ that is not below `k/n`, in units of it.
#[inline(always)]
fn first_step(k: f64, n: f64) -> u32 {
    // Below 2^29 strata the sum is exact, but for the last ones, which end at `STEPS`; its quotient is at least 1/n off the integer above it, more than
    // its rounding.
    ((k * f64::from(STEPS) + (n - 1.0)) / n) as u32
}

/// A part of a whole number, rounded down; `random` is in units of 2⁻³² of it.
#[inline(always)]
fn share(random: u32, whole: u32) -> u32 {
    ((u64::from(random) * u64::from(whole)) >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotients_are_those_of_integers() {
        let (mut n_wrong, mut count) = (0, 0);
        for n in [1, 2, 3, 97, 65_537, (1 << 24) + 1, 100_000_000, (1 << 31) - 1, u32::MAX] {
            for q in (0..=u32::MAX / n).step_by((u32::MAX / n / 1000).max(1) as usize) {
                // Multiples and both neighbors, where a quotient that is rounded up shows.
                for number in [q * n, (q * n).wrapping_sub(1), (q * n).wrapping_add(1)] {
                    assert_eq!(divided(&[number], n), [[number / n], [number % n]], "{number} / {n}");
                    n_wrong += usize::from((number as f32 / n as f32) as u32 != number / n);
                    count += 1;
                }
            }
        }
        // In `f32` quotients are wrong.
        assert!(n_wrong > count / 100, "{n_wrong} of {count}");
    }

    #[test]
    fn steps_are_those_of_integers() {
        for n in [1_u32, 3, 24, 97, (1 << 24) - 1, (1 << 24) + 1, 100_000_000, (1 << 28) + 1, (1 << 29) - 1] {
            for k in (0..=n).step_by((n / 1000).max(1) as usize).chain([n - 1, n]) {
                let want = (u64::from(k) << 24).div_ceil(u64::from(n));
                assert_eq!(u64::from(first_step(f64::from(k), f64::from(n))), want, "{k} of {n}");
            }
        }
    }
}
