use canted_lbvh::{Child, NodeId};

use crate::{
    lanes::Lanes,
    pairs::{Pairs, Slot},
    search::Move,
};

impl Pairs {
    /// Moves a subtree if that still is a gain; returns by how much the sum of half areas falls.
    ///
    /// Moves found on the same tree may spoil each other, so each is made, weighed in `f64`, and taken back if the
    /// areas do not fall. Refused too are moves that no longer make a tree, because the subtree has become the root or the
    /// target has come to lie in it, and moves that make one deeper than `max_depth`.
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

    /// Takes `subtree` out and puts it beside `target`; returns the change of the sum of half areas.
    ///
    /// The subtree's parent moves with it, so nodes keep their numbers.
    fn relocate(&mut self, subtree: Child, target: Child) -> f64 {
        let slot = self.slot(subtree);
        let parent = slot.node();
        let (moved, sibling, rest) = (self.aabb(slot), self.child(slot.sibling()), self.aabb(slot.sibling()));
        let left_behind = self.pair(parent).parent;
        let before = moved.union(&rest).exact_half_area();
        self.put(left_behind, sibling, &rest);

        let place = self.slot(target);
        let aabb = self.aabb(place);
        self.put(Slot::new(parent, 0), target, &aabb);
        self.put(Slot::new(parent, 1), subtree, &moved);
        let around: Lanes = aabb.union(&moved);
        self.put(place, Child::inner(parent), &around);
        self.pairs[parent.index()].height = 1 + self.height(target).max(self.height(subtree));
        // The grown side first: the lowest node above both places then changes in neither walk.
        around.exact_half_area() - before + self.refit(place.node()) + self.refit(left_behind.node())
    }

    /// Brings boxes and heights up to date from `node` up to the first that does not change; returns the change of
    /// the sum of half areas.
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
