use canted_obb::Obb;
use glam::Vec4;

use super::bvh::PairBvh;
use super::child::{ChildRef, ChildRefKind};

impl PairBvh {
    /// Calls `visit` with the box of each node and leaf, relative to the reference point of what was given: the box, its level, 0 for
    /// the root, and whether it is a leaf. Parents come before their children.
    ///
    /// Boxes are those that rays are tested with, up to rounding: with the part of the padding that depends on their content.
    pub fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        let mut open: Vec<(ChildRef, Obb, u32)> = self.root.map(|root| (root, self.bounds, 0)).into_iter().collect();
        while let Some((child, obb, level)) = open.pop() {
            let pair = self.pair(child);
            visit(obb, level, pair.is_none());
            let children = pair.into_iter().flatten().rev();
            open.extend(children.filter_map(|(child, obb)| Some((child, obb?, level + 1))));
        }
    }

    /// The children of a pair and their boxes; `None` for a leaf.
    fn pair(&self, child: ChildRef) -> Option<[(ChildRef, Option<Obb>); 2]> {
        let (children, rows, planes): (_, [[[f32; 3]; 3]; 2], &[Vec4; 3]) = match child.kind() {
            ChildRefKind::Leaf(_) => return None,
            ChildRefKind::Aabbs(index) => {
                let pair = &self.aabb_pairs[index as usize];
                (pair.children, [Obb::IDENTITY_FRAME; 2], &pair.planes)
            }
            ChildRefKind::Slabs(index) => {
                let pair = &self.slab_pairs[index as usize];
                let row = |i: usize, k: usize| {
                    let z = pair.rows_z[k / 2];
                    [pair.rows_xy[k][i], pair.rows_xy[k][2 + i], z[2 * (k % 2) + i]]
                };
                (pair.children(), [0, 1].map(|i| std::array::from_fn(|k| row(i, k))), &pair.planes)
            }
        };
        let ends = |i: usize| std::array::from_fn(|k| planes[k][i]);
        Some([0, 1].map(|i| (children[i], Obb::from_slabs(rows[i], ends(i), ends(2 + i)))))
    }
}
