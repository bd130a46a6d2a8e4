//! Owen-scrambled (0,2)-sequences in base 2: of every aligned block of `2^m` samples, each elementary interval
//! `[a/2^i, (a+1)/2^i) x [b/2^j, (b+1)/2^j)` with `i + j = m` contains exactly one.
//!
//! The sequence is the first two dimensions of Sobol 1967 with Owen scrambling (1995): each bit of a coordinate is
//! flipped at random, depending on all higher bits. Following Burley 2020, *Practical Hash-based Owen Scrambling*, this
//! is done by a hash in which bits affect only higher bits, on reversed bits. The same hash shuffles the sample
//! indices, so that every use has an independent sequence (padding).

/// Point `sample` of the sequence selected by `seeds`, in units of 2⁻³². The first seed shuffles the samples, the
/// others scramble one coordinate each. Seeds must be hashes.
pub(super) fn pair(sample: u32, seeds: [u32; 3]) -> [u32; 2] {
    let index = shuffled(sample, seeds[0]);
    [scrambled(index, seeds[1]), scrambled(second(index), seeds[2])]
}

/// One coordinate of a sequence.
pub(super) fn single(sample: u32, seeds: [u32; 2]) -> u32 {
    scrambled(shuffled(sample, seeds[0]), seeds[1])
}

/// Shuffles sample indices; every aligned block of `2^m` maps to an aligned block.
fn shuffled(index: u32, seed: u32) -> u32 {
    laine_karras(index.reverse_bits(), seed).reverse_bits()
}

/// Scrambles a coordinate given in reversed bits.
fn scrambled(reversed: u32, seed: u32) -> u32 {
    laine_karras(reversed, seed).reverse_bits()
}

/// The second coordinate of point `index` without scrambling, in reversed bits; the first is `index` itself.
///
/// Bit `j` is the parity of the index bits `k` for which the binomial `C(k, j)` is odd: those for which `k` contains
/// all bits of `j`. Each of five steps sums over one bit of `k`.
fn second(index: u32) -> u32 {
    [(1, 0x5555_5555), (2, 0x3333_3333), (4, 0x0f0f_0f0f), (8, 0x00ff_00ff), (16, 0x0000_ffff)]
        .into_iter()
        .fold(index, |bits, (step, mask)| bits ^ (bits >> step & mask))
}

/// A bijective hash in which each bit depends only on itself and on lower bits (Laine and Karras 2011).
///
/// Sums, products with odd numbers, and `x ^ x·even` have this property. The constants are those of Vegdahl 2021, which
/// are less biased than Burley's.
fn laine_karras(x: u32, seed: u32) -> u32 {
    let x = x ^ x.wrapping_mul(0x3d20_adea);
    let x = x.wrapping_add(seed);
    let x = x.wrapping_mul(seed >> 16 | 1);
    let x = x ^ x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::mix;

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
                    let points: Vec<_> = samples().map(|i| pair(i, seeds(key))).collect();
                    assert!(is_net(&points), "m {m} block {block} key {key}");
                    let [shuffle, scramble, _] = seeds(key);
                    let line = samples().map(|i| u64::from(single(i, [shuffle, scramble])));
                    let mut columns: Vec<u64> = line.map(|x| x >> (32 - m)).collect();
                    columns.sort_unstable();
                    assert!(columns.into_iter().eq(0..1 << m), "m {m} block {block} key {key}");
                }
            }
        }
    }

    #[test]
    fn test_detects_point_sets_that_are_no_nets() {
        let mut points: Vec<_> = (0..64).map(|i| pair(i, seeds(0))).collect();
        assert!(is_net(&points));
        points[17][1] ^= 1 << 26;
        assert!(!is_net(&points));
        assert!(!is_net(&(0..64).map(|i| [mix(i), mix(i + 64)]).collect::<Vec<_>>()));
        // Halves of two different blocks are no net.
        assert!(!is_net(&(32..96).map(|i| pair(i, seeds(0))).collect::<Vec<_>>()));
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
