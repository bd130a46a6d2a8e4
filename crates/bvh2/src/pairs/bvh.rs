use canted_obb::{Aabb, Obb};
use canted_trace::Slabs;

use super::child::ChildRef;
use super::node::{AabbPair, SlabPair};

/// A binary BVH over leaves of any kind: it stores boxes and leaf positions, and reports the leaves that a ray may hit.
///
/// Boxes carry the part of the padding that depends on their content, so a [`SlabRay`](canted_trace::SlabRay) needs no reach:
/// `SlabRay::new(&ray, 0.0)`, or `SlabRay::with_error(&ray, 0.0, error)` for leaves other than triangles.
///
/// [`Bvh2`](crate::Bvh2) adds triangles. Pairs of two axis-aligned boxes take 64 bytes, pairs with an oriented box 128.
#[derive(Clone, Debug)]
pub struct PairBvh {
    pub(super) aabb_pairs: Vec<AabbPair>,
    pub(super) slab_pairs: Vec<SlabPair>,
    pub(super) root: Option<ChildRef>,
    pub(super) root_slabs: Slabs,
    pub(super) bounds: Obb,
    pub(super) reach: f32,
    pub(super) depth: u32,
}

impl PairBvh {
    /// A BVH without leaves.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            aabb_pairs: vec![],
            slab_pairs: vec![],
            root: None,
            root_slabs: Slabs::from_aabb(&Aabb::EMPTY),
            bounds: Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] },
            reach: 0.0,
            depth: 0,
        }
    }

    /// The box of the root; a point at the origin if there are no leaves.
    #[must_use]
    pub fn bounds(&self) -> &Obb {
        &self.bounds
    }

    /// Greatest absolute coordinate of the leaves' bounds.
    #[must_use]
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// Number of nodes on the longest path from the root to a leaf, including the leaf.
    #[must_use]
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Memory of all pairs.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        size_of_val(&self.aabb_pairs[..]) + size_of_val(&self.slab_pairs[..])
    }

    /// Number of pairs of two axis-aligned boxes, and of pairs with an oriented box.
    #[must_use]
    pub fn n_pairs(&self) -> (usize, usize) {
        (self.aabb_pairs.len(), self.slab_pairs.len())
    }
}
