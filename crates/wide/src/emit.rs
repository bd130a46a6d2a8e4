//! From a plan to records: first the position of every node and leaf, then their content, each on all threads.

mod layout;
mod leaf;
mod node;

use std::ops::{DerefMut, Range};

use canted_lbvh::{Child, ChildKind, Tree};
use canted_obb::{Aabb, PrimId};
use canted_trace::Slabs;

use layout::Piece;
pub(crate) use layout::{Layout, layout};
use leaf::distinct;
pub(crate) use leaf::{write_ids, write_triangles};
use node::write_node;
pub(crate) use node::{write_boxes, write_slabs};

use crate::layout::{LeafLayout, Line, NodeKind, Nodes, Word};
use crate::members::Members;
use crate::par;
use crate::records::Records;
use crate::traverse::BoxPads;

/// What records are written from.
pub(crate) struct Source<'a> {
    pub(crate) tree: &'a Tree,
    pub(crate) members: Members<'a>,
    /// The primitive of each place in leaf order.
    pub(crate) primitives: &'a [PrimId],
    /// Whether places may share a primitive.
    pub(crate) is_shared: bool,
    /// Boxes in the mesh frame, rounded outward: of leaves, and of inner nodes by their number.
    pub(crate) leaf_boxes: &'a [Aabb],
    pub(crate) inner_boxes: &'a [Aabb],
    /// Frames of leaves and inner nodes.
    pub(crate) frames: &'a (dyn Fn(Child) -> [[f32; 3]; 3] + Sync),
    /// The box with these rows around the primitives of a range of places, rounded outward.
    pub(crate) slabs: &'a (dyn Fn(Range<usize>, [[f32; 3]; 3]) -> Slabs + Sync),
    /// Greatest coordinates relative to the reference point, of leaves and inner nodes.
    pub(crate) reach: &'a (dyn Fn(Child) -> f32 + Sync),
    pub(crate) pads: BoxPads,
}

/// A BVH has more records than its references can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TooLarge;

/// Writes a leaf: the positions of its primitives in leaf order, the part of the first unit that it starts with, the units.
pub(crate) type WriteLeaf<'a, U> = dyn Fn(&[u32], usize, &mut [U]) + Sync + 'a;

/// How leaves are stored.
pub(crate) struct Leaves<'a, U, B> {
    pub(crate) layout: &'a LeafLayout,
    /// Memory for a number of units.
    pub(crate) units: &'a (dyn Fn(usize) -> B + Sync),
    pub(crate) write: &'a WriteLeaf<'a, U>,
}

/// Writes the wide BVH of a layout: nodes, and units of leaves.
pub(crate) fn emit<U: Send, B: DerefMut<Target = [U]>>(
    source: &Source,
    layout: &Layout,
    leaves: &Leaves<'_, U, B>,
) -> (Nodes, B) {
    let (mut lines, mut units) = (Records::zeroed(layout.n_lines), (leaves.units)(layout.n_units));
    let (mut lines_left, mut units_left) = (&mut lines[..], &mut units[..]);
    let mut jobs = Vec::with_capacity(layout.pieces.len());
    for piece in &layout.pieces {
        let (own_lines, lines_after) = std::mem::take(&mut lines_left).split_at_mut(piece.n_lines);
        let (own_units, units_after) = std::mem::take(&mut units_left).split_at_mut(piece.n_units);
        (lines_left, units_left) = (lines_after, units_after);
        jobs.push((piece, own_lines, own_units));
    }
    par::for_jobs(jobs, |(piece, lines, units)| write_piece(source, leaves, piece, lines, units));
    let has_oriented = layout.pieces.iter().flat_map(|piece| &piece.nodes).any(|node| node.kind == NodeKind::Oriented);
    let (root, depth) = (layout.root.unwrap_or(Word::EMPTY), layout.depth);
    let pieces = layout.pieces.iter().map(|piece| piece.of_memory(leaves.layout)).collect();
    (Nodes { lines, root, depth, has_oriented, pieces }, units)
}

/// Writes the nodes and leaves of a piece into its own memory.
fn write_piece<U, B>(source: &Source, leaves: &Leaves<'_, U, B>, piece: &Piece, lines: &mut [Line], units: &mut [U]) {
    for draft in &piece.nodes {
        write_node(source, draft, &|word| piece.word(word), &mut lines[draft.line..draft.line + draft.kind.n_lines()]);
    }
    for leaf in &piece.leaves {
        let [start, end] = leaf.places;
        let (positions, n) = distinct(source, start, end);
        let (unit, part) = (leaf.first / leaves.layout.n_parts, leaf.first % leaves.layout.n_parts);
        (leaves.write)(&positions[..n], part, &mut units[unit..unit + leaves.layout.n_units(n)]);
    }
}

/// Places of the primitives below a child.
fn range(source: &Source, child: Child) -> Range<u32> {
    match child.kind() {
        ChildKind::Leaf(position) => source.members.range(position, position),
        ChildKind::Inner(id) => {
            let node = &source.tree.nodes[id.index()];
            source.members.range(node.first, node.last)
        }
    }
}
