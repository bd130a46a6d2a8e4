use canted_obb::{Aabb, Obb};

use crate::KdNodes;
use crate::node::NodeKind;

impl KdNodes {
    /// Calls `visit` with the cell of each node and leaf, but for leaves without triangles, relative to the reference point of what was
    /// given: the cell, its level, 0 for the root, and whether it is a leaf. Parents come before their children.
    pub fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        let mut open: Vec<(usize, Aabb, u32)> = vec![];
        if !self.nodes.is_empty() {
            open.push((0, self.cell, 0));
        }
        while let Some((index, cell, level)) = open.pop() {
            match self.nodes[index].kind() {
                NodeKind::Leaf { first: None, .. } => {}
                NodeKind::Leaf { .. } => visit(Obb::from_aabb(&cell), level, true),
                NodeKind::Inner { axis, plane, upper } => {
                    visit(Obb::from_aabb(&cell), level, false);
                    let (mut above, mut below) = (cell, cell);
                    (above.min[axis], below.max[axis]) = (plane, plane);
                    open.push((upper as usize, above, level + 1));
                    open.push((index + 1, below, level + 1));
                }
            }
        }
    }
}
