//! Verifies a kd-tree from its planes and the triangles alone; it shares no code with the build.

use std::fmt;

use canted_lbvh::Corners;
use canted_obb::vector::{Vector, cross, dot, reach, sub, to_f64};
use canted_obb::{Aabb, PrimId};
use canted_trace::AABB_PAD;

use crate::node::{MAX_DEPTH, NodeKind};
use crate::nodes::Ropes;
use crate::{KdNodes, KdTraversal};

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

// Whether a padded triangle is in a box, by separating axes.
//
// Source: Akenine-Möller 2001. The shape of the padded triangle is a sum of convex shapes, so it is in the box if and only if the triangle
// is in the box enlarged by the padding.

/// A triangle and its padding, a little less than that of the build: what only touches a cell may be in its neighbor.
struct Overlap {
    vertices: [Vector; 3],
    pad: f64,
    axes: [Vector; 13],
}

/// What is less than the padding, relative to it. Rounding of a projection in `f64`, relative to ρ∞, is far less.
const TOLERANCE: f64 = 1.0 / (1 << 20) as f64;

impl Overlap {
    fn new(corners: &Corners) -> Self {
        let vertices = corners.map(to_f64);
        let [a, b, c] = vertices;
        let edges = [sub(b, a), sub(c, b), sub(a, c)];
        let units: [Vector; 3] = std::array::from_fn(|k| std::array::from_fn(|j| if j == k { 1.0 } else { 0.0 }));
        let mut axes = [cross(edges[0], edges[1]); 13];
        axes[1..4].copy_from_slice(&units);
        for (i, edge) in edges.iter().enumerate() {
            for (k, unit) in units.iter().enumerate() {
                axes[4 + 3 * i + k] = cross(*edge, *unit);
            }
        }
        let reach = vertices.iter().map(|&v| reach(v)).fold(0.0, f64::max);
        Self { vertices, pad: f64::from(AABB_PAD) * reach * (1.0 - TOLERANCE), axes }
    }

    /// Whether a point of the padded triangle is in the box.
    fn is_in(&self, aabb: &Aabb) -> bool {
        // Only the part of the box near the triangle matters: rounding is then relative to the triangle, not to the box.
        let end = |pick: fn(f64, f64) -> f64, k: usize| self.vertices.iter().map(|v| v[k]).reduce(pick).unwrap_or(0.0);
        let min: Vector = std::array::from_fn(|k| f64::from(aabb.min[k]).max(end(f64::min, k) - self.pad));
        let max: Vector = std::array::from_fn(|k| f64::from(aabb.max[k]).min(end(f64::max, k) + self.pad));
        if (0..3).any(|k| min[k] > max[k]) {
            return false;
        }
        let center: Vector = std::array::from_fn(|k| 0.5 * (min[k] + max[k]));
        let half: Vector = std::array::from_fn(|k| 0.5 * (max[k] - min[k]) + self.pad);
        let relative = self.vertices.map(|v| sub(v, center));
        self.axes.iter().all(|&axis| {
            let projections = relative.map(|v| dot(axis, v));
            let least = projections.into_iter().fold(f64::INFINITY, f64::min);
            let greatest = projections.into_iter().fold(f64::NEG_INFINITY, f64::max);
            let radius = dot(axis.map(f64::abs), half);
            least <= radius && greatest >= -radius
        })
    }

    /// Whether all points of the padded triangle are in the box.
    fn is_within(&self, aabb: &Aabb) -> bool {
        self.vertices.iter().all(|v| {
            (0..3).all(|k| f64::from(aabb.min[k]) <= v[k] - self.pad && v[k] + self.pad <= f64::from(aabb.max[k]))
        })
    }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::{Mesh, equal_centroids, fan, identical, outlier, slivers, soup, torus};

    use super::*;
    use crate::node::{Node, Reference};
    use crate::{KdNodes, KdTreeConfig};

    fn corners(mesh: &Mesh) -> Vec<Corners> {
        mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize])).collect()
    }

    fn deep() -> KdTreeConfig {
        KdTreeConfig { traversal: KdTraversal::Ropes, traversal_cost: 0.01, ..KdTreeConfig::default() }
    }

    #[test]
    fn built_trees_pass() {
        let mut meshes =
            vec![Mesh::default(), soup(1, 1), soup(2, 400), torus(12, 9), identical(50), equal_centroids(90)];
        meshes.extend([outlier(200), slivers(3, 200), fan(100)]);
        meshes.extend([1e7, 3e3].map(|offset| soup(4, 200).placed(|p| p.map(|x| x + offset))));
        meshes.extend([1e-40, 1e-20, 1e15].map(|scale| soup(4, 200).placed(|p| p.map(|x| x * scale))));
        for (i, mesh) in meshes.iter().enumerate() {
            let corners = corners(mesh);
            for config in [deep(), KdTreeConfig::default(), KdTreeConfig { max_references: 2.0, ..deep() }] {
                let tree = KdNodes::new(&corners, &config);
                let stats = tree.check(&corners).unwrap_or_else(|flaw| panic!("mesh {i}, {config:?}: {flaw}"));
                assert_eq!((stats.n_leaves, stats.n_references), (tree.n_leaves(), tree.n_references()));
                assert_eq!(stats.depth, tree.depth());
                assert!(stats.depth <= config.depth_limit(corners.len()), "mesh {i}: {stats:?}");
                assert!(stats.n_references + stats.n_empty <= config.reference_limit(corners.len()).max(1));
            }
        }
    }

    /// The flaw that the checker finds after a tree of many leaves is spoiled.
    fn spoiled(spoil: impl FnOnce(&mut KdNodes)) -> KdTreeFlaw {
        let corners = corners(&soup(2, 100));
        let mut tree = KdNodes::new(&corners, &deep());
        assert!(tree.check(&corners).unwrap().n_leaves > 50);
        spoil(&mut tree);
        let flaw = tree.check(&corners).unwrap_err();
        assert!(!flaw.to_string().is_empty());
        flaw
    }

    /// Number of the first node that is a leaf with triangles, and of its first reference.
    fn full_leaf(tree: &KdNodes) -> (usize, usize, u32) {
        let mut nodes = tree.nodes.iter().enumerate();
        nodes
            .find_map(|(i, node)| match node.kind() {
                NodeKind::Leaf { first: Some(first), number } => Some((i, first as usize, number)),
                _ => None,
            })
            .unwrap()
    }

    fn inner(tree: &KdNodes, node: usize) -> (usize, f32, u32) {
        let NodeKind::Inner { axis, plane, upper } = tree.nodes[node].kind() else { panic!("node {node} is a leaf") };
        (axis, plane, upper)
    }

    #[test]
    fn flaws_of_nodes_are_seen() {
        let wrong_child = spoiled(|tree| {
            let (.., upper) = inner(tree, 0);
            tree.nodes[0] = tree.nodes[0].with_number(upper + 1);
        });
        assert_eq!(wrong_child, KdTreeFlaw::WrongChild { node: 0 });
        let cut = spoiled(|tree| tree.nodes.truncate(tree.nodes.len() - 1));
        assert!(matches!(cut, KdTreeFlaw::WrongChild { .. }), "{cut:?}");
        assert!(matches!(spoiled(|tree| tree.nodes.push(Node::leaf(None))), KdTreeFlaw::WrongChild { .. }));
        let outside = spoiled(|tree| {
            let (axis, _, upper) = inner(tree, 0);
            tree.nodes[0] = Node::inner(axis, tree.cell.max[axis]).with_number(upper);
        });
        assert_eq!(outside, KdTreeFlaw::PlaneOutside { node: 0 });
        let (mut node, number) = (0, 77);
        let flaw = spoiled(|tree| {
            node = full_leaf(tree).0;
            tree.nodes[node] = tree.nodes[node].with_number(number);
        });
        assert_eq!(flaw, KdTreeFlaw::WrongNumber { node: u32::try_from(node).unwrap() });
        assert!(matches!(spoiled(|tree| tree.depth -= 1), KdTreeFlaw::TooDeep { .. }));
    }

    #[test]
    fn flaws_of_references_are_seen() {
        let flaw = spoiled(|tree| {
            let first = full_leaf(tree).1;
            tree.references[first] = Reference::new(100, tree.references[first].is_last());
        });
        assert!(matches!(flaw, KdTreeFlaw::NoTriangle { .. }), "{flaw:?}");
        let last = spoiled(|tree| {
            let reference = tree.references.last_mut().unwrap();
            *reference = Reference::new(reference.triangle(), false);
        });
        assert!(matches!(last, KdTreeFlaw::NoTriangle { .. }), "{last:?}");
        let repeated = spoiled(|tree| {
            let at = (0..tree.references.len()).find(|&i| !tree.references[i].is_last()).unwrap();
            tree.references[at] = Reference::new(tree.references[at + 1].triangle(), false);
        });
        assert!(matches!(repeated, KdTreeFlaw::Repeated { .. }), "{repeated:?}");
        // Every triangle of every leaf is needed by some leaf; here the first leaf loses its own.
        let missing = spoiled(|tree| {
            let (node, _, number) = full_leaf(tree);
            tree.nodes[node] = Node::leaf(None).with_number(number);
        });
        assert!(matches!(missing, KdTreeFlaw::Missing { .. }), "{missing:?}");
        assert_eq!(
            spoiled(|tree| tree.references.push(Reference::new(0, true))),
            KdTreeFlaw::Unused { n_references: 1 }
        );
        let escapes = spoiled(|tree| tree.cell.max[1] = tree.cell.max[1].next_down().next_down());
        assert!(matches!(escapes, KdTreeFlaw::Escapes { .. }), "{escapes:?}");
    }

    #[test]
    fn flaws_of_ropes_are_seen() {
        assert!(matches!(spoiled(|tree| tree.ropes.truncate(5)), KdTreeFlaw::NoRopes { n_ropes: 5 }));
        assert!(matches!(spoiled(|tree| tree.traversal = KdTraversal::Stack), KdTreeFlaw::NoRopes { .. }));
        let flaw = spoiled(|tree| tree.ropes[3].cell.min[0] = tree.ropes[3].cell.min[0].next_down());
        assert_eq!(flaw, KdTreeFlaw::WrongCell { leaf: 3 });
        // A rope to the far cell covers the face too, but is not the smallest.
        let larger = spoiled(|tree| {
            let is_smaller =
                |r: &Ropes| (0..6).find(|&face| r.depths[face] == 1 && !is_root_child(tree, r.targets[face]));
            let (leaf, face) = tree.ropes.iter().enumerate().find_map(|(i, r)| Some((i, is_smaller(r)?))).unwrap();
            let (.., upper) = inner(tree, 0);
            tree.ropes[leaf].targets[face] = if face & 1 == 1 { upper } else { 1 };
        });
        assert!(matches!(larger, KdTreeFlaw::WrongRope { .. }), "{larger:?}");
        let deeper = spoiled(|tree| {
            let face = (0..6).find(|&face| tree.ropes[9].depths[face] > 0).unwrap();
            tree.ropes[9].depths[face] += 1;
        });
        assert!(matches!(deeper, KdTreeFlaw::WrongRope { leaf: 9, .. }), "{deeper:?}");
    }

    fn is_root_child(tree: &KdNodes, node: u32) -> bool {
        node == 1 || node == inner(tree, 0).2
    }

    /// The check can fail by little: a tree without the padding lacks references.
    #[test]
    fn a_tree_over_unpadded_triangles_lacks_references() {
        // Triangles in planes between others: without padding they are on one side only.
        let mesh = torus(16, 12);
        let padded = corners(&mesh);
        let mut n_flawed = 0;
        for shift in 0..20u8 {
            let moved: Vec<Corners> =
                padded.iter().map(|c| c.map(|p| p.map(|x| x + 1e-6 * f32::from(shift + 1)))).collect();
            let tree = KdNodes::new(&moved, &deep());
            n_flawed += usize::from(tree.check(&padded).is_err());
        }
        assert!(n_flawed > 15, "{n_flawed} of 20 trees over moved triangles are flawed");
    }
}
