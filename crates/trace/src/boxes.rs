use alloc::sync::Arc;

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
