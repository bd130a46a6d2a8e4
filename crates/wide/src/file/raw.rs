//! The records of a BVH as words, for other devices.

use std::borrow::Cow;

use canted_obb::PrimId;
use canted_obb::vector::{dot, to_f64};
use canted_trace::lanes::lower;

use crate::bvh::WideBvh;
use crate::leaf::LeafPrimitive;
use crate::node::{CacheLine, DecodedWord, NOWHERE, NodeKind, Nodes, Row};
use crate::traverse::MeshFrame;

/// The records of a BVH as words, for traversal without this crate: by a kernel on another device.
///
/// A word names a leaf or a node. With bit 31 set it is a leaf: bits 26 to 30 hold its number of primitives less one, bits 0 to
/// 25 where they start. Otherwise it is a node: bits 29 and 30 hold its kind in the order of
/// [`NodeKind::ALL`](crate::NodeKind::ALL), or 3 for no child; bits 0 to 28 hold its first line of sixteen words.
///
/// A node is made of rows of eight words, one per child. Aligned nodes, 8 rows: lower and upper bounds along x, y and z of
/// [`RawBvh::frame`], the child words, an unused row. Oriented nodes, 16 rows: for each of three axes its x, y and z,
/// the center and the half-extent along it; then the child words.
///
/// Boxes are those of rays on the CPU: enlarged by the part of the padding that depends on their content. A tracer with pads of its
/// own, relative to [`RawBvh::reach`], may ignore that. They are in object space: those of a BVH whose boxes are relative to a point
/// near a distant mesh are moved back, and rounded outward.
///
/// Leaves of triangles start at half of a block of four: blocks have 40 words, nine coordinates of four triangles and their
/// ids. While more than four triangles of a leaf remain, the next two blocks are one whose rows have eight words. Leaves of
/// other primitives start at an index into [`RawBvh::order`].
#[derive(Clone, Debug)]
pub struct RawBvh<'a> {
    /// Nodes, in lines of sixteen words.
    pub nodes: Cow<'a, [u32]>,
    /// Triangles, in blocks of forty words; empty for other primitives.
    pub blocks: &'a [u32],
    /// Primitives in the order of the leaves; empty for triangles.
    pub order: &'a [PrimId],
    /// The root's word.
    pub root: u32,
    /// Greatest number of nodes from the root to a leaf.
    pub depth: u32,
    /// Rows of the frame that aligned nodes are aligned with.
    pub frame: [[f32; 3]; 3],
    /// Greatest absolute coordinate of any primitive ([`canted_obb::Aabb::reach`]); box tests must allow for rounding relative to it.
    pub reach: f32,
}

impl<P: LeafPrimitive> WideBvh<P> {
    /// The records as words.
    #[must_use]
    pub fn raw(&self) -> RawBvh<'_> {
        let leaves = P::leaf_data(&self.leaves);
        RawBvh {
            nodes: in_object_space(&self.nodes, &self.frame),
            blocks: leaves.blocks,
            order: leaves.order,
            root: self.nodes.root.0,
            depth: self.nodes.depth,
            frame: self.frame.rows,
            reach: self.bounds.reach(),
        }
    }
}

/// The nodes with boxes relative to the origin of object space.
fn in_object_space<'a>(nodes: &'a Nodes, frame: &MeshFrame) -> Cow<'a, [u32]> {
    if frame.reference.is_origin() {
        return Cow::Borrowed(bytemuck::cast_slice(&nodes.lines));
    }
    let reference = to_f64(frame.reference.point());
    let mut lines = nodes.lines.to_vec();
    nodes.each_word(|word| {
        if let DecodedWord::Node(kind, line) = word {
            let node = &mut lines[line as usize..line as usize + kind.n_lines()];
            move_back(kind, reference, &frame.rows, node);
        }
    });
    Cow::Owned(lines.into_iter().flat_map(|CacheLine(words)| words).collect())
}

/// Moves the boxes of a node outward by more than what is rounded.
fn move_back(kind: NodeKind, reference: [f64; 3], frame: &[[f32; 3]; 3], node: &mut [CacheLine]) {
    let rows: &mut [Row] = bytemuck::cast_slice_mut(node);
    #[expect(clippy::needless_range_loop, reason = "a lane of several rows")]
    for i in 0..8 {
        for k in 0..3 {
            match kind {
                NodeKind::Aligned if rows[2 * k][i] < NOWHERE => {
                    let at = dot(to_f64(frame[k]), reference);
                    rows[2 * k][i] = sum_down(rows[2 * k][i], at, reference);
                    rows[2 * k + 1][i] = -sum_down(-rows[2 * k + 1][i], -at, reference);
                }
                NodeKind::Oriented if rows[5 * k + 4][i] > -NOWHERE => {
                    let row = [0, 1, 2].map(|axis| f64::from(rows[5 * k + axis][i]));
                    let (center, half) = (rows[5 * k + 3][i], rows[5 * k + 4][i]);
                    let exact = f64::from(center) + dot(row, reference);
                    let moved = exact as f32;
                    rows[5 * k + 3][i] = moved;
                    let rounding = (f64::from(moved) - exact).abs() + slack(exact, reference);
                    rows[5 * k + 4][i] = -lower(-half, rounding);
                }
                _ => {}
            }
        }
    }
}

/// An f32 not above `plane + at` in real arithmetic.
fn sum_down(plane: f32, at: f64, reference: [f64; 3]) -> f32 {
    lower(plane, -at + slack(f64::from(plane), reference))
}

/// More than the roundings in f64 of a sum and of the projection of the reference point, whose rows are shorter than 2: fewer than 16, of
/// 2^-53 each.
fn slack(sum: f64, reference: [f64; 3]) -> f64 {
    let [x, y, z] = reference.map(f64::abs);
    (sum.abs() + 2.0 * (x + y + z)) / (1_u64 << 49) as f64
}

#[cfg(test)]
mod tests {
    use canted_fixtures as fixtures;

    use super::*;
    use crate::leaf::StoredTriangles;
    use crate::node::LeafLayout;
    use crate::node::checked::Hierarchy;
    use crate::{Config, TriangleBvh};

    /// Every vertex is in all boxes around it, in object space.
    #[test]
    fn boxes_moved_back_contain_their_triangles() {
        let mut n_kinds = [0, 0];
        for mesh in [fixtures::scaffold_of(1, true, 3), fixtures::coplanar_quads(20).off_axis()] {
            let far = mesh.placed(|[x, y, z]| [x + 1e4, y - 3e3, z + 1e2]);
            for config in [Config::default(), Config::default().axis_aligned()] {
                let bvh: TriangleBvh = TriangleBvh::build_with(&far.positions, &far.triangles, config).unwrap();
                assert!(!bvh.frame.reference.is_origin());
                let hierarchy = Hierarchy::of(&bvh.nodes, bvh.leaves.halves.len(), &LeafLayout::BLOCKS).unwrap();
                let corners = StoredTriangles::read(&hierarchy, &bvh.leaves.halves).corners;
                let raw = bvh.raw();
                let lines: &[Row] = bytemuck::cast_slice(&raw.nodes);
                for node in &hierarchy.nodes {
                    n_kinds[node.kind as usize] += 1;
                    let rows = &lines[2 * node.line..2 * (node.line + node.kind.n_lines())];
                    for (i, &slot) in node.slots.iter().enumerate() {
                        for v in corners[hierarchy.places(slot)].iter().flatten() {
                            assert!(contains(node.kind, rows, &raw.frame, i, to_f64(*v)), "{:?} {i}", node.kind);
                        }
                    }
                }
            }
        }
        assert!(n_kinds.iter().all(|&n| n > 8), "{n_kinds:?}");
    }

    /// In f64, whose roundings are far below the pads of the boxes.
    fn contains(kind: NodeKind, rows: &[Row], frame: &[[f32; 3]; 3], i: usize, v: [f64; 3]) -> bool {
        (0..3).all(|k| match kind {
            NodeKind::Aligned => {
                let at = dot(to_f64(frame[k]), v);
                f64::from(rows[2 * k][i]) <= at && at <= f64::from(rows[2 * k + 1][i])
            }
            NodeKind::Oriented => {
                let row = [0, 1, 2].map(|axis| f64::from(rows[5 * k + axis][i]));
                (dot(row, v) - f64::from(rows[5 * k + 3][i])).abs() <= f64::from(rows[5 * k + 4][i])
            }
        })
    }
}
