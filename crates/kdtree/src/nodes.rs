use canted_lbvh::Corners;
use canted_obb::{Aabb, Obb, PrimId};

use crate::build::{Built, build};
use crate::node::{Node, NodeKind, Reference};
use crate::{KdTraversal, KdTreeConfig};

/// Memory of the parts of a kd-tree in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KdTreeMemory {
    /// Planes and leaves, 8 bytes each.
    pub nodes: usize,
    /// Cells and ropes of leaves, 64 bytes each; none for [`KdTraversal::Stack`].
    pub ropes: usize,
    /// Triangles of the leaves, 4 bytes each.
    pub references: usize,
    /// The triangles and their numbers.
    pub triangles: usize,
}

impl KdTreeMemory {
    /// All parts together.
    #[must_use]
    pub fn total(&self) -> usize {
        self.nodes + self.ropes + self.references + self.triangles
    }
}

/// A kd-tree without triangles: it stores planes and the numbers of the triangles in each leaf, and reports those that a ray may hit.
///
/// [`KdTree`](crate::KdTree) adds the triangles.
#[derive(Clone, Debug)]
pub struct KdNodes {
    pub(crate) nodes: Vec<Node>,
    pub(crate) references: Vec<Reference>,
    /// Empty if rays are traced with a stack.
    pub(crate) ropes: Vec<Ropes>,
    pub(crate) cell: Aabb,
    pub(crate) depth: u32,
    pub(crate) n_leaves: u32,
    pub(crate) traversal: KdTraversal,
}

impl KdNodes {
    /// Builds over triangles by their vertices, which must be finite.
    #[must_use]
    pub fn new(corners: &[Corners], config: &KdTreeConfig) -> Self {
        Self::from_built(build(corners, config), config)
    }

    pub(crate) fn from_built(built: Built, config: &KdTreeConfig) -> Self {
        let Built { nodes, references, cell, depth, n_leaves } = built;
        Self { nodes, references, ropes: vec![], cell, depth, n_leaves, traversal: KdTraversal::Stack }
            .with_traversal(config.traversal)
    }

    /// Numbers the `n` triangles in the order in which leaves refer to them first; returns the old number of each.
    ///
    /// Leaves that are near each other then read triangles that are near each other.
    pub(crate) fn in_leaf_order(mut self, n: usize) -> (Self, Vec<PrimId>) {
        const UNSET: u32 = u32::MAX;
        let (mut numbers, mut order) = (vec![UNSET; n], Vec::with_capacity(n));
        for reference in &mut self.references {
            let number = &mut numbers[reference.triangle() as usize];
            if *number == UNSET {
                let next = order.len() as u32;
                *number = next;
                order.push(PrimId(reference.triangle()));
            }
            *reference = Reference::new(*number, reference.is_last());
        }
        assert_eq!(order.len(), n, "every triangle is in a leaf");
        (self, order)
    }

    /// The same nodes for another traversal.
    #[must_use]
    pub fn with_traversal(self, traversal: KdTraversal) -> Self {
        let ropes = match traversal {
            KdTraversal::Stack => vec![],
            KdTraversal::Ropes => ropes(&self.nodes, &self.cell),
        };
        Self { ropes, traversal, ..self }
    }

    /// The cell of the root: the bounds of all triangles, each padded relative to its own coordinates. Empty for no triangle.
    #[must_use]
    pub fn cell(&self) -> &Aabb {
        &self.cell
    }

    /// How rays are traced.
    #[must_use]
    pub fn traversal(&self) -> KdTraversal {
        self.traversal
    }

    /// Greatest number of nodes above a leaf.
    #[must_use]
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Number of leaves, empty ones too; there is one plane less.
    #[must_use]
    pub fn n_leaves(&self) -> usize {
        self.n_leaves as usize
    }

    /// Number of triangles in all leaves together.
    #[must_use]
    pub fn n_references(&self) -> usize {
        self.references.len()
    }

    /// Cost by the surface area heuristic: of each node `traversal_cost`, of each leaf `intersection_cost` for each triangle, weighted by the
    /// area of its cell relative to the root's. 0 if the root has no area.
    ///
    /// The bonus for empty cells is no part of it, so trees can be compared that were built with different ones.
    #[must_use]
    pub fn sah(&self, config: &KdTreeConfig) -> f64 {
        let mut sum = 0.0;
        let mut open = vec![(0, self.cell)];
        while let Some((index, cell)) = open.pop() {
            match self.nodes[index].kind() {
                NodeKind::Leaf { first: None, .. } => {}
                NodeKind::Leaf { first: Some(first), .. } => {
                    let references = &self.references[first as usize..];
                    let n = references.iter().position(|reference| reference.is_last()).map_or(0, |last| last + 1);
                    sum += config.intersection_cost * n as f64 * cell.area();
                }
                NodeKind::Inner { axis, plane, upper } => {
                    sum += config.traversal_cost * cell.area();
                    let (mut above, mut below) = (cell, cell);
                    (above.min[axis], below.max[axis]) = (plane, plane);
                    open.extend([(upper as usize, above), (index + 1, below)]);
                }
            }
        }
        let area = self.cell.area();
        if area > 0.0 { sum / area } else { 0.0 }
    }

    /// Axis and coordinate of every plane, depth first.
    #[must_use]
    pub fn planes(&self) -> Vec<(usize, f32)> {
        let plane = |node: &Node| match node.kind() {
            NodeKind::Inner { axis, plane, .. } => Some((axis, plane)),
            NodeKind::Leaf { .. } => None,
        };
        self.nodes.iter().filter_map(plane).collect()
    }

    /// Memory of nodes, ropes and references.
    #[must_use]
    pub fn memory(&self) -> KdTreeMemory {
        KdTreeMemory {
            nodes: size_of_val(&self.nodes[..]),
            ropes: size_of_val(&self.ropes[..]),
            references: size_of_val(&self.references[..]),
            triangles: 0,
        }
    }

    /// Calls `visit` with the cell of each node and leaf, but for leaves without triangles, relative to the reference point of what was
    /// given: the cell, its level, 0 for the root, and whether it is a leaf. Parents come before their children.
    pub fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        let mut open: Vec<(usize, Aabb, u32)> = vec![];
        if !self.nodes.is_empty() {
            open.push((0, self.cell, 0));
        }
        while let Some((index, cell, level)) = open.pop() {
            match self.nodes[index].kind() {
                NodeKind::Leaf { first: None, .. } => {}
                NodeKind::Leaf { .. } => visit(Obb::from_aabb(&cell), level, true),
                NodeKind::Inner { axis, plane, upper } => {
                    visit(Obb::from_aabb(&cell), level, false);
                    let (mut above, mut below) = (cell, cell);
                    (above.min[axis], below.max[axis]) = (plane, plane);
                    open.push((upper as usize, above, level + 1));
                    open.push((index + 1, below, level + 1));
                }
            }
        }
    }
}

// Ropes: `crate::traverse::ropes` has the derivation.

/// Where a leaf leads to. Faces are numbered by axis, twice, plus one for upper faces. One
/// cache line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Ropes {
    pub(crate) cell: Aabb,
    /// The smallest subtree that covers each face from outside; the root itself for a face of the root.
    pub(crate) targets: [u32; 6],
    /// Number of nodes down to the one whose plane is the face, counted from one; 0 for a face of the root.
    pub(crate) depths: [u8; 6],
}

impl Ropes {
    /// The coordinate of a face.
    pub(crate) fn plane(&self, face: usize) -> f32 {
        [self.cell.min, self.cell.max][face & 1][face >> 1]
    }
}

/// Ropes of every leaf, in the order of their numbers.
pub(crate) fn ropes(nodes: &[Node], cell: &Aabb) -> Vec<Ropes> {
    let mut ropes = vec![];
    descend(nodes, 0, 0, Ropes { cell: *cell, targets: [0; 6], depths: [0; 6] }, &mut ropes);
    ropes
}

/// Adds the ropes of the leaves below `node`; those of the node itself are given.
fn descend(nodes: &[Node], node: u32, depth: u8, own: Ropes, ropes: &mut Vec<Ropes>) {
    match nodes[node as usize].kind() {
        NodeKind::Leaf { .. } => {
            let mut own = own;
            for face in 0..6 {
                if own.depths[face] > 0 {
                    own.targets[face] = smallest(nodes, own.targets[face], face, &own.cell);
                }
            }
            ropes.push(own);
        }
        NodeKind::Inner { axis, plane, upper } => {
            let (mut below, mut above) = (own, own);
            (below.cell.max[axis], above.cell.min[axis]) = (plane, plane);
            (below.targets[2 * axis + 1], above.targets[2 * axis]) = (upper, node + 1);
            (below.depths[2 * axis + 1], above.depths[2 * axis]) = (depth + 1, depth + 1);
            descend(nodes, node + 1, depth + 1, below, ropes);
            descend(nodes, upper, depth + 1, above, ropes);
        }
    }
}

/// The smallest subtree below `node`, which covers a face of `cell`, that still covers it.
fn smallest(nodes: &[Node], mut node: u32, face: usize, cell: &Aabb) -> u32 {
    loop {
        let NodeKind::Inner { axis, plane, upper } = nodes[node as usize].kind() else { return node };
        node = if axis == face >> 1 {
            if face & 1 == 1 { node + 1 } else { upper }
        } else if plane >= cell.max[axis] {
            node + 1
        } else if plane <= cell.min[axis] {
            upper
        } else {
            return node;
        };
    }
}
