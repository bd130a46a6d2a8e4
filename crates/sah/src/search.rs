use canted_lbvh::{Child, ChildKind, NodeId};

use crate::{
    lanes::Lanes,
    pairs::{Pairs, Slot},
};

/// A move of a subtree: it becomes the sibling of `target`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Move {
    pub(crate) subtree: Child,
    pub(crate) target: Child,
    /// Reduction of the sum of half areas if nothing else moves.
    pub(crate) gain: f32,
}

/// Maximum number of nodes visited per subtree; where boxes overlap so much that it is reached, no target is much better.
const MAX_VISITED: u32 = 1 << 10;

/// A node to visit, and the growth of its ancestors and itself if the subtree is inserted below.
type Pending = (NodeId, f32);

/// The search for the best target of a subtree.
struct Search<'a> {
    pairs: &'a Pairs,
    /// The subtree's box.
    moved: Lanes,
    /// Its half area: a lower bound of the cost of any target.
    least: f32,
    best: f32,
    target: Option<Child>,
    n_visited: u32,
    stack: &'a mut Vec<Pending>,
}

/// The best move of the subtree at `slot`, if any reduces the cost.
///
/// Removing the subtree removes its parent and shrinks its ancestors; inserting it next to a target adds a parent of both
/// and grows the ancestors. The search climbs from the subtree to the root and descends into the sibling at each ancestor,
/// with branch and bound by the growth so far. `stack` is empty before and after.
/// Source: Bittner et al. 2013; the climbing after Meister & Bittner 2018, with ancestors as targets too.
pub(crate) fn best_move(pairs: &Pairs, slot: Slot, stack: &mut Vec<Pending>) -> Option<Move> {
    let subtree = pairs.child(slot);
    let moved = pairs.aabb(slot);
    let least = moved.half_area();
    let mut search = Search { pairs, moved, least, best: 0.0, target: None, n_visited: 0, stack };
    let parent = pairs.pair(slot.node());
    // The reduction below the current ancestor, and the box of its child on the path without the subtree.
    let mut saved = parent.boxes.around().half_area();
    let mut rest = pairs.aabb(slot.sibling());
    search.below(slot.sibling(), saved);
    let mut here = parent.parent;
    while here != pairs.top() {
        let above = pairs.pair(here.node());
        search.below(here.sibling(), saved);
        rest = rest.union(&pairs.aabb(here.sibling()));
        let area = above.boxes.around().half_area();
        saved += area - rest.half_area();
        // The ancestor as the target: the new parent is as large as the ancestor was.
        search.consider(Child::inner(here.node()), saved - area);
        here = above.parent;
    }
    let gain = search.best;
    search.target.map(|target| Move { subtree, target, gain })
}

impl Search<'_> {
    fn consider(&mut self, target: Child, gain: f32) {
        if gain > self.best {
            (self.best, self.target) = (gain, Some(target));
        }
    }

    /// Considers the subtree at `slot` and everything below it.
    fn below(&mut self, slot: Slot, saved: f32) {
        if saved - self.least <= self.best {
            return;
        }
        let side = slot.side() as usize;
        let pair = self.pairs.pair(slot.node());
        let (own, joined) = (pair.boxes.half_areas()[side], pair.boxes.union(&self.moved).half_areas()[side]);
        self.visit(pair.children[side], own, joined, saved, 0.0);
        while let Some((node, grown)) = self.stack.pop() {
            if saved - grown - self.least <= self.best || self.n_visited == MAX_VISITED {
                continue;
            }
            self.n_visited += 1;
            let pair = self.pairs.pair(node);
            let own = pair.boxes.half_areas();
            let joined = pair.boxes.union(&self.moved).half_areas();
            // The child that grows less is pushed last, so it is visited first.
            let first = usize::from(joined[1] - own[1] < joined[0] - own[0]);
            for side in [1 - first, first] {
                self.visit(pair.children[side], own[side], joined[side], saved, grown);
            }
        }
    }

    /// Considers `child` as a target and pushes its subtree.
    fn visit(&mut self, child: Child, own: f32, joined: f32, saved: f32, grown: f32) {
        self.consider(child, saved - grown - joined);
        let grown = grown + (joined - own);
        if let ChildKind::Inner(id) = child.kind()
            && saved - grown - self.least > self.best
        {
            self.stack.push((id, grown));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canted_lbvh::{Bits, radix, sort_by_code};
    use canted_obb::Aabb;
    use proptest::prelude::*;

    /// Rounding of a gain relative to the sum of areas on the path: two per level of at most 62, and a few per area.
    const GAIN_ERROR: f64 = 64.0 * f32::EPSILON as f64;

    fn tree_over(centers: &[[f32; 3]]) -> Pairs {
        let tree = radix(sort_by_code(&(0..centers.len() as u64).collect::<Vec<_>>(), Bits::B63));
        let boxes: Vec<_> = centers.iter().map(|c| Aabb { min: *c, max: c.map(|x| x + 0.25) }).collect();
        Pairs::new(&tree, &boxes, 1.0)
    }

    /// The greatest reduction of all targets, by trying each.
    fn best_of_all(pairs: &Pairs, slot: Slot) -> f64 {
        let subtree = pairs.child(slot);
        let n = u32::try_from(pairs.pairs.len()).unwrap();
        let targets = (0..n - 1).map(|i| Child::inner(NodeId(i))).chain((0..n).map(Child::leaf));
        let gain = |target| pairs.clone().apply(&Move { subtree, target, gain: 0.0 }, u32::MAX);
        targets.filter_map(gain).fold(0.0, f64::max)
    }

    proptest! {
        #[test]
        fn no_target_is_better_than_the_one_found(
            cells in prop::collection::vec(prop::array::uniform3(-4i8..5), 3..24),
        ) {
            let pairs = tree_over(&cells.iter().map(|c| c.map(f32::from)).collect::<Vec<_>>());
            let total = pairs.sum_of_areas();
            for id in 0..u32::try_from(cells.len()).unwrap() - 1 {
                for side in 0..2 {
                    let slot = Slot::new(NodeId(id), side);
                    let found = best_move(&pairs, slot, &mut vec![]);
                    let made = found.and_then(|found| pairs.clone().apply(&found, u32::MAX)).unwrap_or(0.0);
                    let promised = found.map_or(0.0, |found| f64::from(found.gain));
                    let best = best_of_all(&pairs, slot);
                    prop_assert!((made - promised).abs() <= GAIN_ERROR * total, "{promised} expected, {made} found");
                    prop_assert!(best - made <= GAIN_ERROR * total, "{made} instead of {best}");
                }
            }
        }
    }
}
