use canted_obb::PrimId;

use crate::emit::Records;
use crate::traverse::{LaneKernel, MeshFrame};
use crate::{BoxTree, WideBvh};

/// A tree's records as rays read them, for whoever walks them without this crate: a kernel on another device.
///
/// A word names a leaf or a node. Bit 31 set, a leaf: bits 26 to 30 hold its number of primitives less one, bits 0 to 25 where
/// they start. Else a node: bits 29 and 30 hold its kind in the order of [`NodeKind::ALL`](crate::NodeKind::ALL), bits 0 to 28
/// its first line of sixteen words; 3 is no child. Rows of nodes and blocks are those of the table in `layout.rs`: a
/// node's eight child words are its row 6 or 15 of eight words.
///
/// Leaves of triangles start at half a block of four: blocks have 40 words, nine coordinates of four triangles and their
/// numbers. While more than four triangles of a leaf remain, the next two blocks are one whose rows have eight. Leaves of
/// boxes start at a place in the order that goes with the words.
#[derive(Clone, Copy, Debug)]
pub struct RawBvh<'a> {
    /// Nodes, in lines of sixteen words.
    pub nodes: &'a [u32],
    /// Triangles, in blocks of forty words; nothing of boxes.
    pub blocks: &'a [u32],
    /// The root's word.
    pub root: u32,
    /// Nodes on the longest way from the root to a leaf.
    pub depth: u32,
    /// Rows of the frame that box nodes stand in.
    pub frame: [[f32; 3]; 3],
    /// Greatest absolute coordinate of what the boxes hold; a test by rays must allow for rounding relative to it.
    pub reach: f32,
}

impl<'a> RawBvh<'a> {
    fn of(records: &'a Records, frame: &MeshFrame, reach: f32) -> Self {
        let Records { lines, halves, root, depth } = records;
        Self {
            nodes: bytemuck::cast_slice(lines),
            blocks: bytemuck::cast_slice(halves),
            root: root.0,
            depth: *depth,
            frame: frame.rows,
            reach: if lines.is_empty() && halves.is_empty() { 0.0 } else { reach },
        }
    }
}

impl<K: LaneKernel> WideBvh<K> {
    /// The tree's records as words.
    #[must_use]
    pub fn words(&self) -> RawBvh<'_> {
        RawBvh::of(&self.records, &self.frame, self.bounds.reach())
    }
}

impl BoxTree {
    /// The tree's records as words, and the boxes in the order that its leaves name places of.
    #[must_use]
    pub fn words(&self) -> (RawBvh<'_>, &[PrimId]) {
        (RawBvh::of(&self.records, &MeshFrame::IDENTITY, self.reach()), &self.numbers)
    }
}
