//! The traced form of a binary tree: siblings' boxes side by side, so that one step tests two.

mod build;
mod pair;
mod walk;

use canted_obb::{Aabb, Obb};
use canted_trace::Slabs;

pub use build::{PairOrder, TracedLeaf};
pub(crate) use pair::{AabbPair, PairRay, SlabPair};

/// A child reference of the traced tree: a leaf, or a pair of either kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub(crate) struct ChildWord(u32);

/// A child word, opened.
pub(crate) enum ChildWordKind {
    Leaf(u32),
    Aabbs(u32),
    Slabs(u32),
}

impl ChildWord {
    const LEAF: u32 = 1 << 31;
    const SLABS: u32 = 1 << 30;

    fn leaf(position: u32) -> Self {
        Self(position | Self::LEAF)
    }

    fn aabbs(index: u32) -> Self {
        Self(index)
    }

    fn slabs(index: u32) -> Self {
        Self(index | Self::SLABS)
    }

    #[inline(always)]
    pub(crate) fn kind(self) -> ChildWordKind {
        if self.0 & Self::LEAF != 0 {
            ChildWordKind::Leaf(self.0 & !Self::LEAF)
        } else if self.0 & Self::SLABS != 0 {
            ChildWordKind::Slabs(self.0 & !Self::SLABS)
        } else {
            ChildWordKind::Aabbs(self.0)
        }
    }
}

/// A traced binary tree. It holds boxes and the positions of leaves; what a leaf is, the caller knows.
///
/// Pairs whose children are both axis-aligned take 64 bytes, pairs with a leaning child 128.
#[derive(Clone, Debug)]
pub struct Binary {
    aabb_pairs: Vec<AabbPair>,
    slab_pairs: Vec<SlabPair>,
    root: Option<ChildWord>,
    root_slabs: Slabs,
    bounds: Obb,
    reach: f32,
    depth: u32,
}

impl Binary {
    /// A tree over nothing, which every ray misses.
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

    /// Box around everything, in the tree's space.
    #[must_use]
    pub fn bounds(&self) -> &Obb {
        &self.bounds
    }

    /// Greatest absolute coordinate of anything below: the size that rounding errors are relative to.
    #[must_use]
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// Nodes on the longest way from root to leaf, the leaf included.
    #[must_use]
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Memory of all pairs.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        size_of_val(&self.aabb_pairs[..]) + size_of_val(&self.slab_pairs[..])
    }

    /// Pairs with two axis-aligned children, and pairs with a leaning one.
    #[must_use]
    pub fn n_pairs(&self) -> (usize, usize) {
        (self.aabb_pairs.len(), self.slab_pairs.len())
    }
}
