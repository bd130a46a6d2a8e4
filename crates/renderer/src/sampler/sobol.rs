//! Points of a scrambled (0,2)-sequence in base 2: of any `2^m` samples that begin at a multiple of `2^m`, each of the
//! intervals `[a/2^i, (a+1)/2^i) x [b/2^j, (b+1)/2^j)` with `i + j = m` holds exactly one.
//!
//! The sequence is the first two dimensions of Sobol 1967, scrambled as Owen 1995 says: one bit of a coordinate is
//! flipped or not by chance, and that chance depends on all bits before it. After Burley 2020, *Practical Hash-based Owen
//! Scrambling*, a hash in which bits only reach higher ones does so without a tree, and the same hash shuffles the
//! numbers of the samples: so every use of the sequence is a sequence of its own, and uses pad each other.

/// A point with coordinates in units of 2⁻³², for sample `sample` of the sequence that `seeds` choose: the first
/// shuffles the samples, the other two scramble a coordinate each. Seeds are hashes: every bit of them counts.
pub(super) fn pair(sample: u32, seeds: [u32; 3]) -> [u32; 2] {
    let index = shuffled(sample, seeds[0]);
    [scrambled(index, seeds[1]), scrambled(second(index), seeds[2])]
}

/// One coordinate, as [`pair`] has two.
pub(super) fn single(sample: u32, seeds: [u32; 2]) -> u32 {
    scrambled(shuffled(sample, seeds[0]), seeds[1])
}

/// The number that sample `index` is given: any aligned `2^m` of them are turned into an aligned `2^m`.
fn shuffled(index: u32, seed: u32) -> u32 {
    upwards(index.reverse_bits(), seed).reverse_bits()
}

/// The coordinate whose bits, the greatest lowest, are `mirrored`, after scrambling.
fn scrambled(mirrored: u32, seed: u32) -> u32 {
    upwards(mirrored, seed).reverse_bits()
}

/// The second coordinate of point `index` before scrambling, mirrored; the first is `index` itself.
///
/// Bit `j` is the sum modulo 2 of the bits `k` of the index for which the binomial `C(k, j)` is odd, which are those
/// whose number `k` has all bits that `j` has: five steps sum over one bit of `k` each.
fn second(index: u32) -> u32 {
    [(1, 0x5555_5555), (2, 0x3333_3333), (4, 0x0f0f_0f0f), (8, 0x00ff_00ff), (16, 0x0000_ffff)]
        .into_iter()
        .fold(index, |bits, (step, mask)| bits ^ (bits >> step & mask))
}

/// A bijection of 32 bits in which a bit changes by chance with those below it, and with none above.
///
/// Sums, products with odd numbers, and `x ^ x·even` reach upwards only (Laine and Karras 2011). The constants are
/// those that Vegdahl found by search in 2021, less biased than Burley's.
fn upwards(x: u32, seed: u32) -> u32 {
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

    /// Whether each elementary interval of the least size holds one of the `2^m` points.
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
    fn the_second_coordinate_follows_the_recurrence_of_its_polynomial() {
        // Direction numbers of the polynomial x + 1: v[k + 1] = v[k] ^ v[k] / 2.
        let directions: Vec<u32> = std::iter::successors(Some(1 << 31), |v| Some(v ^ v >> 1)).take(32).collect();
        for index in (0..4096).chain((0..4096).map(mix)) {
            let sum = (0..32).filter(|k| index >> k & 1 == 1).fold(0, |sum, k| sum ^ directions[k]);
            assert_eq!(second(index).reverse_bits(), sum, "index {index}");
        }
    }

    #[test]
    fn aligned_runs_are_nets_before_and_after_scrambling() {
        for m in 0..=12 {
            for run in [0, 1, 5] {
                let samples = || (run << m)..((run + 1) << m);
                let plain: Vec<_> = samples().map(|i: u32| [i.reverse_bits(), second(i).reverse_bits()]).collect();
                assert!(is_net(&plain), "m {m} run {run}");
                for key in 0..20 {
                    let points: Vec<_> = samples().map(|i| pair(i, seeds(key))).collect();
                    assert!(is_net(&points), "m {m} run {run} key {key}");
                    let [shuffle, scramble, _] = seeds(key);
                    let line = samples().map(|i| u64::from(single(i, [shuffle, scramble])));
                    let mut columns: Vec<u64> = line.map(|x| x >> (32 - m)).collect();
                    columns.sort_unstable();
                    assert!(columns.into_iter().eq(0..1 << m), "m {m} run {run} key {key}");
                }
            }
        }
    }

    #[test]
    fn the_check_of_nets_sees_what_is_none() {
        let mut points: Vec<_> = (0..64).map(|i| pair(i, seeds(0))).collect();
        assert!(is_net(&points));
        points[17][1] ^= 1 << 26;
        assert!(!is_net(&points));
        assert!(!is_net(&(0..64).map(|i| [mix(i), mix(i + 64)]).collect::<Vec<_>>()));
        // Half a run from each of two: no net.
        assert!(!is_net(&(32..96).map(|i| pair(i, seeds(0))).collect::<Vec<_>>()));
    }

    /// Over the seeds, each bit should flip as often as not, whatever the bits below: for `n` fair coins the number of
    /// heads has deviation `√n / 2`, and six of them leave no room for chance in the 32 · 40 counts.
    #[test]
    fn every_bit_flips_by_chance() {
        const N: u32 = 20_000;
        for x in (0..20).chain((0..20).map(mix)) {
            let mut flips = [0_u32; 32];
            for seed in 0..N {
                let changed = upwards(x, mix(seed)) ^ x;
                flips.iter_mut().enumerate().for_each(|(bit, n)| *n += changed >> bit & 1);
            }
            for (bit, n) in flips.into_iter().enumerate() {
                let off = (f64::from(n) - f64::from(N / 2)).abs();
                assert!(off < 6.0 * f64::from(N).sqrt() / 2.0, "x {x:#x} bit {bit}: {n} of {N}");
            }
        }
    }
}
