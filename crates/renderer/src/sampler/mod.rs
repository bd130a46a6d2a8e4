mod lanes;

pub(crate) use lanes::{Drawn, Numbers};

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

impl Pattern {
    /// All patterns.
    pub const ALL: [Self; 3] = [Self::Random, Self::Stratified, Self::Sobol];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Stratified => "stratified",
            Self::Sobol => "sobol",
        }
    }
}

/// Random numbers as a pure function of (pixel, sample, dimension, seed).
///
/// All arithmetic is on integers, or on `f64` with the same results, so every device computes the same bits. Numbers are multiples of 2⁻²⁴ in `[0, 1)`,
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
        let [[x], [y]] = lanes::pairs(self, &[pixel], &[sample], dimension);
        [x, y]
    }

    /// A number in `[0, 1)`, independent of [`Sampler::pair`] of the same dimension.
    ///
    /// Stratified like a coordinate of it: one sample in each of the `n` strata.
    #[must_use]
    pub fn single(&self, pixel: u32, sample: u32, dimension: u32) -> f32 {
        let [x] = lanes::singles(self, &[pixel], &[sample], dimension);
        x
    }

    /// Random bits that do not depend on the pattern, independent of [`Sampler::pair`] of the same dimension.
    #[must_use]
    pub fn bits(&self, pixel: u32, sample: u32, dimension: u32) -> u32 {
        mix(mix(self.key(pixel, dimension) ^ 10) ^ sample)
    }

    /// The hash of a pixel and dimension.
    #[inline(always)]
    fn key(&self, pixel: u32, dimension: u32) -> u32 {
        mix(mix(self.seed ^ pixel) ^ dimension)
    }
}

/// Random numbers are multiples of 2⁻²⁴, the resolution of `f32` just below 1.
const STEPS: u32 = 1 << 24;

/// The number with this many steps of 2⁻²⁴.
#[inline(always)]
pub(crate) fn unit(steps: u32) -> f32 {
    steps as f32 * (1.0 / STEPS as f32)
}

/// A 32-bit hash: a bijection in which every input bit flips about half of the output bits.
///
/// Two rounds of xor-shift and odd multiplication, with the constants of Wellons 2018 ("lowbias32"). The addition
/// removes the fixed point at zero.
#[inline(always)]
pub(crate) fn mix(x: u32) -> u32 {
    let x = x.wrapping_add(0x9e37_79b9);
    let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

// Owen-scrambled (0,2)-sequences in base 2: of every aligned block of `2^m` samples, each elementary interval
// `[a/2^i, (a+1)/2^i) x [b/2^j, (b+1)/2^j)` with `i + j = m` contains exactly one.
//
// The sequence is the first two dimensions of Sobol 1967 with Owen scrambling (1995): each bit of a coordinate is
// flipped at random, depending on all higher bits. Following Burley 2020, *Practical Hash-based Owen Scrambling*, this
// is done by a hash in which bits affect only higher bits, on reversed bits. The same hash shuffles the sample
// indices, so that every use has an independent sequence (padding).

/// Point `sample` of the sequence selected by `seeds`, in units of 2⁻³². The first seed shuffles the samples, the
/// others scramble one coordinate each. Seeds must be hashes.
#[inline(always)]
fn net_pair(sample: u32, seeds: [u32; 3]) -> [u32; 2] {
    let index = shuffled(sample, seeds[0]);
    [scrambled(index, seeds[1]), scrambled(second(index), seeds[2])]
}

/// One coordinate of the sequence of a key, in units of 2⁻³².
#[inline(always)]
pub(crate) fn net_single(sample: u32, key: u32) -> u32 {
    scrambled(shuffled(sample, mix(key ^ 8)), mix(key ^ 9))
}

/// Shuffles sample indices; every aligned block of `2^m` maps to an aligned block.
#[inline(always)]
fn shuffled(index: u32, seed: u32) -> u32 {
    laine_karras(index.reverse_bits(), seed).reverse_bits()
}

/// Scrambles a coordinate given in reversed bits.
#[inline(always)]
fn scrambled(reversed: u32, seed: u32) -> u32 {
    laine_karras(reversed, seed).reverse_bits()
}

/// The second coordinate of point `index` without scrambling, in reversed bits; the first is `index` itself.
///
/// Bit `j` is the parity of the index bits `k` for which the binomial `C(k, j)` is odd: those for which `k` contains
/// all bits of `j`. Each of five steps sums over one bit of `k`.
#[inline(always)]
fn second(index: u32) -> u32 {
    let mut bits = index;
    for (step, mask) in [(1, 0x5555_5555), (2, 0x3333_3333), (4, 0x0f0f_0f0f), (8, 0x00ff_00ff), (16, 0x0000_ffff)] {
        bits ^= bits >> step & mask;
    }
    bits
}

/// A bijective hash in which each bit depends only on itself and on lower bits (Laine and Karras 2011).
///
/// Sums, products with odd numbers, and `x ^ x·even` have this property. The constants are those of Vegdahl 2021, which
/// are less biased than Burley's.
#[inline(always)]
fn laine_karras(x: u32, seed: u32) -> u32 {
    let x = x ^ x.wrapping_mul(0x3d20_adea);
    let x = x.wrapping_add(seed);
    let x = x.wrapping_mul(seed >> 16 | 1);
    let x = x ^ x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

#[cfg(test)]
mod tests {
    use super::lanes::{jittered, permuted};
    use super::*;

    #[test]
    fn numbers_side_by_side_are_those_of_each_sample() {
        for pattern in Pattern::ALL {
            for n in [1, 7, 12, 16, 24, 64, 97] {
                let sampler = Sampler::new(pattern, n, 3);
                let mut numbers = Numbers::new(sampler);
                for count in [0, 1, 15, 16, 17, 64, 5] {
                    let of = (0..count).map(|i| (mix(i) % 9, mix(i ^ count) % (n + 2)));
                    let (pairs, singles) = ([4, 9, count], [count, 2]);
                    numbers.draw(of.clone(), &pairs, &singles);
                    for (i, (pixel, sample)) in of.enumerate() {
                        let drawn = numbers.of(i);
                        for (d, dimension) in pairs.into_iter().enumerate() {
                            assert_eq!(drawn.pair(d), sampler.pair(pixel, sample, dimension), "{pattern:?} {n} {i}");
                        }
                        for (d, dimension) in singles.into_iter().enumerate() {
                            assert_eq!(
                                drawn.single(d),
                                sampler.single(pixel, sample, dimension),
                                "{pattern:?} {n} {i}"
                            );
                        }
                    }
                }
            }
        }
    }

    /// The image of `i` by the permutation of `0..n` that a key selects.
    fn image(i: u32, n: u32, key: u32) -> u32 {
        permuted(&[i], n, &[key])[0]
    }

    #[test]
    fn permutations_are_bijective() {
        for n in (1..=70).chain([97, 128, 1000, 1024, 1025]) {
            for key in 0..20 {
                let mut seen = vec![false; n as usize];
                for i in 0..n {
                    assert!(!std::mem::replace(&mut seen[image(i, n, mix(key)) as usize], true), "n {n} key {key}");
                }
            }
        }
    }

    /// Over random keys, every image of an index is equally likely: Pearson's chi-squared statistic has mean `n - 1`
    /// and variance `2(n - 1)`; the limit is six standard deviations.
    #[test]
    fn permutations_are_uniform() {
        const KEYS: u32 = 20_000;
        for n in [2_u32, 3, 5, 6, 7, 16, 24] {
            for i in 0..n {
                let mut counts = vec![0_u32; n as usize];
                for key in 0..KEYS {
                    counts[image(i, n, mix(key)) as usize] += 1;
                }
                let expected = f64::from(KEYS) / f64::from(n);
                let statistic: f64 = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
                let freedom = f64::from(n - 1);
                assert!(statistic < freedom + 6.0 * (2.0 * freedom).sqrt(), "n {n} i {i}: {statistic}");
            }
        }
    }

    /// All permutations of few elements occur with similar frequency.
    #[test]
    fn all_small_permutations_occur() {
        for n in 2..=4_u32 {
            let mut counts = std::collections::HashMap::new();
            for key in 0..24_000 {
                let image: Vec<u32> = (0..n).map(|i| image(i, n, mix(key))).collect();
                *counts.entry(image).or_insert(0_u32) += 1;
            }
            let n_permutations: u32 = (1..=n).product();
            assert_eq!(counts.len(), n_permutations as usize);
            let fair = 24_000 / n_permutations;
            assert!(counts.values().all(|&c| 2 * c > fair && c < 2 * fair), "n {n}: {counts:?}");
        }
    }

    #[test]
    fn numbers_lie_in_their_half_open_strata() {
        for n in [1_u32, 3, 6, 7, 16, 24, 64, 1009, 65_535, 65_536] {
            for k in [0, n / 2, n - 1] {
                for random in [0, 1, u32::MAX / 2, u32::MAX] {
                    let steps = f64::from(jittered(&[k], n, &[random])[0]) * f64::from(n);
                    // The product may round, but never past an integer, because integers are representable.
                    assert!(f64::from(k) <= steps && steps < f64::from(k + 1), "stratum {k} of {n}: {steps}");
                }
            }
        }
    }

    /// Whether each elementary interval of minimum size contains one of the `2^m` points.
    fn is_net(points: &[[u32; 2]]) -> bool {
        let m = points.len().ilog2();
        (0..=m).all(|i| {
            let mut seen = vec![false; points.len()];
            let top = |x: u32, bits: u32| u64::from(x) >> (32 - bits);
            points.iter().all(|&[x, y]| {
                let cell = top(x, i) << (m - i) | top(y, m - i);
                !std::mem::replace(&mut seen[usize::try_from(cell).unwrap()], true)
            })
        })
    }

    fn seeds(key: u32) -> [u32; 3] {
        [1, 2, 3].map(|salt| mix(mix(key) ^ salt))
    }

    #[test]
    fn second_coordinate_matches_direction_numbers() {
        // Direction numbers of the polynomial x + 1: v[k + 1] = v[k] ^ v[k] / 2.
        let directions: Vec<u32> = std::iter::successors(Some(1 << 31), |v| Some(v ^ v >> 1)).take(32).collect();
        for index in (0..4096).chain((0..4096).map(mix)) {
            let sum = (0..32).filter(|k| index >> k & 1 == 1).fold(0, |sum, k| sum ^ directions[k]);
            assert_eq!(second(index).reverse_bits(), sum, "index {index}");
        }
    }

    #[test]
    fn aligned_blocks_are_nets_before_and_after_scrambling() {
        for m in 0..=12 {
            for block in [0, 1, 5] {
                let samples = || (block << m)..((block + 1) << m);
                let plain: Vec<_> = samples().map(|i: u32| [i.reverse_bits(), second(i).reverse_bits()]).collect();
                assert!(is_net(&plain), "m {m} block {block}");
                for key in 0..20 {
                    let points: Vec<_> = samples().map(|i| net_pair(i, seeds(key))).collect();
                    assert!(is_net(&points), "m {m} block {block} key {key}");
                    let line = samples().map(|i| u64::from(net_single(i, key)));
                    let mut columns: Vec<u64> = line.map(|x| x >> (32 - m)).collect();
                    columns.sort_unstable();
                    assert!(columns.into_iter().eq(0..1 << m), "m {m} block {block} key {key}");
                }
            }
        }
    }

    #[test]
    fn test_detects_point_sets_that_are_no_nets() {
        let mut points: Vec<_> = (0..64).map(|i| net_pair(i, seeds(0))).collect();
        assert!(is_net(&points));
        points[17][1] ^= 1 << 26;
        assert!(!is_net(&points));
        assert!(!is_net(&(0..64).map(|i| [mix(i), mix(i + 64)]).collect::<Vec<_>>()));
        // Halves of two different blocks are no net.
        assert!(!is_net(&(32..96).map(|i| net_pair(i, seeds(0))).collect::<Vec<_>>()));
    }

    /// Over the seeds, each bit flips with probability 1/2. For `n` fair coins the standard deviation is `√n / 2`; six
    /// of them make a false alarm in 32 · 40 counts practically impossible.
    #[test]
    fn every_bit_flips_with_probability_one_half() {
        const N: u32 = 20_000;
        for x in (0..20).chain((0..20).map(mix)) {
            let mut flips = [0_u32; 32];
            for seed in 0..N {
                let changed = laine_karras(x, mix(seed)) ^ x;
                flips.iter_mut().enumerate().for_each(|(bit, n)| *n += changed >> bit & 1);
            }
            for (bit, n) in flips.into_iter().enumerate() {
                let off = (f64::from(n) - f64::from(N / 2)).abs();
                assert!(off < 6.0 * f64::from(N).sqrt() / 2.0, "x {x:#x} bit {bit}: {n} of {N}");
            }
        }
    }
}
