//! Boxes of all nodes, computed from the hierarchy of a BVH and its primitives: what loaded files are compared with. A refit computes
//! them in another way.

use std::ops::Range;

use canted_obb::Aabb;
use canted_trace::Slabs;

use crate::build::item::{self, Item};
use crate::build::subtrees::SubtreeReaches;
use crate::node::checked::{CheckedLeaf, CheckedNode, Hierarchy, Slot};
use crate::node::{CacheLine, Flaw, NodeKind, Row, write_boxes, write_slabs};
use crate::par;
use crate::traverse::{BoxPads, MeshFrame};

/// What boxes are written from.
struct Source<'a> {
    hierarchy: &'a Hierarchy,
    slabs: &'a SlabsOf<'a>,
    contents: &'a [LeafContent],
    /// Boxes of nodes in the mesh frame, relative to the reference point.
    node_boxes: Vec<Aabb>,
    reaches: SubtreeReaches,
    pads: &'a BoxPads,
}

/// The box with these rows around a range of places.
type SlabsOf<'a> = dyn Fn(Range<usize>, [[f32; 3]; 3]) -> Slabs + Sync + 'a;

/// What the boxes around a leaf depend on.
#[derive(Clone, Copy, Debug)]
struct LeafContent {
    /// Greatest coordinate relative to the reference point.
    reach: f32,
    /// The boxes of all items in the mesh frame, together.
    aligned: Aabb,
}

impl LeafContent {
    /// Of these items, as they are given, in this frame.
    fn of<I: Item>(items: impl Iterator<Item = I>, frame: &MeshFrame) -> Self {
        let (mut bounds, mut aligned) = (Aabb::EMPTY, Aabb::EMPTY);
        for item in items {
            bounds = bounds.union(item.aabb());
            if !frame.is_identity {
                aligned = aligned.union(item::rotated_box(&item.moved(frame.reference), &frame.rows));
            }
        }
        // Rounding is monotonic, so this is the box of all moved items.
        let moved = frame.reference.moved_box(&bounds);
        Self { reach: moved.reach(), aligned: if frame.is_identity { moved } else { aligned } }
    }

    /// Of each leaf; `items` are by place.
    fn of_leaves<I: Item>(hierarchy: &Hierarchy, items: &[I], frame: &MeshFrame) -> Vec<Self> {
        let content = |leaf: &CheckedLeaf| Self::of(items[leaf.places.clone()].iter().copied(), frame);
        par::map(&hierarchy.leaves, LEAVES, content)
    }
}

/// Fewest leaves of one job.
const LEAVES: usize = 256;

/// Writes the boxes of all nodes, rounded outward and padded as a build does it; `items` are by place, as they are given.
///
/// Boxes in the mesh frame are joined bottom-up. An oriented box is tight only if it is computed from all primitives below, so
/// each primitive is read once for each oriented box around it.
pub(crate) fn write<I: Item>(
    hierarchy: &Hierarchy,
    items: &[I],
    frame: &MeshFrame,
    pads: &BoxPads,
    lines: &mut [CacheLine],
) {
    let contents = &LeafContent::of_leaves(hierarchy, items, frame);
    let moved = item::moved(items, frame.reference);
    let items = moved.as_deref().unwrap_or(items);
    let slabs = &|places: Range<usize>, rows| I::slabs(&items[places], rows);
    let reaches = SubtreeReaches::of_leaves(hierarchy, contents.iter().map(|content| content.reach).collect());
    let mut source =
        Source { hierarchy, slabs, contents, node_boxes: vec![Aabb::EMPTY; hierarchy.nodes.len()], reaches, pads };
    for (i, node) in hierarchy.nodes.iter().enumerate().rev() {
        let children = node.slots.map(|slot| source.aligned_box(slot).unwrap_or(Aabb::EMPTY));
        source.node_boxes[i] = children.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
    }
    par::for_pieces(&hierarchy.nodes_by_line(), lines, |node| node.line, |node, out| source.write_node(node, out));
}

impl Source<'_> {
    /// The box of the content of a slot, in the mesh frame.
    fn aligned_box(&self, slot: Slot) -> Option<Aabb> {
        match slot {
            Slot::Empty => None,
            Slot::Leaf(leaf) => Some(self.contents[leaf].aligned),
            Slot::Node(node) => Some(self.node_boxes[node]),
        }
    }

    /// The box of the content of a slot, along `rows`.
    fn oriented_box(&self, slot: Slot, rows: [[f32; 3]; 3]) -> Option<Slabs> {
        (slot != Slot::Empty).then(|| (self.slabs)(self.hierarchy.places(slot), rows))
    }

    fn write_node(&self, node: &CheckedNode, out: &mut [CacheLine]) {
        let rows: &mut [Row] = bytemuck::cast_slice_mut(out);
        let pad = |slot| self.pads.of(node.kind, self.reaches.of_slot(slot));
        match node.kind {
            NodeKind::Aligned => {
                write_boxes(&mut rows[..6], |i| Some((self.aligned_box(node.slots[i])?, pad(node.slots[i]))));
            }
            NodeKind::Oriented => {
                for (i, &slot) in node.slots.iter().enumerate() {
                    let slabs = self.oriented_box(slot, frame_of(rows, i));
                    write_slabs(rows, i, slabs.map(|slabs| (slabs, pad(slot))));
                }
            }
        }
    }
}

/// The frame of the box in slot `i` of an oriented node.
pub(super) fn frame_of(rows: &[Row], i: usize) -> [[f32; 3]; 3] {
    std::array::from_fn(|k| std::array::from_fn(|axis| rows[5 * k + axis][i]))
}

/// Whether the rows of all frames are as short as the box tests assume.
pub(crate) fn check_frame(node: &CheckedNode, lines: &[CacheLine]) -> Result<(), Flaw> {
    if node.kind == NodeKind::Aligned {
        return Ok(());
    }
    let rows = rows_of(node, lines);
    let used = (0..8).filter(|&i| node.slots[i] != Slot::Empty);
    used.flat_map(|i| frame_of(rows, i)).try_for_each(|row| check_row(row, Some(node.line)))
}

/// Greatest length of a row, by the contract of [`Slabs`].
const MAX_LENGTH: f64 = 1.0 + 2.0 * f32::EPSILON as f64;

/// Whether a row is no longer than a unit vector may be after rounding; an error of 2⁻⁵² does not matter.
pub(crate) fn check_row(row: [f32; 3], line: Option<usize>) -> Result<(), Flaw> {
    let length = row.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
    // False for NaN, too.
    if length <= MAX_LENGTH { Ok(()) } else { Err(Flaw::Row { line, length }) }
}

/// Whether `lines` hold the boxes of `right` for this node, by value: signs of zeros are ignored.
pub(crate) fn compare(node: &CheckedNode, lines: &[CacheLine], right: &[CacheLine]) -> Result<(), Flaw> {
    let rows = match node.kind {
        NodeKind::Aligned => 0..6,
        NodeKind::Oriented => 0..15,
    };
    let (found, want) = (&rows_of(node, lines)[rows.clone()], &rows_of(node, right)[rows]);
    match (0..8).find(|&i| found.iter().zip(want).any(|(a, b)| a[i] != b[i])) {
        Some(slot) => Err(Flaw::Box { line: node.line, slot }),
        None => Ok(()),
    }
}

fn rows_of<'a>(node: &CheckedNode, lines: &'a [CacheLine]) -> &'a [Row] {
    bytemuck::cast_slice(&lines[node.line..node.line + node.kind.n_lines()])
}
