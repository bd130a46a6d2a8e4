use canted_lbvh::NodeId;

use crate::{
    pairs::{Pairs, Slot},
    par,
};

/// Nodes per job.
const CHUNK: usize = 1 << 14;

/// Bits of a digit by which areas are selected: three cover all bits below the sign.
const DIGIT: u32 = 11;

/// The `n` slots with the largest boxes, except the root, in the order of their numbers; of equal boxes those with the lowest
/// numbers.
pub(crate) fn largest(pairs: &Pairs, n: usize) -> Vec<Slot> {
    // The last pair is the slot of the root. Areas are not negative, so their bits are ordered.
    let (_, nodes) = pairs.pairs.split_last().unwrap_or((&pairs.pairs[0], &[]));
    let areas = par::map(nodes, CHUNK, |pair| pair.boxes.half_areas().map(f32::to_bits));
    let Some(Least { area: least, equal }) = nth_largest(&areas, n) else {
        return (0..nodes.len()).flat_map(slots).collect();
    };
    // As many of the least area in each chunk as those before leave room for.
    let leave = |left: &mut usize, n: &usize| Some(std::mem::replace(left, left.saturating_sub(*n)));
    let wanted: Vec<usize> = equal.counts.iter().scan(equal.wanted, leave).collect();
    let parts = par::map_chunks(&wanted, 1, |i, wanted| {
        let mut n_least = wanted[0];
        let mut taken = vec![];
        let first = i * CHUNK;
        for (node, areas) in (first..).zip(&areas[first..areas.len().min(first + CHUNK)]) {
            for (slot, area) in slots(node).into_iter().zip(areas) {
                let is_least = *area == least && n_least > 0;
                n_least -= usize::from(is_least);
                if *area > least || is_least {
                    taken.push(slot);
                }
            }
        }
        taken
    });
    parts.concat()
}

#[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes")]
fn slots(node: usize) -> [Slot; 2] {
    [0, 1].map(|side| Slot::new(NodeId(node as u32), side))
}

/// The least area of those selected.
struct Least {
    area: u32,
    equal: Equal,
}

/// How many slots of the least area there are in each chunk of nodes, and how many are wanted.
struct Equal {
    counts: Vec<usize>,
    wanted: usize,
}

/// The `n`-th largest area, by one digit after the other; `None` where there are no more than `n`.
fn nth_largest(areas: &[[u32; 2]], n: usize) -> Option<Least> {
    if n >= 2 * areas.len() {
        return None;
    }
    let (mut area, mut known, mut wanted) = (0, 0, n);
    let mut counts = vec![];
    for shift in [2 * DIGIT, DIGIT, 0] {
        let parts = par::map_chunks(areas, CHUNK, |_, areas| {
            let mut counts = [0u32; 1 << DIGIT];
            for bits in areas.as_flattened().iter().filter(|&bits| bits & known == area) {
                counts[digit(*bits, shift)] += 1;
            }
            counts
        });
        let of = |digit: usize| parts.iter().map(|counts| counts[digit] as usize).sum::<usize>();
        let mut here = (1 << DIGIT) - 1;
        let mut n_here = of(here);
        while n_here < wanted {
            wanted -= n_here;
            here -= 1;
            n_here = of(here);
        }
        counts = parts.iter().map(|counts| counts[here] as usize).collect();
        #[expect(clippy::cast_possible_truncation, reason = "less than 2^11")]
        let here = here as u32;
        area |= here << shift;
        known |= ((1 << DIGIT) - 1) << shift;
    }
    Some(Least { area, equal: Equal { counts, wanted } })
}

fn digit(bits: u32, shift: u32) -> usize {
    (bits >> shift) as usize & ((1 << DIGIT) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use canted_lbvh::{Bits, radix, sort_by_code};
    use canted_obb::Aabb;

    #[test]
    fn no_other_slot_is_larger() {
        // Boxes of few sizes, so that many areas are equal.
        let boxes: Vec<Aabb> = (0..200u8)
            .map(|i| Aabb { min: [f32::from(i), 0.0, 0.0], max: [f32::from(i) + f32::from(i % 3), 1.0, 2.0] })
            .collect();
        let tree = radix(sort_by_code(&(0..200).collect::<Vec<_>>(), Bits::B63));
        let pairs = Pairs::new(&tree, &boxes, 1.0);
        let area = |slot: Slot| pairs.pair(slot.node()).boxes.half_areas()[slot.side() as usize];
        let all = largest(&pairs, usize::MAX);
        assert_eq!(all.len(), 2 * tree.nodes.len());
        for n in [0, 1, 7, 100, 250, 397, 398] {
            let largest = largest(&pairs, n);
            assert_eq!(largest.len(), n);
            assert!(largest.is_sorted() && all.is_sorted());
            let least = largest.iter().map(|&slot| area(slot)).fold(f32::INFINITY, f32::min);
            let others = all.iter().filter(|slot| !largest.contains(slot));
            for &slot in others {
                assert!(area(slot) <= least, "{n}");
            }
        }
        // The check can fail: the areas differ.
        let areas: Vec<f32> = all.iter().map(|&slot| area(slot)).collect();
        assert!(areas.iter().any(|&area| area > areas[397]));
    }

    /// Several chunks, in which most areas are equal to others.
    #[test]
    fn equals_a_sort_over_several_chunks() {
        let n = 2 * u32::try_from(CHUNK).unwrap() + 777;
        let mut state = 5u64;
        let boxes: Vec<Aabb> = (0..n)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let size = f32::from(u8::try_from(state >> 58).unwrap());
                Aabb { min: [0.0; 3], max: [size, 1.0, 2.0] }
            })
            .collect();
        let tree = radix(sort_by_code(&(0..u64::from(n)).collect::<Vec<_>>(), Bits::B63));
        let pairs = Pairs::new(&tree, &boxes, 1.0);
        let area = |slot: Slot| pairs.pair(slot.node()).boxes.half_areas()[slot.side() as usize].to_bits();
        let mut sorted: Vec<Slot> = (0..tree.nodes.len()).flat_map(slots).collect();
        sorted.sort_by_key(|&slot| std::cmp::Reverse(area(slot)));
        for n in [1, 1_000, 20_001, 40_000, sorted.len() - 1] {
            let mut want = sorted[..n].to_vec();
            want.sort_unstable();
            assert!(largest(&pairs, n) == want, "{n}");
            want[n / 2] = want[0];
            assert!(largest(&pairs, n) != want || n == 1, "the check can fail");
        }
    }
}
