//! Verifies a kd-tree from its planes and the triangles alone; it shares no code with the build.

mod overlap;
#[cfg(test)]
mod tests;

use std::fmt;

use canted_lbvh::Corners;
use canted_obb::{Aabb, PrimId};

use crate::node::{MAX_DEPTH, NodeKind};
use crate::traverse::ropes::Ropes;
use crate::{KdNodes, KdTraversal};
use overlap::Overlap;

/// Statistics of a valid kd-tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KdTreeStats {
    /// Leaves, empty ones too.
    pub n_leaves: usize,
    /// Leaves without triangles.
    pub n_empty: usize,
    /// Triangles of all leaves together.
    pub n_references: usize,
    /// Triangles of the greatest leaf.
    pub max_leaf: usize,
    /// Greatest number of nodes above a leaf.
    pub depth: u32,
}

/// A defect of a kd-tree. Nodes and leaves are numbered depth first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KdTreeFlaw {
    /// A node's upper child is not the node after its lower subtree, or there are nodes below no other.
    WrongChild {
        /// The node.
        node: u32,
    },
    /// A plane is not inside the cell of its node.
    PlaneOutside {
        /// The node.
        node: u32,
    },
    /// A leaf has another number than its position.
    WrongNumber {
        /// The node.
        node: u32,
    },
    /// More nodes above a leaf than are stored or allowed.
    TooDeep {
        /// The node.
        node: u32,
    },
    /// A leaf refers to a triangle that does not exist, or has no end.
    NoTriangle {
        /// The leaf.
        leaf: u32,
    },
    /// A leaf refers to a triangle twice.
    Repeated {
        /// The leaf.
        leaf: u32,
        /// The triangle.
        triangle: PrimId,
    },
    /// A padded triangle is in the cell of a leaf that does not refer to it.
    Missing {
        /// The leaf.
        leaf: u32,
        /// The triangle.
        triangle: PrimId,
    },
    /// A padded triangle is not in the cell of the root.
    Escapes {
        /// The triangle.
        triangle: PrimId,
    },
    /// There are references that belong to no leaf.
    Unused {
        /// Their number.
        n_references: usize,
    },
    /// There is not one record of ropes for each leaf, or there are some without use.
    NoRopes {
        /// Number of records.
        n_ropes: usize,
    },
    /// The cell that a leaf stores is not its own.
    WrongCell {
        /// The leaf.
        leaf: u32,
    },
    /// A rope does not lead to the smallest subtree that covers its face, or has another depth than the face's node.
    WrongRope {
        /// The leaf.
        leaf: u32,
        /// The face: twice the axis, plus one for the upper face.
        face: usize,
    },
}

impl fmt::Display for KdTreeFlaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WrongChild { node } => write!(f, "node {node} has a child in the wrong place"),
            Self::PlaneOutside { node } => write!(f, "the plane of node {node} is not inside its cell"),
            Self::WrongNumber { node } => write!(f, "the leaf at node {node} has the wrong number"),
            Self::TooDeep { node } => write!(f, "the leaf at node {node} is too deep"),
            Self::NoTriangle { leaf } => write!(f, "leaf {leaf} refers to a triangle that does not exist"),
            Self::Repeated { leaf, triangle } => write!(f, "leaf {leaf} refers to triangle {triangle} twice"),
            Self::Missing { leaf, triangle } => write!(f, "leaf {leaf} does not refer to triangle {triangle}"),
            Self::Escapes { triangle } => write!(f, "triangle {triangle} is not in the cell of the root"),
            Self::Unused { n_references } => write!(f, "{n_references} references belong to no leaf"),
            Self::NoRopes { n_ropes } => write!(f, "there are {n_ropes} records of ropes, not one for each leaf"),
            Self::WrongCell { leaf } => write!(f, "leaf {leaf} stores another cell than its own"),
            Self::WrongRope { leaf, face } => write!(f, "leaf {leaf} has a wrong rope across face {face}"),
        }
    }
}

impl std::error::Error for KdTreeFlaw {}

impl KdNodes {
    /// Verifies planes, references, ropes and depth against the triangles by the numbers that leaves refer to.
    ///
    /// Overlap is decided by separating axes in `f64`, with 2^-20 of the padding as tolerance.
    ///
    /// # Errors
    /// The first flaw found.
    pub fn check(&self, corners: &[Corners]) -> Result<KdTreeStats, KdTreeFlaw> {
        let overlaps: Vec<Overlap> = corners.iter().map(Overlap::new).collect();
        let mut walk = Walk {
            tree: self,
            overlaps: &overlaps,
            next: 0,
            n_used: 0,
            seen: vec![u32::MAX; corners.len()],
            stats: KdTreeStats::default(),
            leaves: vec![],
        };
        let mut inside = vec![];
        for (triangle, overlap) in (0..).zip(&overlaps) {
            if !overlap.is_within(&self.cell) {
                return Err(KdTreeFlaw::Escapes { triangle: PrimId(triangle) });
            }
            inside.push(triangle);
        }
        walk.node(&self.cell, &inside, 0, [0; 6])?;
        let Walk { next, n_used, stats, leaves, .. } = walk;
        if next as usize != self.nodes.len() {
            return Err(KdTreeFlaw::WrongChild { node: next });
        }
        if n_used != self.references.len() {
            return Err(KdTreeFlaw::Unused { n_references: self.references.len() - n_used });
        }
        let want = if self.traversal == KdTraversal::Ropes { stats.n_leaves } else { 0 };
        if self.ropes.len() != want || self.n_leaves as usize != stats.n_leaves {
            return Err(KdTreeFlaw::NoRopes { n_ropes: self.ropes.len() });
        }
        for ((leaf, ropes), (cell, faces)) in (0..).zip(&self.ropes).zip(leaves) {
            self.check_ropes(leaf, ropes, &cell, faces)?;
        }
        Ok(stats)
    }

    /// Checks the ropes of a leaf; `faces` are the depths of the nodes of its faces.
    fn check_ropes(&self, leaf: u32, ropes: &Ropes, cell: &Aabb, faces: [u8; 6]) -> Result<(), KdTreeFlaw> {
        if ropes.cell != *cell {
            return Err(KdTreeFlaw::WrongCell { leaf });
        }
        for (face, &depth) in faces.iter().enumerate() {
            let target = self.covers(cell, face);
            if ropes.depths[face] != depth || target.is_some_and(|target| ropes.targets[face] != target) {
                return Err(KdTreeFlaw::WrongRope { leaf, face });
            }
        }
        Ok(())
    }

    /// The smallest subtree whose cell covers a face of `cell` from outside; `None` for a face of the root.
    fn covers(&self, cell: &Aabb, face: usize) -> Option<u32> {
        let (across, is_upper) = (face >> 1, face & 1 == 1);
        let at = if is_upper { cell.max[across] } else { cell.min[across] };
        let root = if is_upper { self.cell.max[across] } else { self.cell.min[across] };
        if at == root {
            return None;
        }
        let mut node = 0;
        while let NodeKind::Inner { axis, plane, upper } = self.nodes[node as usize].kind() {
            // What is just outside of the face, or the range of the face on this axis.
            let (is_below, is_above) = match (axis == across, is_upper) {
                (true, true) => (at < plane, at >= plane),
                (true, false) => (at <= plane, at > plane),
                (false, _) => (cell.max[axis] <= plane, cell.min[axis] >= plane),
            };
            node = match (is_below, is_above) {
                (true, _) => node + 1,
                (_, true) => upper,
                _ => break,
            };
        }
        Some(node)
    }
}

struct Walk<'a> {
    tree: &'a KdNodes,
    overlaps: &'a [Overlap],
    /// The node that depth-first order visits next.
    next: u32,
    n_used: usize,
    /// The leaf that referred to each triangle last.
    seen: Vec<u32>,
    stats: KdTreeStats,
    /// Cells of the leaves, and the depths of the nodes of their faces.
    leaves: Vec<(Aabb, [u8; 6])>,
}

impl Walk<'_> {
    /// Checks the next node in depth-first order; `inside` are the triangles in its cell.
    fn node(&mut self, cell: &Aabb, inside: &[u32], depth: u32, faces: [u8; 6]) -> Result<(), KdTreeFlaw> {
        let node = self.next;
        self.next += 1;
        if depth > self.tree.depth.min(MAX_DEPTH) {
            return Err(KdTreeFlaw::TooDeep { node });
        }
        match self.tree.nodes.get(node as usize).ok_or(KdTreeFlaw::WrongChild { node })?.kind() {
            NodeKind::Leaf { first, number } => {
                if number as usize != self.stats.n_leaves {
                    return Err(KdTreeFlaw::WrongNumber { node });
                }
                self.stats.depth = self.stats.depth.max(depth);
                self.leaves.push((*cell, faces));
                self.leaf(first, number, inside)
            }
            NodeKind::Inner { axis, plane, upper } => {
                if !(cell.min[axis] < plane && plane < cell.max[axis]) {
                    return Err(KdTreeFlaw::PlaneOutside { node });
                }
                let (mut below, mut above) = (*cell, *cell);
                (below.max[axis], above.min[axis]) = (plane, plane);
                let (mut below_faces, mut above_faces) = (faces, faces);
                let own = depth as u8 + 1;
                (below_faces[2 * axis + 1], above_faces[2 * axis]) = (own, own);
                let among = |cell: &Aabb| {
                    let is_in = |&triangle: &u32| self.overlaps[triangle as usize].is_in(cell);
                    inside.iter().copied().filter(is_in).collect::<Vec<_>>()
                };
                let (in_lower, in_upper) = (among(&below), among(&above));
                self.node(&below, &in_lower, depth + 1, below_faces)?;
                if upper != self.next {
                    return Err(KdTreeFlaw::WrongChild { node });
                }
                self.node(&above, &in_upper, depth + 1, above_faces)
            }
        }
    }

    /// Checks that a leaf refers to every triangle in its cell.
    fn leaf(&mut self, first: Option<u32>, leaf: u32, inside: &[u32]) -> Result<(), KdTreeFlaw> {
        let mut n = 0;
        if let Some(first) = first {
            loop {
                let at = first as usize + n;
                let reference = self.tree.references.get(at).ok_or(KdTreeFlaw::NoTriangle { leaf })?;
                let seen = self.seen.get_mut(reference.triangle() as usize).ok_or(KdTreeFlaw::NoTriangle { leaf })?;
                if *seen == leaf {
                    return Err(KdTreeFlaw::Repeated { leaf, triangle: PrimId(reference.triangle()) });
                }
                *seen = leaf;
                n += 1;
                if reference.is_last() {
                    break;
                }
            }
        }
        if let Some(&missing) = inside.iter().find(|&&triangle| self.seen[triangle as usize] != leaf) {
            return Err(KdTreeFlaw::Missing { leaf, triangle: PrimId(missing) });
        }
        self.n_used += n;
        self.stats.n_leaves += 1;
        self.stats.n_empty += usize::from(n == 0);
        self.stats.n_references += n;
        self.stats.max_leaf = self.stats.max_leaf.max(n);
        Ok(())
    }
}
