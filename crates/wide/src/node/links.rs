//! What changes of single primitives need besides the records: parents, contents without pads, who holds a primitive, and memory that is
//! free.

use canted_obb::Aabb;

use super::NodeKind;

/// What the boxes around a leaf or a node depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Content {
    /// Object space.
    pub(crate) bounds: Aabb,
    /// The boxes of all items in the mesh frame, together, relative to the reference point.
    pub(crate) aligned: Aabb,
    /// Greatest coordinate relative to the reference point.
    pub(crate) reach: f32,
}

impl Content {
    pub(crate) const EMPTY: Self = Self { bounds: Aabb::EMPTY, aligned: Aabb::EMPTY, reach: 0.0 };

    pub(crate) fn union(self, other: Self) -> Self {
        Self {
            bounds: self.bounds.union(other.bounds),
            aligned: self.aligned.union(other.aligned),
            reach: self.reach.max(other.reach),
        }
    }

    /// The union of several contents after one of them, `old`, has become `new`; `None` where that depends on the others.
    pub(crate) fn after_change(self, Change { old, new }: &Change) -> Option<Self> {
        let bounds = self.bounds.after_change(&old.bounds, &new.bounds)?;
        let aligned = self.aligned.after_change(&old.aligned, &new.aligned)?;
        let is_known = old.reach < self.reach || old.reach <= new.reach;
        is_known.then(|| Self { bounds, aligned, reach: self.reach.max(new.reach) })
    }
}

/// What something in a node was and is; empty before it came, and after it went.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change {
    pub(crate) old: Content,
    pub(crate) new: Content,
}

/// The parent of a root, and of what is no node.
pub(crate) const NO_NODE: u32 = u32::MAX;

/// A node, by its number: its first line over the lines of an aligned node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Link {
    /// Number of the node above.
    pub(crate) parent: u32,
    pub(crate) kind: NodeKind,
    pub(crate) content: Content,
}

impl Link {
    /// Of a node that has no parent and no child yet.
    pub(crate) const NEW: Self = Self { parent: NO_NODE, kind: NodeKind::Aligned, content: Content::EMPTY };
}

/// See the module. Made by the first change of a single primitive, kept up to date by the following ones.
#[derive(Clone, Debug, Default)]
pub(crate) struct Links {
    pub(crate) nodes: Vec<Link>,
    /// By primitive the number of the node above its leaf.
    pub(crate) holders: Vec<u32>,
    /// Numbers of nodes that are not used, the next one last.
    pub(crate) free_nodes: Vec<u32>,
    /// Positions of leaves that are not used, the next one last.
    pub(crate) free_places: Vec<u32>,
    /// Sums over all boxes, as a refit computes them.
    pub(crate) area: Total,
    pub(crate) weighted: Total,
    pub(crate) visits: Total,
    /// The depth that the BVH had at first.
    pub(crate) first_depth: u32,
    /// Most primitives since then.
    pub(crate) most_primitives: usize,
    /// Moves so far.
    pub(crate) n_moves: u32,
    /// Whether records may be anywhere, and some of them unused.
    pub(crate) is_scattered: bool,
}

impl Links {
    /// The greatest depth that changes may lead to: where a path becomes longer, a subtree with more than half of the primitives of its
    /// parent is above, and that is balanced.
    pub(crate) fn most_depth(&self) -> u32 {
        self.first_depth.max(self.most_primitives.max(1).ilog2() + 2)
    }

    pub(crate) fn n_bytes(&self) -> usize {
        let words = self.holders.len() + self.free_nodes.len() + self.free_places.len();
        size_of::<Self>() + size_of_val(&self.nodes[..]) + size_of::<u32>() * words
    }
}

/// A sum of numbers that come and go, with what its roundings lost: a great number that goes leaves the small ones behind.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Total {
    sum: f64,
    rest: f64,
}

impl Total {
    /// Adds a number, with the rounding error of the sum (Knuth 1969).
    pub(crate) fn add(&mut self, x: f64) {
        let sum = self.sum + x;
        let part = sum - self.sum;
        self.rest += (self.sum - (sum - part)) + (x - part);
        self.sum = sum;
    }

    /// The sum, which is known not to be negative.
    pub(crate) fn get(self) -> f64 {
        (self.sum + self.rest).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_added_and_subtracted_leaves_the_rest() {
        let mut total = Total::default();
        // In f64, 1 is lost next to 2^60.
        let great = (1_u64 << 60) as f64;
        for x in [0.1, great, 0.2, great, -great, 0.3, -great] {
            total.add(x);
        }
        assert!((total.get() - 0.6).abs() < 1e-15, "{}", total.get());
        total.add(-1.0);
        assert_eq!(total.get(), 0.0);
    }
}
