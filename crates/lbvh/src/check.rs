use canted_obb::PrimId;

use crate::{Child, ChildKind, Leaf, NodeId, Tree, Volume, Volumes};

/// Statistics of a valid tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stats {
    /// Inner nodes.
    pub n_nodes: usize,
    /// Leaves.
    pub n_leaves: usize,
    /// Nodes on the longest path from the root to a leaf, the leaf included.
    pub depth: u32,
    /// Sum of the depths of all leaves.
    pub leaf_depths: u64,
}

/// A defect of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// Array lengths do not match: `n` primitives need `n - 1` nodes, volumes and entries of the bottom-up order.
    WrongCount {
        /// Leaves.
        n_leaves: usize,
        /// Inner nodes.
        n_nodes: usize,
    },
    /// A primitive is in no leaf, or in two.
    NotOnce {
        /// The primitive.
        primitive: PrimId,
    },
    /// A node other than the root has no parent, or a node has two.
    NotOneParent {
        /// The node.
        node: NodeId,
    },
    /// A child reference is out of range.
    OutOfRange {
        /// The node that holds it.
        node: NodeId,
    },
    /// The leaf range of a node is not that of its children.
    WrongRange {
        /// The node.
        node: NodeId,
    },
    /// A node comes before a child in the bottom-up order.
    WrongOrder {
        /// The node.
        node: NodeId,
    },
    /// A volume does not contain a point below it.
    Escapes {
        /// The node.
        node: NodeId,
        /// Position of the leaf with the point.
        leaf: u32,
    },
    /// The stored depth is wrong.
    WrongDepth {
        /// The stored depth.
        stated: u32,
        /// The actual depth.
        actual: u32,
    },
}

impl std::fmt::Display for Flaw {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::WrongCount { n_leaves, n_nodes } => write!(f, "{n_leaves} leaves with {n_nodes} inner nodes"),
            Self::NotOnce { primitive } => write!(f, "primitive {primitive} is not in exactly one leaf"),
            Self::NotOneParent { node } => write!(f, "node {} has not exactly one parent", node.0),
            Self::OutOfRange { node } => write!(f, "node {} has a child that is out of range", node.0),
            Self::WrongRange { node } => write!(f, "node {} does not cover the leaves of its children", node.0),
            Self::WrongOrder { node } => write!(f, "node {} comes before its children in the bottom-up order", node.0),
            Self::Escapes { node, leaf } => write!(f, "leaf {leaf} has a point outside the volume of node {}", node.0),
            Self::WrongDepth { stated, actual } => write!(f, "the stored depth is {stated}, but the depth is {actual}"),
        }
    }
}

impl std::error::Error for Flaw {}

/// Verifies a tree and its volumes against `leaves` (in leaf order); returns statistics or the first flaw.
///
/// Checks that every primitive is in one leaf, every node has one parent, ranges nest, the bottom-up order has children
/// first, the stored depth is right, and every point is inside every volume above it, exactly.
///
/// # Errors
/// The first [`Flaw`] found.
pub fn check<L: Leaf>(tree: &Tree, volumes: &Volumes, leaves: &[L]) -> Result<Stats, Flaw> {
    let (n_leaves, n_nodes) = (tree.leaves.len(), tree.nodes.len());
    let counts = [n_nodes, tree.bottom_up.len(), volumes.aabbs.len()];
    if counts != [n_leaves.saturating_sub(1); 3] || leaves.len() != n_leaves {
        return Err(Flaw::WrongCount { n_leaves, n_nodes });
    }
    check_primitives(tree)?;
    let (depth, leaf_depths) = check_topology(tree)?;
    if depth != tree.depth {
        return Err(Flaw::WrongDepth { stated: tree.depth, actual: depth });
    }
    check_order(tree)?;
    check_volumes(tree, volumes, leaves)?;
    Ok(Stats { n_nodes, n_leaves, depth, leaf_depths })
}

fn check_primitives(tree: &Tree) -> Result<(), Flaw> {
    let mut seen = vec![false; tree.leaves.len()];
    for &primitive in &tree.leaves {
        match seen.get_mut(primitive.index()) {
            Some(seen) if !*seen => *seen = true,
            _ => return Err(Flaw::NotOnce { primitive }),
        }
    }
    Ok(())
}

/// Traverses from the root; returns the depth and the sum of the leaves' depths.
fn check_topology(tree: &Tree) -> Result<(u32, u64), Flaw> {
    let range = |child: Child| match child.kind() {
        ChildKind::Leaf(position) => ((position as usize) < tree.leaves.len()).then_some((position, position)),
        ChildKind::Inner(id) => tree.nodes.get(id.index()).map(|node| (node.first, node.last)),
    };
    let mut has_parent = vec![false; tree.nodes.len()];
    let mut stack: Vec<_> = tree.root().into_iter().map(|root| (root, 1)).collect();
    let (mut deepest, mut leaf_depths, mut reached) = (0, 0u64, 0);
    while let Some((child, depth)) = stack.pop() {
        deepest = deepest.max(depth);
        let ChildKind::Inner(id) = child.kind() else {
            leaf_depths += u64::from(depth);
            continue;
        };
        if std::mem::replace(&mut has_parent[id.index()], true) {
            return Err(Flaw::NotOneParent { node: id });
        }
        reached += 1;
        let node = tree.nodes[id.index()];
        let (Some(left), Some(right)) = (range(node.left), range(node.right)) else {
            return Err(Flaw::OutOfRange { node: id });
        };
        if (left.0, right.1) != (node.first, node.last) || left.1 + 1 != right.0 {
            return Err(Flaw::WrongRange { node: id });
        }
        stack.extend([(node.left, depth + 1), (node.right, depth + 1)]);
    }
    if reached != tree.nodes.len() {
        let orphan = (0..).zip(&has_parent).find(|(_, has)| !**has).map_or(0, |(i, _)| i);
        return Err(Flaw::NotOneParent { node: NodeId(orphan) });
    }
    let all = tree.leaves.len().checked_sub(2).map(|_| NodeId::ROOT);
    if let Some(root) = all
        && tree.nodes[root.index()].n_leaves() as usize != tree.leaves.len()
    {
        return Err(Flaw::WrongRange { node: root });
    }
    Ok((deepest, leaf_depths))
}

fn check_order(tree: &Tree) -> Result<(), Flaw> {
    let mut done = vec![false; tree.nodes.len()];
    for &id in &tree.bottom_up {
        let node = tree.nodes.get(id.index()).ok_or(Flaw::OutOfRange { node: id })?;
        let ready = [node.left, node.right].into_iter().all(|child| match child.kind() {
            ChildKind::Leaf(_) => true,
            ChildKind::Inner(child) => done[child.index()],
        });
        if !ready || std::mem::replace(&mut done[id.index()], true) {
            return Err(Flaw::WrongOrder { node: id });
        }
    }
    Ok(())
}

fn check_volumes<L: Leaf>(tree: &Tree, volumes: &Volumes, leaves: &[L]) -> Result<(), Flaw> {
    for (i, node) in (0..).zip(&tree.nodes) {
        let id = NodeId(i);
        let aabb = &volumes.aabbs[id.index()];
        for leaf in node.first..=node.last {
            let inside = |p: [f32; 3]| {
                aabb.contains(p)
                    && match volumes.of(id) {
                        Volume::Aabb(_) => true,
                        Volume::Obb(obb) => obb.contains(p),
                    }
            };
            if !leaves[leaf as usize].points().all(inside) {
                return Err(Flaw::Escapes { node: id, leaf });
            }
        }
    }
    Ok(())
}
