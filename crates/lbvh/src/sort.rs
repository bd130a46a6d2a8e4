use canted_obb::PrimId;

use crate::{Bits, par};

/// Primitives sorted by Morton code.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sorted {
    /// Codes in ascending order.
    pub codes: Vec<u64>,
    /// The primitive of each code; equal codes keep input order.
    pub leaves: Vec<PrimId>,
}

/// Bits of a radix digit: three passes cover the leading bits.
const DIGIT: u32 = 11;
const LEADING: u32 = 3 * DIGIT;
/// Bits of a key that hold the primitive; with [`LEADING`] they fill 64.
const INDEX: u32 = 64 - LEADING;

/// Sorts primitives by code, stably.
///
/// Reads: codes in input order. Writes: codes and primitives in sorted order.
/// Holds: the result of a stable sort, for any number of threads.
/// Source: LSD radix sort of the leading 33 bits; runs with equal leading bits are short except in degenerate meshes, and
/// are sorted by comparison. Each thread sorts a part, then the parts are merged.
#[must_use]
pub fn sort_by_code(codes: &[u64], bits: Bits) -> Sorted {
    let below = (3 * bits.per_axis()).saturating_sub(LEADING);
    let mut keys: Vec<u64> = vec![0; codes.len()];
    // One part per thread, but not so small that merging costs more than it saves.
    let part = codes.len().div_ceil(par::n_threads()).max(1 << 15);
    par::for_chunks(&mut keys, part, |first, part| {
        for (i, (key, code)) in part.iter_mut().zip(&codes[first..]).enumerate() {
            *key = (code >> below) << INDEX | (first + i) as u64;
        }
        let digits = LEADING.min(3 * bits.per_axis()).div_ceil(DIGIT);
        radix_sort(part, digits);
    });
    merge_parts(&mut keys, part);
    if below > 0 {
        finish_runs(&mut keys, codes);
    }
    collect(&keys, codes)
}

/// Sorts keys by their leading digits, lowest digit first; stable.
fn radix_sort(keys: &mut [u64], digits: u32) {
    let mut other = vec![0u64; keys.len()];
    let mut counts = vec![[0u32; 1 << DIGIT]; digits as usize];
    let digit = |key: u64, d: u32| (key >> (INDEX + d * DIGIT)) as usize & ((1 << DIGIT) - 1);
    for &key in keys.iter() {
        for (d, counts) in (0..).zip(&mut counts) {
            counts[digit(key, d)] += 1;
        }
    }
    let (mut from, mut to) = (&mut *keys, &mut *other);
    let mut swapped = false;
    for (d, counts) in (0..).zip(&mut counts) {
        // All keys share this digit: nothing moves.
        if from.first().is_some_and(|&key| counts[digit(key, d)] as usize == from.len()) {
            continue;
        }
        let mut start = 0;
        for count in counts.iter_mut() {
            start += std::mem::replace(count, start);
        }
        for &key in from.iter() {
            let slot = &mut counts[digit(key, d)];
            to[*slot as usize] = key;
            *slot += 1;
        }
        std::mem::swap(&mut from, &mut to);
        swapped = !swapped;
    }
    if swapped {
        to.copy_from_slice(from);
    }
}

/// Merges sorted parts of length `part` until one is left. Keys are unique, so the result is too.
fn merge_parts(keys: &mut Vec<u64>, mut part: usize) {
    while part < keys.len() {
        let mut merged = vec![0; keys.len()];
        par::for_chunks(&mut merged, 2 * part, |first, out| {
            let pair = &keys[first..first + out.len()];
            let (left, right) = pair.split_at(part.min(pair.len()));
            merge(left, right, out);
        });
        *keys = merged;
        part *= 2;
    }
}

/// Merges two sorted slices; both halves of the result in parallel.
fn merge(left: &[u64], right: &[u64], out: &mut [u64]) {
    let mid = out.len() / 2;
    // How many of the lowest `mid` keys come from the left: the crossing of the merge path.
    let (mut low, mut high) = (mid.saturating_sub(right.len()), mid.min(left.len()));
    while low < high {
        let from_left = low.midpoint(high);
        if left[from_left] < right[mid - from_left - 1] { low = from_left + 1 } else { high = from_left }
    }
    let (lower, upper) = out.split_at_mut(mid);
    let jobs = vec![(&left[..low], &right[..mid - low], lower), (&left[low..], &right[mid - low..], upper)];
    par::for_jobs(jobs, |(mut left, mut right, out)| {
        for slot in out {
            let take_left = match (left.first(), right.first()) {
                (Some(l), Some(r)) => l < r,
                (l, _) => l.is_some(),
            };
            let side = if take_left { &mut left } else { &mut right };
            *slot = side[0];
            *side = &side[1..];
        }
    });
}

/// Sorts each run of equal leading bits by the full code, then by input order.
fn finish_runs(keys: &mut [u64], codes: &[u64]) {
    let index = |key: u64| key & ((1 << INDEX) - 1);
    let mut first = 0;
    while first < keys.len() {
        let leading = keys[first] >> INDEX;
        let n = keys[first..].iter().take_while(|&&key| key >> INDEX == leading).count();
        if n > 1 {
            keys[first..first + n].sort_unstable_by_key(|&key| (codes[index(key) as usize], key));
        }
        first += n;
    }
}

fn collect(keys: &[u64], codes: &[u64]) -> Sorted {
    const CHUNK: usize = 1 << 14;
    let index = |key: u64| (key & ((1 << INDEX) - 1)) as usize;
    let mut sorted = Sorted { codes: vec![0; keys.len()], leaves: vec![PrimId(0); keys.len()] };
    par::for_chunks(&mut sorted.codes, CHUNK, |first, out| {
        for (out, &key) in out.iter_mut().zip(&keys[first..]) {
            *out = codes[index(key)];
        }
    });
    par::for_chunks(&mut sorted.leaves, CHUNK, |first, out| {
        for (out, &key) in out.iter_mut().zip(&keys[first..]) {
            *out = PrimId(index(key) as u32);
        }
    });
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn stable(codes: &[u64]) -> Sorted {
        let mut leaves: Vec<PrimId> = (0..codes.len() as u32).map(PrimId).collect();
        leaves.sort_by_key(|leaf| codes[leaf.index()]);
        Sorted { codes: leaves.iter().map(|leaf| codes[leaf.index()]).collect(), leaves }
    }

    fn pseudo_random(n: usize, distinct: u64, bits: u32) -> Vec<u64> {
        let mut state = n as u64 + distinct;
        (0..n)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                ((state >> 20) % distinct).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (64 - bits)
            })
            .collect()
    }

    #[test]
    fn equals_a_stable_sort() {
        for n in [0, 1, 2, 3, 255, 256, 257, 65_537, 200_000] {
            for distinct in [1, 2, 37, 1 << 40] {
                for (bits, length) in [(Bits::B30, 30), (Bits::B63, 63)] {
                    let codes = pseudo_random(n, distinct, length);
                    assert_eq!(
                        sort_by_code(&codes, bits),
                        stable(&codes),
                        "{n} codes, {distinct} distinct, {length} bits"
                    );
                }
            }
        }
    }

    proptest! {
        #[test]
        fn merges_any_two_sorted_slices(left in prop::collection::btree_set(any::<u64>(), 0..50),
                                          right in prop::collection::btree_set(any::<u64>(), 0..50)) {
            let mut want: Vec<u64> = left.difference(&right).chain(right.iter()).copied().collect();
            want.sort_unstable();
            let left: Vec<u64> = left.difference(&right).copied().collect();
            let right: Vec<u64> = right.into_iter().collect();
            let mut out = vec![0; want.len()];
            merge(&left, &right, &mut out);
            prop_assert_eq!(out, want);
        }
    }
}
