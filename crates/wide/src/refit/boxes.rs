//! Boxes of all nodes, recomputed from the primitives below them, in the frames that the nodes have.

use std::ops::Range;

use canted_obb::Aabb;
use canted_trace::Slabs;

use crate::emit::{write_boxes, write_slabs};
use crate::flaw::Flaw;
use crate::item::{self, Item};
use crate::layout::{Line, NodeKind, Nodes, Row};
use crate::outline::{LeafOutline, NodeOutline, Outline, Slot};
use crate::par;
use crate::reach::Reaches;
use crate::traverse::{BoxPads, MeshFrame};

/// What boxes are written from.
struct Source<'a> {
    outline: &'a Outline,
    slabs: &'a SlabsOf<'a>,
    contents: &'a [LeafContent],
    /// Boxes of nodes in the mesh frame, relative to the reference point.
    node_boxes: Vec<Aabb>,
    reaches: Reaches,
    pads: &'a BoxPads,
}

/// The box with these rows around a range of places.
pub(super) type SlabsOf<'a> = dyn Fn(Range<usize>, [[f32; 3]; 3]) -> Slabs + Sync + 'a;

/// What the boxes around a leaf and its predicted cost depend on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafContent {
    /// Object space.
    pub(crate) bounds: Aabb,
    /// Greatest coordinate relative to the reference point.
    pub(crate) reach: f32,
    /// The boxes of all items in the mesh frame, together.
    pub(crate) aligned: Aabb,
    /// Sum of the surface areas of all items.
    pub(crate) area: f64,
}

impl LeafContent {
    pub(crate) const EMPTY: Self = Self { bounds: Aabb::EMPTY, reach: 0.0, aligned: Aabb::EMPTY, area: 0.0 };

    /// Of these items, as they are given, in this frame.
    #[inline]
    pub(crate) fn of<I: Item>(items: impl Iterator<Item = I>, frame: &MeshFrame) -> Self {
        let mut content = Self::EMPTY;
        for item in items {
            content.bounds = content.bounds.union(item.aabb());
            content.area += item.area();
            if !frame.is_identity {
                let moved = item.moved(frame.reference);
                content.aligned = content.aligned.union(item::rotated_box(&moved, &frame.rows));
            }
        }
        // Rounding is monotonic, so this is the box of all moved items.
        let moved = frame.reference.moved_box(&content.bounds);
        content.reach = moved.reach();
        if frame.is_identity {
            content.aligned = moved;
        }
        content
    }

    /// Of each leaf; `items` are by place.
    pub(crate) fn of_leaves<I: Item>(outline: &Outline, items: &[I], frame: &MeshFrame) -> Vec<Self> {
        let content = |leaf: &LeafOutline| Self::of(items[leaf.places.clone()].iter().copied(), frame);
        par::map(&outline.leaves, LEAVES, content)
    }
}

/// Fewest leaves of one job.
const LEAVES: usize = 256;

/// Greatest coordinates below leaves and nodes.
pub(super) fn reaches(outline: &Outline, contents: &[LeafContent]) -> Reaches {
    Reaches::of_leaves(outline, contents.iter().map(|content| content.reach).collect())
}

/// Writes the boxes of all nodes, rounded outward and padded as a build does it; `items` are by place, as they are given.
pub(crate) fn write<I: Item>(outline: &Outline, items: &[I], frame: &MeshFrame, pads: &BoxPads, lines: &mut [Line]) {
    let contents = LeafContent::of_leaves(outline, items, frame);
    let moved = item::moved(items, frame.reference);
    let items = moved.as_deref().unwrap_or(items);
    let slabs = |places: Range<usize>, rows| I::slabs(&items[places], rows);
    write_around(outline, &contents, &slabs, pads, lines);
}

/// The same, from the contents of the leaves.
///
/// Boxes in the mesh frame are joined bottom-up. An oriented box is tight only if it is computed from all primitives below, so
/// each primitive is read once for each oriented box around it.
pub(super) fn write_around(
    outline: &Outline,
    contents: &[LeafContent],
    slabs: &SlabsOf,
    pads: &BoxPads,
    lines: &mut [Line],
) {
    let (reaches, node_boxes) = (reaches(outline, contents), vec![Aabb::EMPTY; outline.nodes.len()]);
    let mut source = Source { outline, slabs, contents, node_boxes, reaches, pads };
    for (i, node) in outline.nodes.iter().enumerate().rev() {
        let children = node.slots.map(|slot| source.aligned_box(slot).unwrap_or(Aabb::EMPTY));
        source.node_boxes[i] = children.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
    }
    par::for_pieces(&outline.nodes_by_line(), lines, |node| node.line, |node, out| source.write_node(node, out));
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
        (slot != Slot::Empty).then(|| (self.slabs)(self.outline.places(slot), rows))
    }

    fn write_node(&self, node: &NodeOutline, out: &mut [Line]) {
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
fn frame_of(rows: &[Row], i: usize) -> [[f32; 3]; 3] {
    std::array::from_fn(|k| std::array::from_fn(|axis| rows[5 * k + axis][i]))
}

/// The boxes of a BVH, and how far they were padded.
pub(super) struct Boxes<'a> {
    pub(super) nodes: &'a Nodes,
    pub(super) reaches: &'a Reaches,
    pub(super) pads: &'a BoxPads,
}

impl Boxes<'_> {
    /// Half of the surface area of the box of slot `i` without its padding, up to the rounding of padded planes.
    pub(super) fn half_area(&self, node: &NodeOutline, i: usize) -> f64 {
        let rows = rows_of(node, &self.nodes.lines);
        let pad = self.pads.of(node.kind, self.reaches.of_slot(node.slots[i]));
        let extents: [f64; 3] = std::array::from_fn(|k| {
            let padded = match node.kind {
                NodeKind::Oriented => 2.0 * f64::from(rows[5 * k + 4][i]),
                NodeKind::Aligned => f64::from(rows[2 * k + 1][i]) - f64::from(rows[2 * k][i]),
            };
            (padded - 2.0 * pad).max(0.0)
        });
        let [x, y, z] = extents;
        x * y + y * z + z * x
    }
}

/// Whether the rows of all frames are as short as the box tests assume.
pub(crate) fn check_frame(node: &NodeOutline, lines: &[Line]) -> Result<(), Flaw> {
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
pub(crate) fn compare(node: &NodeOutline, lines: &[Line], right: &[Line]) -> Result<(), Flaw> {
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

fn rows_of<'a>(node: &NodeOutline, lines: &'a [Line]) -> &'a [Row] {
    bytemuck::cast_slice(&lines[node.line..node.line + node.kind.n_lines()])
}
