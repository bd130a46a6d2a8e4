use std::marker::PhantomData;

use canted_obb::{Aabb, Obb};

use crate::emit::Records;
use crate::refit::Wear;
use crate::simd::SimdPath;
use crate::traverse::{LaneKernel, MeshFrame};

/// A tree of eight-wide nodes over triangles, ready for rays.
///
/// `K` is the triangle test. Hits are those of `K` tried on every triangle: same `t`, `u`, `v`, same primitive, ties to
/// the lowest, on every [`SimdPath`].
#[derive(Clone, Debug)]
pub struct WideBvh<K: LaneKernel> {
    pub(crate) records: Records,
    pub(crate) frame: MeshFrame,
    pub(crate) bounds: Aabb,
    pub(crate) n_triangles: usize,
    pub(crate) predicted: PredictedCost,
    pub(crate) wear: Wear,
    pub(crate) path: SimdPath,
    pub(crate) kernel: PhantomData<K>,
}

/// A BVH over triangles with the triangle test `K`.
pub type TriangleBvh<K = canted_trace::Watertight> = WideBvh<K>;

/// Predicted costs of a ray that enters the root's box, in visits of box nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PredictedCost {
    /// With box nodes only.
    pub aligned: f32,
    /// Of the tree as it was built.
    pub chosen: f32,
}

/// Sizes of a built tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Nodes of each kind, in the order of [`NodeKind::ALL`](crate::NodeKind::ALL).
    pub nodes: [usize; 2],
    /// Bytes of all nodes.
    pub node_bytes: usize,
    /// Bytes of all triangle blocks.
    pub block_bytes: usize,
    /// Nodes on the longest way from the root to a leaf.
    pub depth: u32,
}

impl<K: LaneKernel> WideBvh<K> {
    /// The same tree traced on another path; on the scalar one where this machine lacks it.
    #[must_use]
    pub fn with_path(mut self, path: SimdPath) -> Self {
        self.path = if path.is_available() { path } else { SimdPath::Scalar };
        self
    }

    /// The path that rays are traced on.
    #[must_use]
    pub fn path(&self) -> SimdPath {
        self.path
    }

    /// Box around all triangles, object space.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.bounds
    }

    /// Box around all triangles, in the frame of the mesh.
    #[must_use]
    pub fn bounds(&self) -> Obb {
        if self.n_triangles == 0 {
            return Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] };
        }
        Obb::from_aabb(&self.bounds)
    }

    /// Rows of the frame that its box nodes stand in.
    #[must_use]
    pub fn frame(&self) -> [[f32; 3]; 3] {
        self.frame.rows
    }

    /// Number of triangles.
    #[must_use]
    pub fn n_triangles(&self) -> usize {
        self.n_triangles
    }

    /// Memory of nodes and blocks.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        size_of_val(&self.records.lines[..]) + size_of_val(&self.records.halves[..])
    }

    /// What the build predicted a ray to cost.
    #[must_use]
    pub fn predicted(&self) -> PredictedCost {
        self.predicted
    }

    /// How many nodes of each kind there are, and what they take.
    #[must_use]
    pub fn sizes(&self) -> Sizes {
        self.records.sizes()
    }
}
