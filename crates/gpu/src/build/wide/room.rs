//! Room for the wide nodes of each tree, and what is known of them before the collapse.

use super::super::{Built, Range, count};
use super::MAX_LEAF;

/// Children of a node.
const WIDTH: u32 = 8;

/// As in `shared/node.wgsl`: a word that refers to nothing, the bit of leaves.
const EMPTY: u32 = 0x7fff_ffff;
const LEAF: u32 = 0x8000_0000;

/// Room for the trees of a level.
pub(super) struct Room {
    /// Most items of a leaf.
    pub(super) max_leaf: u32,
    pub(super) is_oriented: bool,
    /// The first unit of each tree, and the end.
    pub(super) first_units: Vec<u32>,
}

impl Room {
    pub(super) fn of(built: &Built) -> Self {
        let (max_leaf, is_oriented) = match built.items.corners() {
            Some(_) => (MAX_LEAF, built.obbs.is_some()),
            None => (1, false),
        };
        let size = if is_oriented { 2 } else { 1 };
        let mut end = 0;
        let mut first_units = vec![0];
        for range in built.items.ranges() {
            // The root is aligned.
            end += 1 + size * capacity(range.count, max_leaf);
            first_units.push(end);
        }
        Self { max_leaf, is_oriented, first_units }
    }

    pub(super) fn n_units(&self) -> u32 {
        self.first_units[self.first_units.len() - 1]
    }

    /// The units of a range of trees.
    pub(super) fn units(&self, [first, end]: [u32; 2]) -> [u32; 2] {
        [self.first_units[first as usize], self.first_units[end as usize]]
    }

    /// Most wide nodes of a level of trees with these ranges.
    pub(super) fn most(&self, ranges: &[Range]) -> u32 {
        ranges.iter().map(|range| capacity(range.count, self.max_leaf)).sum()
    }

    /// The root's word of each tree.
    pub(super) fn roots(&self, ranges: &[Range]) -> Vec<u32> {
        let root = |(range, &first_unit): (&Range, &u32)| match range.count {
            0 => EMPTY,
            n if n <= self.max_leaf => {
                // As in `shared/build/leaf.wgsl`.
                let part = if n <= 2 { range.first } else { range.first + (range.first & 1) };
                LEAF | (n - 1) << 26 | part
            }
            _ => 4 * first_unit,
        };
        ranges.iter().zip(&self.first_units).map(root).collect()
    }
}

/// Most wide nodes over `n` items.
///
/// A node that is not full has leaves only and more than `max_leaf` items of its own. With `E` of those and `F` full ones over
/// `n` items, 7 F is less than the number of other nodes and leaves: `7 F < E + n - (max_leaf + 1) E`, and `E <= n / (max_leaf +
/// 1)`.
fn capacity(n: u32, max_leaf: u32) -> u32 {
    if n <= max_leaf {
        return 0;
    }
    let n = u64::from(n);
    let most_not_full = n / u64::from(max_leaf + 1);
    let more = u64::from((WIDTH - 1).saturating_sub(max_leaf)) * most_not_full;
    count(usize::try_from((n + more).div_ceil(u64::from(WIDTH - 1))).unwrap_or(usize::MAX))
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;

    use super::*;

    /// Wide nodes over a tree of `n` items whose shape and areas are random, opened as `shared/build/wide.wgsl` does. A subtree is its
    /// number of items.
    fn collapsed(n: u32, max_leaf: u32, random: &mut SplitMix64, is_chain: bool) -> u32 {
        let mut open = vec![n];
        let mut n_nodes = 0;
        while let Some(n) = open.pop().filter(|&n| n > max_leaf) {
            n_nodes += 1;
            let mut children = vec![n];
            while children.len() < WIDTH as usize {
                let inner: Vec<usize> = (0..children.len()).filter(|&i| children[i] > max_leaf).collect();
                if inner.is_empty() {
                    break;
                }
                let n = children.swap_remove(inner[random.below(inner.len())]);
                let left = if is_chain { 1 } else { 1 + u32::try_from(random.below(n as usize - 1)).unwrap() };
                children.extend([left, n - left]);
            }
            open.extend(children.into_iter().filter(|&n| n > max_leaf));
        }
        n_nodes
    }

    #[test]
    fn no_collapse_exceeds_its_room() {
        let mut random = SplitMix64::new(11);
        let mut fullest = 0.0_f64;
        for round in 0..4000_u32 {
            let n = [round % 60, round % 977, 5 * (round % 13)][round as usize % 3];
            for max_leaf in [1, MAX_LEAF] {
                let n_nodes = collapsed(n, max_leaf, &mut random, round % 5 == 0);
                assert!(n_nodes <= capacity(n, max_leaf), "{n} items, leaves of {max_leaf}: {n_nodes} nodes");
                if n > 100 {
                    fullest = fullest.max(f64::from(n_nodes) / f64::from(capacity(n, max_leaf)));
                }
            }
        }
        // Half as much would not be enough.
        assert!(fullest > 0.5, "{fullest}");
    }
}
