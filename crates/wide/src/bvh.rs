use canted_obb::vector::to_f32;
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::Triangles;

use crate::config::Baseline;
use crate::leaf::{LeafPrimitive, Triangle};
use crate::node::{ChildWord, DecodedWord, NodeBox, NodeKind, Nodes, node_words};
use crate::simd::{AvailablePath, SimdPath};
use crate::traverse::MeshFrame;

/// A BVH of eight-wide nodes over primitives `P`: triangles ([`TriangleBvh`]), spheres, boxes, or any
/// [`Primitive`](crate::Primitive).
///
/// Every query returns what testing each primitive would return: the same `t`, `u`, `v` and primitive, and of equal `t` the
/// lowest primitive, on every [`SimdPath`].
#[derive(Clone, Debug)]
pub struct WideBvh<P: LeafPrimitive> {
    pub(crate) nodes: Nodes,
    pub(crate) leaves: P::Leaves,
    /// The frame of the aligned nodes.
    pub(crate) frame: MeshFrame,
    pub(crate) bounds: Aabb,
    pub(crate) n_primitives: usize,
    pub(crate) predicted: PredictedCost,
    pub(crate) baseline: Baseline,
    pub(crate) path: AvailablePath,
}

/// A [`WideBvh`] over triangles. [`Config::test`](crate::Config::test) is the triangle test.
pub type TriangleBvh = WideBvh<Triangle>;

/// Predicted cost of a ray that enters the root, in tests of aligned nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PredictedCost {
    /// With aligned nodes only.
    pub aligned: f32,
    /// Of the BVH as it was built.
    pub chosen: f32,
}

/// Sizes of a BVH.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Nodes of each kind, in the order of [`NodeKind::ALL`](crate::NodeKind::ALL).
    pub nodes: [usize; 2],
    /// Bytes of all nodes.
    pub node_bytes: usize,
    /// Bytes of all leaves: triangle blocks, or primitives and their order.
    pub leaf_bytes: usize,
    /// Greatest number of nodes from the root to a leaf.
    pub depth: u32,
}

impl<P: LeafPrimitive> WideBvh<P> {
    /// The same BVH traced with other instructions; with [`SimdPath::Scalar`] where this machine lacks them.
    #[must_use]
    pub fn with_path(mut self, path: SimdPath) -> Self {
        self.path = path.available();
        self
    }

    /// The instructions that rays are traced with.
    #[must_use]
    pub fn path(&self) -> SimdPath {
        self.path.path()
    }

    /// Axis-aligned box around all primitives, object space; empty for none.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.bounds
    }

    /// The same box as an [`Obb`]; a point at the origin where there is no primitive.
    #[must_use]
    pub fn bounds(&self) -> Obb {
        if self.n_primitives == 0 {
            return Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] };
        }
        Obb::from_aabb(&self.bounds)
    }

    /// Rows of the frame that the boxes of aligned nodes are aligned with.
    #[must_use]
    pub fn frame(&self) -> [[f32; 3]; 3] {
        self.frame.rows
    }

    /// Number of primitives.
    #[must_use]
    pub fn n_primitives(&self) -> usize {
        self.n_primitives
    }

    /// Memory of nodes and leaves.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.nodes.n_bytes() + P::leaf_data(&self.leaves).n_bytes
    }

    /// The traversal cost that the build predicted.
    #[must_use]
    pub fn predicted(&self) -> PredictedCost {
        self.predicted
    }

    /// Number of nodes of each kind, and memory.
    #[must_use]
    pub fn sizes(&self) -> Sizes {
        Sizes {
            nodes: self.nodes.n_of_each_kind(),
            node_bytes: self.nodes.n_bytes(),
            leaf_bytes: P::leaf_data(&self.leaves).n_bytes,
            depth: self.nodes.depth,
        }
    }
}

impl<P: LeafPrimitive> WideBvh<P> {
    /// Calls `visit` with the box of each node and leaf, object space: the box, its level, 0 for the root, and whether it is a leaf.
    /// Parents come before their children.
    ///
    /// Boxes are those that rays are tested with, up to rounding: with the part of the padding that depends on their content.
    pub fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        if self.n_primitives == 0 {
            return;
        }
        let mut open = vec![(self.nodes.root, self.bounds(), 0)];
        while let Some((word, obb, level)) = open.pop() {
            match word.kind() {
                DecodedWord::Empty => {}
                DecodedWord::Leaf { .. } => visit(obb, level, true),
                DecodedWord::Node(kind, line) => {
                    visit(obb, level, false);
                    let words = node_words(&self.nodes.lines, kind, line).iter().enumerate().rev();
                    let children = words.filter(|(_, word)| **word != ChildWord::EMPTY);
                    open.extend(children.filter_map(|(i, &w)| Some((w, self.child_box(kind, line, i)?, level + 1))));
                }
            }
        }
    }

    /// The box in a slot of a node.
    fn child_box(&self, kind: NodeKind, line: u32, i: usize) -> Option<Obb> {
        let NodeBox { rows, lo, hi } = NodeBox::of_slot(&self.nodes.lines, kind, line, i, self.frame.rows);
        let relative = Obb::from_slabs(rows, to_f32(lo), to_f32(hi));
        Some(self.frame.reference.given_box(relative?))
    }
}

impl TriangleBvh {
    /// The vertices of a triangle, as they were given; those of one without area are the ends of its longest edge, one of them twice
    /// ([`canted_obb::flat_as_edge`]): the same points, which no ray hits.
    ///
    /// The first call makes an index of four bytes for each triangle.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn triangle(&self, id: PrimId) -> [[f32; 3]; 3] {
        self.leaves.triangle(&self.nodes, self.n_primitives, id)
    }

    /// The vertices of all triangles, in input order, each as by [`Self::triangle`].
    #[must_use]
    pub fn triangles(&self) -> Vec<[[f32; 3]; 3]> {
        let mut triangles = vec![[[0.0; 3]; 3]; self.n_primitives];
        self.leaves.each_triangle(&self.nodes, |id, lane| triangles[id.index()] = self.leaves.vertices(lane));
        triangles
    }
}

impl Triangles for TriangleBvh {
    fn triangle(&self, id: PrimId) -> [[f32; 3]; 3] {
        Self::triangle(self, id)
    }
}
