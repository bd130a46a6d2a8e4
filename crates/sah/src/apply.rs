use canted_lbvh::{Child, NodeId};

use crate::{
    lanes::Lanes,
    pairs::{Pairs, Slot},
    search::Move,
};

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
