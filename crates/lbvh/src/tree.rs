//! Binary trees in Karras numbering, and trees from the child references of any builder.

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
    pub(crate) fn task_limit(n_leaves: usize) -> u32 {
        TASK_LEAVES.max(n_leaves as u32 / 64)
    }
}

/// Why child references do not form a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TopologyError {
    /// A reference to a node that does not exist; node 0 for an empty list.
    NoSuchNode {
        /// The node.
        node: u32,
    },
    /// A primitive index greater than the number of nodes.
    NoSuchPrimitive {
        /// The primitive.
        primitive: u32,
    },
    /// A node or primitive has two parents.
    ReachedTwice {
        /// The node, or the primitive where `is_leaf`.
        index: u32,
        /// Whether `index` is a primitive.
        is_leaf: bool,
    },
    /// A node is not reachable from the root.
    Unreached {
        /// The first such node.
        node: u32,
    },
}

impl std::fmt::Display for TopologyError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoSuchNode { node } => write!(f, "node {node} does not exist"),
            Self::NoSuchPrimitive { primitive } => {
                write!(f, "primitive {primitive} is out of range for the number of nodes")
            }
            Self::ReachedTwice { index, is_leaf: true } => write!(f, "primitive {index} is in two leaves"),
            Self::ReachedTwice { index, is_leaf: false } => write!(f, "node {index} has two parents"),
            Self::Unreached { node } => write!(f, "node {node} is not below the root"),
        }
    }
}

impl std::error::Error for TopologyError {}

impl Tree {
    /// A tree from the topology of another builder, with nodes and leaves renumbered from left to right.
    ///
    /// `children[i]` are the children of node `i`, and node 0 is the root; a leaf refers to its *primitive*. All later stages
    /// work as for a radix tree. The depth is only bounded by the number of leaves.
    ///
    /// # Errors
    /// A topology that is not a tree over the primitives `0..=children.len()`, each once.
    pub fn from_children(children: &[[Child; 2]]) -> Result<Self, TopologyError> {
        check_topology(children)?;
        Ok(Self::numbered(children.len() + 1, NodeId::ROOT, |id| children[id.index()], PrimId))
    }
}

/// Whether the nodes are a tree over all primitives.
fn check_topology(children: &[[Child; 2]]) -> Result<(), TopologyError> {
    let mut node_seen = vec![false; children.len()];
    let mut leaf_seen = vec![false; children.len() + 1];
    let mut stack = vec![NodeId::ROOT];
    while let Some(id) = stack.pop() {
        let node = children.get(id.index()).ok_or(TopologyError::NoSuchNode { node: id.0 })?;
        if std::mem::replace(&mut node_seen[id.index()], true) {
            return Err(TopologyError::ReachedTwice { index: id.0, is_leaf: false });
        }
        for child in node {
            match child.kind() {
                ChildKind::Inner(id) => stack.push(id),
                ChildKind::Leaf(primitive) => match leaf_seen.get_mut(primitive as usize) {
                    None => return Err(TopologyError::NoSuchPrimitive { primitive }),
                    Some(seen) if *seen => return Err(TopologyError::ReachedTwice { index: primitive, is_leaf: true }),
                    Some(seen) => *seen = true,
                },
            }
        }
    }
    // If every node is visited once, so is every primitive: no two leaves are equal, and their number matches.
    match (0..).zip(&node_seen).find(|(_, is_seen)| !**is_seen) {
        Some((node, _)) => Err(TopologyError::Unreached { node }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_keeps_its_leaf_order() {
        let n = 10_000u32;
        let chain: Vec<[Child; 2]> = (0..n)
            .map(|i| [Child::leaf(n - i), if i + 1 < n { Child::inner(NodeId(i + 1)) } else { Child::leaf(0) }])
            .collect();
        let tree = Tree::from_children(&chain).unwrap();
        assert_eq!(tree.leaves, (0..=n).rev().map(PrimId).collect::<Vec<_>>());
        assert_eq!(tree.depth, n + 1);
        assert_eq!(tree.bottom_up.len(), n as usize);
    }

    #[test]
    fn rejects_what_is_not_a_tree() {
        let (a, b) = (Child::inner(NodeId(1)), Child::inner(NodeId(0)));
        assert_eq!(
            Tree::from_children(&[[a, Child::leaf(0)], [b, Child::leaf(1)]]),
            Err(TopologyError::ReachedTwice { index: 0, is_leaf: false })
        );
        assert_eq!(
            Tree::from_children(&[[Child::leaf(1), Child::leaf(1)]]),
            Err(TopologyError::ReachedTwice { index: 1, is_leaf: true })
        );
        assert_eq!(Tree::from_children(&[[a, Child::leaf(0)]]), Err(TopologyError::NoSuchNode { node: 1 }));
        let beyond = Err(TopologyError::NoSuchPrimitive { primitive: 2 });
        assert_eq!(Tree::from_children(&[[Child::leaf(2), Child::leaf(0)]]), beyond);
        let [left, right] = [Child::leaf(0), Child::leaf(1)];
        assert_eq!(
            Tree::from_children(&[[left, a], [right, Child::leaf(2)], [Child::leaf(3), Child::leaf(3)]]),
            Err(TopologyError::Unreached { node: 2 })
        );
        assert_eq!(Tree::from_children(&[]), Err(TopologyError::NoSuchNode { node: 0 }));
    }
}
