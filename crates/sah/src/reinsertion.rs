//! Reinsertion: pairs of sibling boxes -> { select -> search -> apply } per iteration -> tree.

use canted_lbvh::{Child, ChildKind, MAX_DEPTH, NodeId, Tree, stages::stage};
use canted_obb::Aabb;

use crate::{
    par,
    reference::{Lanes, unit_scale},
};

/// How far [`reinsert`] improves a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReinsertConfig {
    /// Maximum number of iterations.
    pub iterations: u32,
    /// Fraction of all nodes and leaves, those of largest area first, that the first iteration tries to move; iteration
    /// `i` tries `1 / (2i + 1)` of it. At most 1.
    pub fraction: f32,
    /// The first iteration that reduces the sum of areas by less than this fraction is the last.
    pub min_gain: f32,
}

impl ReinsertConfig {
    /// For trees that are traced once or twice.
    pub const FAST: Self = Self { iterations: 4, fraction: 0.05, min_gain: 1e-3 };

    /// Most of the gain.
    pub const BALANCED: Self = Self { iterations: 12, fraction: 0.1, min_gain: 1e-3 };

    /// Nearly all of the gain; `benches/TRIED.md` lists what larger settings add.
    pub const QUALITY: Self = Self { iterations: 8, fraction: 0.5, min_gain: 1e-3 };
}

impl Default for ReinsertConfig {
    fn default() -> Self {
        Self::BALANCED
    }
}

/// Subtrees per job.
const CHUNK: usize = 64;

/// Moves subtrees to positions that reduce the sum of the surface areas of all boxes.
///
/// Reads: a tree, the finite box of each leaf in leaf order. Writes: a tree over the same primitives with its own leaf
/// order. Holds: the sum of areas does not increase; the depth is at most that of the tree or [`MAX_DEPTH`], whichever is
/// greater; the same bits for any number of threads.
/// Source: Bittner, Hapala & Havran 2013; parallel search per iteration after Meister & Bittner 2018. Instead of locks,
/// each move is evaluated again when it is applied.
///
/// # Panics
/// If the numbers of boxes and leaves differ.
#[must_use]
pub fn reinsert(tree: &Tree, leaf_boxes: &[Aabb], config: &ReinsertConfig) -> Tree {
    assert_eq!(leaf_boxes.len(), tree.leaves.len(), "one box for each leaf");
    let Some(scale) = unit_scale(leaf_boxes) else { return tree.clone() };
    if tree.nodes.len() < 2 {
        return tree.clone();
    }
    let mut pairs = stage("reinsertion: set-up", || Pairs::new(tree, leaf_boxes, scale));
    let mut sum = pairs.sum_of_areas();
    let max_depth = tree.depth.max(MAX_DEPTH);
    let mut moved = false;
    for iteration in 0..config.iterations {
        let gain = improve(&mut pairs, n_searched(tree, config, iteration), max_depth);
        moved |= gain > 0.0;
        sum -= gain;
        if gain <= f64::from(config.min_gain) * sum {
            break;
        }
    }
    if !moved {
        return tree.clone();
    }
    stage("reinsertion: new order", || {
        let ChildKind::Inner(root) = pairs.child(pairs.top()).kind() else { return tree.clone() };
        Tree::numbered(tree.leaves.len(), root, |id| pairs.pair(id).children, |leaf| tree.leaves[leaf as usize])
    })
}

/// One iteration over the `n` largest boxes; returns the reduction of the sum of half areas.
fn improve(pairs: &mut Pairs, n: usize, max_depth: u32) -> f64 {
    let mut moves = stage("reinsertion: search", || {
        let slots = largest(pairs, n);
        let found = par::map_chunks(&slots, CHUNK, |_, slots| {
            let mut stack = vec![];
            slots.iter().filter_map(|&slot| best_move(pairs, slot, &mut stack)).collect::<Vec<_>>()
        });
        found.concat()
    });
    stage("reinsertion: moves", || {
        moves.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        moves.iter().filter_map(|found| pairs.apply(found, max_depth)).sum()
    })
}

/// Number of subtrees searched in an iteration.
fn n_searched(tree: &Tree, config: &ReinsertConfig, iteration: u32) -> usize {
    let n_nodes = 2 * tree.nodes.len();
    let fraction = f64::from(config.fraction.min(1.0)) / f64::from(2 * iteration + 1);
    ((n_nodes as f64 * fraction).ceil() as usize).min(n_nodes)
}

/// Nodes per job.
const PAIRS_PER_JOB: usize = 1 << 13;

/// An inner node with the boxes of its children: one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Pair {
    pub(crate) boxes: Lanes,
    pub(crate) children: [Child; 2],
    /// The slot that refers to this node.
    pub(crate) parent: Slot,
    /// Nodes on the longest path to a leaf, both ends included.
    pub(crate) height: u32,
}

/// Position of a child: twice the number of the parent, plus one for the right child.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Slot(u32);

impl Slot {
    pub(crate) fn new(node: NodeId, side: u32) -> Self {
        Self(2 * node.0 + side)
    }

    pub(crate) fn node(self) -> NodeId {
        NodeId(self.0 >> 1)
    }

    pub(crate) fn side(self) -> u32 {
        self.0 & 1
    }

    pub(crate) fn sibling(self) -> Self {
        Self(self.0 ^ 1)
    }
}

/// A mutable tree: nodes store their parents and the boxes of their children.
///
/// Leaves are identified by their position in the original tree. An extra pair after the nodes has the root as its left
/// child, so that every node has a slot.
#[derive(Clone, Debug)]
pub(crate) struct Pairs {
    pub(crate) pairs: Vec<Pair>,
    pub(crate) leaf_parents: Vec<Slot>,
}

impl Pairs {
    /// The tree with boxes in units of `1 / scale`; at least two leaves.
    pub(crate) fn new(tree: &Tree, leaf_boxes: &[Aabb], scale: f32) -> Self {
        let unset = Pair { boxes: Lanes::UNSET, children: [Child::inner(NodeId::ROOT); 2], parent: Slot(0), height: 1 };
        let mut pairs = par::filled(tree.leaves.len(), unset);
        let mut leaf_parents = par::filled(tree.leaves.len(), Slot(0));
        let fill = |ids: &[NodeId], pairs: &mut [Pair], leaf_parents: &mut [Slot], base: u32| {
            for &id in ids {
                let node = tree.nodes[id.index()];
                let mut pair = Pair { children: [node.left, node.right], ..unset };
                for (side, child) in (0..).zip(pair.children) {
                    let slot = Slot::new(id, side);
                    let (aabb, height) = match child.kind() {
                        ChildKind::Leaf(position) => {
                            leaf_parents[(position - base) as usize] = slot;
                            (Lanes::of(&leaf_boxes[position as usize], scale), 1)
                        }
                        ChildKind::Inner(below) => {
                            let below = &mut pairs[(below.0 - base) as usize];
                            below.parent = slot;
                            (below.boxes.around(), below.height)
                        }
                    };
                    pair.boxes = pair.boxes.with(side, &aabb);
                    pair.height = pair.height.max(1 + height);
                }
                pairs[(id.0 - base) as usize] = pair;
            }
        };
        // Each task owns a slice of every array; the nodes above follow. Leaves directly below those are in no task.
        let mut jobs = Vec::with_capacity(tree.tasks.len());
        let (mut pairs_left, mut parents_left, mut done, mut tops) = (&mut pairs[..], &mut leaf_parents[..], 0, 0);
        for task in &tree.tasks {
            let (gap, n) = ((task.leaves.start - done) as usize, task.leaves.len());
            let (own_pairs, rest) = pairs_left[gap..].split_at_mut(n);
            let (own_parents, parents_rest) = parents_left[gap..].split_at_mut(n);
            (pairs_left, parents_left, done, tops) = (rest, parents_rest, task.leaves.end, task.nodes.end);
            jobs.push((&tree.bottom_up[task.nodes.clone()], own_pairs, own_parents, task.leaves.start));
        }
        par::for_jobs(jobs, |(ids, pairs, leaf_parents, base)| fill(ids, pairs, leaf_parents, base));
        fill(&tree.bottom_up[tops..], &mut pairs, &mut leaf_parents, 0);
        let mut pairs = Self { pairs, leaf_parents };
        pairs.put(pairs.top(), Child::inner(NodeId::ROOT), &pairs.pairs[0].boxes.around());
        pairs
    }

    /// The slot of the root.
    pub(crate) fn top(&self) -> Slot {
        Slot::new(NodeId(self.pairs.len() as u32 - 1), 0)
    }

    #[inline]
    pub(crate) fn pair(&self, node: NodeId) -> &Pair {
        &self.pairs[node.index()]
    }

    #[inline]
    pub(crate) fn child(&self, slot: Slot) -> Child {
        self.pair(slot.node()).children[slot.side() as usize]
    }

    /// The box in a slot.
    #[inline]
    pub(crate) fn aabb(&self, slot: Slot) -> Lanes {
        self.pair(slot.node()).boxes.side(slot.side())
    }

    #[inline]
    pub(crate) fn slot(&self, child: Child) -> Slot {
        match child.kind() {
            ChildKind::Leaf(position) => self.leaf_parents[position as usize],
            ChildKind::Inner(id) => self.pair(id).parent,
        }
    }

    #[inline]
    pub(crate) fn height(&self, child: Child) -> u32 {
        match child.kind() {
            ChildKind::Leaf(_) => 1,
            ChildKind::Inner(id) => self.pair(id).height,
        }
    }

    /// Stores a subtree and its box in a slot.
    pub(crate) fn put(&mut self, slot: Slot, child: Child, aabb: &Lanes) {
        match child.kind() {
            ChildKind::Leaf(position) => self.leaf_parents[position as usize] = slot,
            ChildKind::Inner(id) => self.pairs[id.index()].parent = slot,
        }
        let pair = &mut self.pairs[slot.node().index()];
        pair.children[slot.side() as usize] = child;
        pair.boxes = pair.boxes.with(slot.side(), aabb);
    }

    /// Sum of the half areas of all inner nodes.
    pub(crate) fn sum_of_areas(&self) -> f64 {
        let (_, nodes) = self.pairs.split_last().unwrap_or((&self.pairs[0], &[]));
        let of = |nodes: &[Pair]| nodes.iter().map(|pair| pair.boxes.around().exact_half_area()).sum::<f64>();
        par::map_chunks(nodes, PAIRS_PER_JOB, |_, nodes| of(nodes)).iter().sum()
    }
}

/// Nodes per job.
const AREAS_PER_JOB: usize = 1 << 14;

/// Bits of a digit by which areas are selected: three cover all bits below the sign.
const DIGIT: u32 = 11;

/// The `n` slots with the largest boxes, except the root, in the order of their numbers; of equal boxes those with the lowest
/// numbers.
pub(crate) fn largest(pairs: &Pairs, n: usize) -> Vec<Slot> {
    // The last pair is the slot of the root. Areas are not negative, so their bits are ordered.
    let (_, nodes) = pairs.pairs.split_last().unwrap_or((&pairs.pairs[0], &[]));
    let areas = par::map(nodes, AREAS_PER_JOB, |pair| pair.boxes.half_areas().map(f32::to_bits));
    let Some(Least { area: least, equal }) = nth_largest(&areas, n) else {
        return (0..nodes.len()).flat_map(slots).collect();
    };
    // As many of the least area in each chunk as those before leave room for.
    let leave = |left: &mut usize, n: &usize| Some(std::mem::replace(left, left.saturating_sub(*n)));
    let wanted: Vec<usize> = equal.counts.iter().scan(equal.wanted, leave).collect();
    let parts = par::map_chunks(&wanted, 1, |i, wanted| {
        let mut n_least = wanted[0];
        let mut taken = vec![];
        let first = i * AREAS_PER_JOB;
        for (node, areas) in (first..).zip(&areas[first..areas.len().min(first + AREAS_PER_JOB)]) {
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
        let parts = par::map_chunks(areas, AREAS_PER_JOB, |_, areas| {
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
        let here = here as u32;
        area |= here << shift;
        known |= ((1 << DIGIT) - 1) << shift;
    }
    Some(Least { area, equal: Equal { counts, wanted } })
}

fn digit(bits: u32, shift: u32) -> usize {
    (bits >> shift) as usize & ((1 << DIGIT) - 1)
}

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

impl Pairs {
    /// Moves a subtree if that still reduces the cost; returns the reduction of the sum of half areas.
    ///
    /// Moves found on the same tree may conflict, so each is applied, evaluated in `f64`, and undone if the sum does not
    /// decrease. Also rejected are moves that are no longer valid, because the subtree is now the root or contains the
    /// target, and moves that exceed `max_depth`.
    pub(crate) fn apply(&mut self, found: &Move, max_depth: u32) -> Option<f64> {
        let Move { subtree, target, .. } = *found;
        let slot = self.slot(subtree);
        if slot == self.top() {
            return None;
        }
        let parent = Child::inner(slot.node());
        let sibling = self.child(slot.sibling());
        if target == sibling || target == parent {
            return None;
        }
        let depth = self.depth_apart(target, subtree)? + 1 + self.height(target).max(self.height(subtree));
        if depth > max_depth {
            return None;
        }
        let change = self.relocate(subtree, target);
        if change < 0.0 {
            return Some(-change);
        }
        self.relocate(subtree, sibling);
        None
    }

    /// Number of nodes above `child`; `None` where one of them is `other`, or it is `other`.
    fn depth_apart(&self, mut child: Child, other: Child) -> Option<u32> {
        let root = self.child(self.top());
        let mut depth = 0;
        while child != root {
            if child == other {
                return None;
            }
            child = Child::inner(self.slot(child).node());
            depth += 1;
        }
        Some(depth)
    }

    /// Removes `subtree` and inserts it as the sibling of `target`; returns the change of the sum of half areas.
    ///
    /// Its parent moves along, so nodes keep their numbers.
    fn relocate(&mut self, subtree: Child, target: Child) -> f64 {
        let slot = self.slot(subtree);
        let parent = slot.node();
        let (moved, sibling, rest) = (self.aabb(slot), self.child(slot.sibling()), self.aabb(slot.sibling()));
        let old_slot = self.pair(parent).parent;
        let before = moved.union(&rest).exact_half_area();
        self.put(old_slot, sibling, &rest);

        let new_slot = self.slot(target);
        let aabb = self.aabb(new_slot);
        self.put(Slot::new(parent, 0), target, &aabb);
        self.put(Slot::new(parent, 1), subtree, &moved);
        let around: Lanes = aabb.union(&moved);
        self.put(new_slot, Child::inner(parent), &around);
        self.pairs[parent.index()].height = 1 + self.height(target).max(self.height(subtree));
        // The side that grew first: their lowest common ancestor then changes only once.
        around.exact_half_area() - before + self.refit(new_slot.node()) + self.refit(old_slot.node())
    }

    /// Updates boxes and heights from `node` upward until nothing changes; returns the change of the sum of half areas.
    fn refit(&mut self, mut node: NodeId) -> f64 {
        let mut change = 0.0;
        while node != self.top().node() {
            let pair = self.pair(node);
            let (around, slot) = (pair.boxes.around(), pair.parent);
            let height = 1 + self.height(pair.children[0]).max(self.height(pair.children[1]));
            let old = self.aabb(slot);
            if old == around && height == pair.height {
                break;
            }
            change += around.exact_half_area() - old.exact_half_area();
            self.pairs[node.index()].height = height;
            self.put(slot, Child::inner(node), &around);
            node = slot.node();
        }
        change
    }
}

#[cfg(test)]
mod tests {
    use canted_lbvh::{Bits, radix, sort_by_code};
    use canted_obb::Aabb;
    use proptest::prelude::*;

    use super::*;

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
        let n = 2 * u32::try_from(AREAS_PER_JOB).unwrap() + 777;
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
