use canted_obb::PrimId;

use crate::bvh::WideBvh;
use crate::leaf::LeafPrimitive;

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
/// own, relative to [`RawBvh::reach`], may ignore that.
///
/// Leaves of triangles start at half of a block of four: blocks have 40 words, nine coordinates of four triangles and their
/// ids. While more than four triangles of a leaf remain, the next two blocks are one whose rows have eight words. Leaves of
/// other primitives start at an index into [`RawBvh::order`].
#[derive(Clone, Copy, Debug)]
pub struct RawBvh<'a> {
    /// Nodes, in lines of sixteen words.
    pub nodes: &'a [u32],
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
            nodes: bytemuck::cast_slice(&self.nodes.lines),
            blocks: leaves.blocks,
            order: leaves.order,
            root: self.nodes.root.0,
            depth: self.nodes.depth,
            frame: self.frame.rows,
            reach: self.bounds.reach(),
        }
    }
}
