//! What a TLAS needs of its levels.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

use canted_obb::Obb;

use crate::ScaledRay;

/// A BVH over numbered boxes, as the top level of a TLAS needs it: reports the boxes that a ray enters.
pub trait BoxBvh: core::fmt::Debug + Send + Sync {
    /// Calls `enter` with the number of each box that `ray` enters at or before `t_max`, nearer subtrees first if `is_ordered`; returns
    /// how many boxes were tested.
    ///
    /// `enter` gets the scaled `t_max` and returns the new one; a negative one ends the traversal. A box is entered no later than any
    /// hit within `error` of it in each coordinate, and while that is at most `t_max`: so all hits of equal `t` are found.
    fn traverse(&self, ray: &ScaledRay, error: f64, is_ordered: bool, enter: &mut dyn FnMut(u32, f32) -> f32) -> u32;

    /// The BVH with new boxes of the same numbers, in the same topology.
    fn refitted(&self, boxes: &[Obb]) -> Arc<dyn BoxBvh>;

    /// How many times the predicted traversal cost has grown by refits.
    fn drift(&self) -> f32;

    /// Calls `visit` with the box of each node and leaf, its level, 0 for the root, and whether it is a leaf.
    fn each_box(&self, visit: &mut dyn FnMut(Obb, u32, bool));

    /// Memory in bytes.
    fn n_bytes(&self) -> usize;
}

/// A bottom-level BVH that a TLAS can save and load.
///
/// An enum of several kinds writes a byte for the kind, then the bytes of the BVH.
pub trait SaveBlas: Sized {
    /// Why bytes are not such a BVH.
    type Error;

    /// The BVH as bytes.
    fn to_bytes(&self) -> Vec<u8>;

    /// The BVH that [`SaveBlas::to_bytes`] wrote.
    ///
    /// # Errors
    /// Bytes that it did not write: they may come from anywhere.
    fn from_bytes(bytes: &[u8]) -> Result<Self, Self::Error>;
}

impl<B: SaveBlas> SaveBlas for Box<B> {
    type Error = B::Error;

    fn to_bytes(&self) -> Vec<u8> {
        B::to_bytes(self)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, B::Error> {
        B::from_bytes(bytes).map(Self::new)
    }
}

impl<B: SaveBlas> SaveBlas for Arc<B> {
    type Error = B::Error;

    fn to_bytes(&self) -> Vec<u8> {
        B::to_bytes(self)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, B::Error> {
        B::from_bytes(bytes).map(Self::new)
    }
}
