//! From a plan to records: first the position of every node and leaf, then their content, each on all threads.

use std::ops::DerefMut;

use canted_lbvh::{Child, ChildKind, Corners};
use canted_obb::{Aabb, PrimId, flat_as_edge};
use canted_trace::Slabs;

use crate::build::layout::{Layout, NodeDraft, Source, SubtreeDraft, distinct, range};
use crate::node::{
    CacheLine, ChildWord, HalfBlock, LaneWords, LeafLayout, NodeKind, Nodes, Records, Row, write_boxes, write_slabs,
};
use crate::par;

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
    let (root, depth) = (layout.root.unwrap_or(ChildWord::EMPTY), layout.depth);
    let pieces = layout.pieces.iter().map(|piece| piece.of_memory(leaves.layout)).collect();
    (Nodes { lines, root, depth, has_oriented, pieces, links: None }, units)
}

/// Writes the nodes and leaves of a piece into its own memory.
fn write_piece<U, B>(
    source: &Source,
    leaves: &Leaves<'_, U, B>,
    piece: &SubtreeDraft,
    lines: &mut [CacheLine],
    units: &mut [U],
) {
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

/// Writes triangles in leaf order, and their ids, from a part of `out` on.
pub(crate) fn write_triangles(
    triangles: impl ExactSizeIterator<Item = (Corners, PrimId)>,
    part: usize,
    out: &mut [HalfBlock],
) {
    let n = triangles.len();
    let words: &mut [u32] = bytemuck::cast_slice_mut(out);
    for (i, (corners, id)) in triangles.enumerate() {
        let lane = LaneWords::of(i, n, part);
        for (row, x) in flat_as_edge(corners).as_flattened().iter().enumerate() {
            words[lane.word(row)] = x.to_bits();
        }
        words[lane.word(LaneWords::ID_ROW)] = id.0;
    }
}

/// Writes ids in leaf order.
pub(crate) fn write_ids(ids: impl Iterator<Item = PrimId>, out: &mut [PrimId]) {
    out.iter_mut().zip(ids).for_each(|(out, id)| *out = id);
}

/// Writes a node's boxes, and child words as `named`.
pub(super) fn write_node(
    source: &Source,
    draft: &NodeDraft,
    named: &dyn Fn(ChildWord) -> ChildWord,
    out: &mut [CacheLine],
) {
    let rows: &mut [Row] = bytemuck::cast_slice_mut(out);
    let children = &draft.children[..draft.n_children];
    let pad = |child: Child| source.pads.of(draft.kind, (source.reach)(child));
    let word_row = match draft.kind {
        NodeKind::Aligned => {
            write_boxes(&mut rows[..6], |i| {
                let child = children.get(i)?.0;
                Some((aligned_box(source, child), pad(child)))
            });
            6
        }
        NodeKind::Oriented => {
            for i in 0..8 {
                let children = &draft.children[..draft.n_children];
                let padded = children.get(i).map(|&(child, _)| (oriented_box(source, child), pad(child)));
                write_slabs(rows, i, padded);
            }
            15
        }
    };
    for (i, slot) in rows[word_row].iter_mut().enumerate() {
        let word = children.get(i).map_or(ChildWord::EMPTY, |&(_, word)| named(word));
        *slot = f32::from_bits(word.0);
    }
}

/// A box around all primitives below a child, in the child's frame.
fn oriented_box(source: &Source, child: Child) -> Slabs {
    let range = range(source, child);
    (source.slabs)(range.start as usize..range.end as usize, (source.frames)(child))
}

fn aligned_box(source: &Source, child: Child) -> Aabb {
    match child.kind() {
        ChildKind::Leaf(place) => source.leaf_boxes[place as usize],
        ChildKind::Inner(id) => source.inner_boxes[id.index()],
    }
}
