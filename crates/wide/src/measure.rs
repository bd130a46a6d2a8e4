//! Boxes of subtrees in the mesh frame, and their areas.

use canted_lbvh::{Tree, bottom_up};
use canted_obb::Aabb;

use crate::par;

/// Items of one job.
const CHUNK: usize = 1 << 13;

/// The scale of a mesh with these bounds: [`Aabb::unit_scale`], and 1 where they have no extent.
pub(crate) fn unit_scale(bounds: &Aabb) -> f32 {
    bounds.unit_scale().unwrap_or(1.0)
}

/// Half of a box's surface area in the scaled scene.
#[inline]
fn half_area(aabb: &Aabb, scale: f32) -> f32 {
    let [x, y, z]: [f32; 3] = std::array::from_fn(|k| scale * aabb.max[k] - scale * aabb.min[k]);
    x * y + y * z + z * x
}

/// Boxes of a binary tree and half of their areas, in the mesh frame.
pub(crate) struct Aligned {
    /// In leaf order.
    pub(crate) leaf_boxes: Vec<Aabb>,
    /// By node.
    pub(crate) inner_boxes: Vec<Aabb>,
    pub(crate) leaf_areas: Vec<f32>,
    pub(crate) inner_areas: Vec<f32>,
}

impl Aligned {
    /// For a tree over primitives with these boxes, in primitive order.
    pub(crate) fn of(tree: &Tree, boxes: &[Aabb], scale: f32) -> Self {
        Self::of_leaves(tree, par::map(&tree.leaves, CHUNK, |leaf| boxes[leaf.index()]), scale)
    }

    /// For a tree with these boxes of leaves, in leaf order.
    pub(crate) fn of_leaves(tree: &Tree, leaf_boxes: Vec<Aabb>, scale: f32) -> Self {
        let inner_boxes = bottom_up(tree, Aabb::EMPTY, |i| leaf_boxes[i as usize], |_, _, a, b| a.union(*b));
        let areas = |boxes: &[Aabb]| par::map(boxes, CHUNK, |aabb| half_area(aabb, scale));
        Self { leaf_areas: areas(&leaf_boxes), inner_areas: areas(&inner_boxes), leaf_boxes, inner_boxes }
    }
}
