//! Boxes of triangles and subtrees along the mesh's axes, and their areas.

use canted_lbvh::{Corners, Leaf, Tree, bottom_up};
use canted_obb::{Aabb, Obb};
use canted_trace::Slabs;

use crate::par;

/// Items of one job.
const CHUNK: usize = 1 << 13;

/// Boxes of triangles along `rows`, rounded outward.
pub(crate) fn boxes(corners: &[Corners], rows: [[f32; 3]; 3]) -> Vec<Aabb> {
    let identity = rows == Obb::IDENTITY_FRAME;
    par::map(corners, CHUNK, Aabb::EMPTY, |corners| {
        if identity {
            return corners.aabb();
        }
        let slabs = Slabs::from_points(rows, *corners);
        Aabb { min: slabs.lo, max: slabs.hi }
    })
}

/// The scale of a mesh with these bounds: [`Aabb::unit_scale`], and 1 for one without extent.
pub(crate) fn unit_scale(bounds: &Aabb) -> f32 {
    bounds.unit_scale().unwrap_or(1.0)
}

/// Half of a box's surface area in the scaled scene.
#[inline]
fn half_area(aabb: &Aabb, scale: f32) -> f32 {
    let [x, y, z]: [f32; 3] = std::array::from_fn(|k| scale * aabb.max[k] - scale * aabb.min[k]);
    x * y + y * z + z * x
}

/// Boxes of a binary tree and half of their areas, along the mesh's axes.
pub(crate) struct Aligned {
    /// By leaf order.
    pub(crate) leaf_boxes: Vec<Aabb>,
    /// By node.
    pub(crate) inner_boxes: Vec<Aabb>,
    pub(crate) leaf_areas: Vec<f32>,
    pub(crate) inner_areas: Vec<f32>,
}

impl Aligned {
    /// Of a tree over primitives with these boxes, in primitive order.
    pub(crate) fn of(tree: &Tree, boxes: &[Aabb], scale: f32) -> Self {
        let leaf_boxes = par::map(&tree.leaves, CHUNK, Aabb::EMPTY, |leaf| boxes[leaf.index()]);
        let inner_boxes = bottom_up(tree, Aabb::EMPTY, |place| leaf_boxes[place as usize], |_, _, a, b| a.union(*b));
        let areas = |boxes: &[Aabb]| par::map(boxes, CHUNK, 0.0, |aabb| half_area(aabb, scale));
        Self { leaf_areas: areas(&leaf_boxes), inner_areas: areas(&inner_boxes), leaf_boxes, inner_boxes }
    }
}
