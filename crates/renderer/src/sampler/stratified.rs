//! Strata and permutations for any number of samples.

use super::{STEPS, mix, unit};

/// A number in stratum `k` of `n`: a multiple `x` of 2⁻²⁴ with `k/n <= x < (k + 1)/n`, exactly.
///
/// For more than 2²⁴ strata, some contain no such multiple; they use the next larger one.
pub(super) fn jittered(k: u32, n: u32, random: u32) -> f32 {
    let (low, width) = if n.is_power_of_two() && u64::from(n) <= STEPS {
        // Same result as below, without divisions.
        let width = STEPS >> n.trailing_zeros();
        (u64::from(k) * width, width)
    } else {
        let first = |k: u64| (k * STEPS).div_ceil(u64::from(n));
        let low = first(u64::from(k));
        (low, first(u64::from(k) + 1) - low)
    };
    let steps = low + ((u64::from(random) * width) >> 32);
    unit(steps.min(STEPS - 1) as u32)
}

/// The image of `i < n` under a permutation of `0..n` selected by `key`.
///
/// Each round is a bijection of `0..2^k` for the smallest `2^k >= n`. Values outside `0..n` are permuted again (cycle
/// walking, Black and Rogaway 2002), less than twice on average. The final rotation of `0..n` makes every image equally
/// likely for small `n` too.
pub(super) fn permuted(mut i: u32, n: u32, key: u32) -> u32 {
    let bits = u32::BITS - (n - 1).leading_zeros();
    let mask = if bits == u32::BITS { u32::MAX } else { (1 << bits) - 1 };
    let shift = bits.div_ceil(2).max(1);
    let keys = [mix(key), mix(key ^ 1), mix(key ^ 2)];
    loop {
        for key in keys {
            // Addition and odd multiplication modulo 2^k, then xor-shift: all are invertible.
            i = i.wrapping_add(key).wrapping_mul(key >> 16 | 1) & mask;
            i ^= i >> shift;
        }
        if i < n {
            break;
        }
    }
    let rotation = ((u64::from(mix(key ^ 3)) * u64::from(n)) >> 32) as u32;
    // The sum modulo n, without overflow.
    let remaining = n - rotation;
    if i < remaining { i + rotation } else { i - remaining }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::mix;

    #[test]
    fn permutations_are_bijective() {
        for n in (1..=70).chain([97, 128, 1000, 1024, 1025]) {
            for key in 0..20 {
                let mut seen = vec![false; n as usize];
                for i in 0..n {
                    assert!(!std::mem::replace(&mut seen[permuted(i, n, mix(key)) as usize], true), "n {n} key {key}");
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
                    counts[permuted(i, n, mix(key)) as usize] += 1;
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
    fn numbers_lie_in_their_half_open_strata() {
        for n in [1_u32, 3, 6, 7, 16, 24, 64, 1009, 65_535, 65_536] {
            for k in [0, n / 2, n - 1] {
                for random in [0, 1, u32::MAX / 2, u32::MAX] {
                    let steps = f64::from(jittered(k, n, random)) * f64::from(n);
                    // The product may round, but never past an integer, because integers are representable.
                    assert!(f64::from(k) <= steps && steps < f64::from(k + 1), "stratum {k} of {n}: {steps}");
                }
            }
        }
    }
}
