use canted_obb::{Aabb, Obb};

use crate::costs::Baseline;
use crate::layout::Nodes;
use crate::leaf::LeafPrimitive;
use crate::simd::{Proven, SimdPath};
use crate::traverse::MeshFrame;

/// A BVH of eight-wide nodes over primitives `P`: triangles ([`TriangleBvh`](crate::TriangleBvh)), spheres, boxes, or any
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
    pub(crate) path: Proven,
}

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
        self.path = path.proven();
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
