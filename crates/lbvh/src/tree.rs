use std::ops::Range;

use canted_obb::PrimId;

/// Maximum depth of a radix tree, in nodes from the root to a leaf, the leaf included: one for each of the 63 bits of a code
/// and the 32 bits of a position. Other builders keep to it, and traversal stacks hold it without allocating.
pub const MAX_DEPTH: u32 = 96;

/// Index of an inner node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct NodeId(pub u32);

impl NodeId {
    /// The root of a tree that has an inner node.
    pub const ROOT: Self = Self(0);

    /// The index as an array position.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A child reference: a leaf by its position in leaf order, or an inner node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct Child(u32);

/// A decoded child reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChildKind {
    /// Position in leaf order.
    Leaf(u32),
    /// An inner node.
    Inner(NodeId),
}

impl Child {
    const LEAF: u32 = 1 << 31;

    /// The leaf at `position` in leaf order.
    #[must_use]
    pub fn leaf(position: u32) -> Self {
        debug_assert!(position < Self::LEAF);
        Self(position | Self::LEAF)
    }

    /// An inner node.
    #[must_use]
    pub fn inner(id: NodeId) -> Self {
        debug_assert!(id.0 < Self::LEAF);
        Self(id.0)
    }

    /// Decodes the reference.
    #[inline]
    #[must_use]
    pub fn kind(self) -> ChildKind {
        if self.0 & Self::LEAF == 0 { ChildKind::Inner(NodeId(self.0)) } else { ChildKind::Leaf(self.0 & !Self::LEAF) }
    }
}

/// An inner node over the leaves `first..=last`.
///
/// A left child has the number of its last leaf, a right child that of its first, and the root is 0 (Karras 2012). So the
/// nodes of a subtree have numbers in the range of its leaves, and disjoint subtrees own disjoint slices of every array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node {
    /// The child with the lower leaves.
    pub left: Child,
    /// The child with the upper leaves.
    pub right: Child,
    /// First leaf below.
    pub first: u32,
    /// Last leaf below (inclusive).
    pub last: u32,
}

impl Node {
    pub(crate) const UNSET: Self = Self { left: Child(0), right: Child(0), first: 0, last: 0 };

    /// Number of leaves below.
    #[must_use]
    pub fn n_leaves(&self) -> u32 {
        self.last - self.first + 1
    }
}

/// A subtree that is processed by one thread.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Task {
    /// Leaves of the subtree; its nodes have numbers in this range.
    pub leaves: Range<u32>,
    /// Its nodes, children before parents: a range of [`Tree::bottom_up`].
    pub nodes: Range<usize>,
}

/// A binary tree over primitive indices.
///
/// `n` primitives have `n - 1` inner nodes; fewer than two have none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tree {
    /// Inner nodes, numbered as described at [`Node`].
    pub nodes: Vec<Node>,
    /// Primitive of each leaf, in leaf order.
    pub leaves: Vec<PrimId>,
    /// Every node once, children before parents: the nodes of all tasks, then those above.
    pub bottom_up: Vec<NodeId>,
    /// Disjoint subtrees in leaf order, independent of the number of threads.
    pub tasks: Vec<Task>,
    /// Nodes on the longest path from the root to a leaf, the leaf included; 0 for an empty tree.
    pub depth: u32,
}

/// Minimum number of leaves of a subtree that is divided among threads.
pub(crate) const TASK_LEAVES: u32 = 1 << 12;

impl Tree {
    /// A tree of fewer than two primitives, without nodes.
    pub(crate) fn without_nodes(leaves: Vec<PrimId>) -> Self {
        let depth = u32::from(leaves.len() == 1);
        Self { nodes: vec![], leaves, bottom_up: vec![], tasks: vec![], depth }
    }

    /// The root; `None` for an empty tree.
    #[must_use]
    pub fn root(&self) -> Option<Child> {
        match self.leaves.len() {
            0 => None,
            1 => Some(Child::leaf(0)),
            _ => Some(Child::inner(NodeId::ROOT)),
        }
    }

    /// The subtree over the leaves `first..=last`, which is a left or a right child.
    pub(crate) fn subtree(first: u32, last: u32, is_left: bool) -> Child {
        match (first == last, is_left) {
            (true, _) => Child::leaf(first),
            (false, true) => Child::inner(NodeId(last)),
            (false, false) => Child::inner(NodeId(first)),
        }
    }

    /// The slices of per-node `values` of all tasks. A single leaf directly below the nodes above all tasks belongs to none.
    pub(crate) fn slices<'a, T>(&self, mut values: &'a mut [T]) -> Vec<&'a mut [T]> {
        let mut start = 0;
        let mut slices = Vec::with_capacity(self.tasks.len());
        for task in &self.tasks {
            let from = std::mem::take(&mut values).split_at_mut((task.leaves.start - start) as usize).1;
            let (own, after) = from.split_at_mut((task.leaves.end - task.leaves.start) as usize);
            slices.push(own);
            (values, start) = (after, task.leaves.end);
        }
        slices
    }

    /// Maximum number of leaves of a task.
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 leaves")]
    pub(crate) fn task_limit(n_leaves: usize) -> u32 {
        TASK_LEAVES.max(n_leaves as u32 / 64)
    }
}
