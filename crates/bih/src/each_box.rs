use canted_obb::{Aabb, Obb};

use crate::BoxBih;
use crate::node::NodeKind;

impl BoxBih {
    /// Calls `visit` with the box of each node and leaf, relative to the reference point of what was given: the box, its level, 0 for
    /// the root, and whether it is a leaf. Parents come before their children.
    ///
    /// The box of a node is that of its parent, cut at the plane of the split: what rays are tested with, and what is below it.
    pub fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        let mut open: Vec<(usize, Aabb, u32)> = vec![];
        if !self.nodes.is_empty() {
            open.push((0, self.padded_bounds, 0));
        }
        while let Some((index, aabb, level)) = open.pop() {
            let node = self.nodes[index];
            let [upper, lower] = node.planes;
            let cut = |axis: usize, max: f32, min: f32| {
                let mut part = aabb;
                part.max[axis] = part.max[axis].min(max);
                part.min[axis] = part.min[axis].max(min);
                part
            };
            visit(Obb::from_aabb(&aabb), level, matches!(node.kind(), NodeKind::Leaf { .. }));
            match node.kind() {
                NodeKind::Leaf { .. } => {}
                NodeKind::Clip { axis } => open.push((index + 1, cut(axis, upper, lower), level + 1)),
                NodeKind::Split { axis, second } => {
                    open.push((index + second as usize, cut(axis, f32::INFINITY, lower), level + 1));
                    open.push((index + 1, cut(axis, upper, f32::NEG_INFINITY), level + 1));
                }
            }
        }
    }
}
