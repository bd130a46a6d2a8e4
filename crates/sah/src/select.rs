use canted_lbvh::NodeId;

use crate::{
    pairs::{Pairs, Slot},
    par,
};

/// Slots per job.
const CHUNK: usize = 1 << 13;

/// The `n` slots with the largest boxes, except the root, in the order of their numbers; of equal boxes those with the lowest
/// numbers.
pub(crate) fn largest(pairs: &Pairs, n: usize) -> Vec<Slot> {
    // The last pair is the slot of the root.
    let n_nodes = pairs.pairs.len() - 1;
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes")]
    let slots = |node: usize| [0, 1].map(|side| Slot::new(NodeId(node as u32), side));
    // Areas are not negative, so their bits are ordered.
    let areas = par::from_fn(n_nodes, CHUNK, |node| pairs.pairs[node].boxes.half_areas().map(f32::to_bits));
    let mut sorted = areas.as_flattened().to_vec();
    if n >= sorted.len() {
        return (0..n_nodes).flat_map(slots).collect();
    }
    let (larger, &mut least, _) = sorted.select_nth_unstable_by(n, |a, b| b.cmp(a));
    // As many of the least area as the others leave room for.
    let mut n_least = n - larger.iter().filter(|&&area| area > least).count();
    let mut largest = Vec::with_capacity(n);
    for (node, areas) in areas.iter().enumerate() {
        for (slot, area) in slots(node).into_iter().zip(areas) {
            let is_taken = *area > least || *area == least && n_least > 0;
            n_least -= usize::from(is_taken && *area == least);
            if is_taken {
                largest.push(slot);
            }
        }
    }
    largest
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
}
