//! Boxes of all nodes, anew from the vertices below them, in the frames that the nodes have.

use canted_lbvh::Corners;
use canted_obb::Aabb;
use canted_trace::Slabs;

use super::flaw::Flaw;
use super::outline::{NodeSpot, Outline, Slot};
use crate::emit::{write_boxes, write_slabs};
use crate::layout::{Line, NodeKind, Row};
use crate::traverse::MeshFrame;
use crate::{measure, par};

/// What boxes are written from.
struct Source<'a> {
    outline: &'a Outline,
    /// By place.
    corners: &'a [Corners],
    /// Boxes in the mesh's frame, of leaves and nodes.
    leaf_boxes: Vec<Aabb>,
    node_boxes: Vec<Aabb>,
}

/// Writes the boxes of all nodes, rounded outward as a build does it.
///
/// Boxes in the mesh's frame are joined bottom-up. A leaning box is tight only if it is made of all vertices below, so
/// each triangle is looked at once for each leaning box around it.
pub(crate) fn write(outline: &Outline, corners: &[Corners], frame: &MeshFrame, lines: &mut [Line]) {
    let source = Source::new(outline, corners, frame);
    par::for_pieces(&outline.nodes_by_line(), lines, |node| node.line, |node, out| source.write_node(node, out));
}

impl<'a> Source<'a> {
    fn new(outline: &'a Outline, corners: &'a [Corners], frame: &MeshFrame) -> Self {
        let boxes = measure::boxes(corners, frame.rows);
        let join = |boxes: &[Aabb]| boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
        let leaf_boxes: Vec<Aabb> = outline.leaves.iter().map(|leaf| join(&boxes[leaf.places.clone()])).collect();
        let node_boxes = vec![Aabb::EMPTY; outline.nodes.len()];
        let mut source = Self { outline, corners, leaf_boxes, node_boxes };
        for (i, node) in outline.nodes.iter().enumerate().rev() {
            let children = node.slots.map(|slot| source.aligned(slot).unwrap_or(Aabb::EMPTY));
            source.node_boxes[i] = join(&children);
        }
        source
    }

    /// The box of what a slot holds, in the mesh's frame.
    fn aligned(&self, slot: Slot) -> Option<Aabb> {
        match slot {
            Slot::Nothing => None,
            Slot::Leaf(leaf) => Some(self.leaf_boxes[leaf]),
            Slot::Node(node) => Some(self.node_boxes[node]),
        }
    }

    /// The box of what a slot holds, along `rows`.
    fn leaning(&self, slot: Slot, rows: [[f32; 3]; 3]) -> Option<Slabs> {
        if slot == Slot::Nothing {
            return None;
        }
        let vertices = self.corners[self.outline.places(slot)].iter().flatten().copied();
        Some(Slabs::from_points(rows, vertices))
    }

    fn write_node(&self, node: &NodeSpot, out: &mut [Line]) {
        let rows: &mut [Row] = bytemuck::cast_slice_mut(out);
        match node.kind {
            NodeKind::Aligned => {
                write_boxes(&mut rows[..6], |i| self.aligned(node.slots[i]).map(|aabb| (aabb.min, aabb.max)));
            }
            NodeKind::Oriented => {
                for (i, &slot) in node.slots.iter().enumerate() {
                    write_slabs(rows, i, self.leaning(slot, frame_of(rows, i)).as_ref());
                }
            }
        }
    }
}

/// Rows of the frame that the box of slot `i` of an oriented node stands in.
fn frame_of(rows: &[Row], i: usize) -> [[f32; 3]; 3] {
    std::array::from_fn(|k| std::array::from_fn(|axis| rows[5 * k + axis][i]))
}

/// Half of the surface area of the box of slot `i`.
pub(crate) fn half_area(node: &NodeSpot, lines: &[Line], i: usize) -> f64 {
    let rows = rows_of(node, lines);
    let extents: [f64; 3] = std::array::from_fn(|k| match node.kind {
        NodeKind::Oriented => 2.0 * f64::from(rows[5 * k + 4][i]),
        NodeKind::Aligned => f64::from(rows[2 * k + 1][i]) - f64::from(rows[2 * k][i]),
    });
    let [x, y, z] = extents;
    x * y + y * z + z * x
}

/// Whether every row that a box stands in is as short as the tests of rays assume.
pub(crate) fn check_frame(node: &NodeSpot, lines: &[Line]) -> Result<(), Flaw> {
    if node.kind == NodeKind::Aligned {
        return Ok(());
    }
    let rows = rows_of(node, lines);
    let leaning = (0..8).filter(|&i| node.slots[i] != Slot::Nothing);
    leaning.flat_map(|i| frame_of(rows, i)).try_for_each(|row| check_row(row, Some(node.line)))
}

/// Greatest length of a row, by the contract of [`Slabs`].
const MAX_LENGTH: f64 = 1.0 + 2.0 * f32::EPSILON as f64;

/// Whether a row is no longer than a unit vector may be after rounding; 2⁻⁵² in the last digit cannot matter.
pub(crate) fn check_row(row: [f32; 3], line: Option<usize>) -> Result<(), Flaw> {
    let length = row.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
    // Not a number is no length either.
    if length <= MAX_LENGTH { Ok(()) } else { Err(Flaw::Row { line, length }) }
}

/// Whether `lines` hold the boxes of `right` for this node, by value: the sign of a zero is nothing.
pub(crate) fn compare(node: &NodeSpot, lines: &[Line], right: &[Line]) -> Result<(), Flaw> {
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

fn rows_of<'a>(node: &NodeSpot, lines: &'a [Line]) -> &'a [Row] {
    bytemuck::cast_slice(&lines[node.line..node.line + node.kind.n_lines()])
}
