//! Nodes as rays read them.

use canted_lbvh::{Child, ChildKind};
use canted_obb::Aabb;
use canted_trace::Slabs;
use canted_trace::lanes::lower;

use super::layout::NodeDraft;
use super::{Source, range};
use crate::layout::{Line, NOWHERE, NodeKind, Row, Word};

/// Writes a node's boxes, and child words as `named`.
pub(super) fn write_node(source: &Source, draft: &NodeDraft, named: &dyn Fn(Word) -> Word, out: &mut [Line]) {
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
        let word = children.get(i).map_or(Word::EMPTY, |&(_, word)| named(word));
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

/// Rows lower x, upper x, lower y and so on, of boxes with their pads; slots without a box hold one that no ray enters.
pub(crate) fn write_boxes(rows: &mut [Row], padded: impl Fn(usize) -> Option<(Aabb, f64)>) {
    for i in 0..8 {
        let (min, max) = match padded(i) {
            Some((aabb, pad)) => (aabb.min.map(|x| lower(x, pad)), aabb.max.map(|x| -lower(-x, pad))),
            None => ([NOWHERE; 3], [-NOWHERE; 3]),
        };
        for (k, planes) in rows.chunks_exact_mut(2).enumerate() {
            planes[0][i] = min[k];
            planes[1][i] = max[k];
        }
    }
}

/// For each axis a row, a center and a half-extent, of a box with its pad; a slot without a box holds one that no ray enters.
pub(crate) fn write_slabs(rows: &mut [Row], i: usize, padded: Option<(Slabs, f64)>) {
    for k in 0..3 {
        let (row, (center, half)) = match &padded {
            Some((slabs, pad)) => (slabs.rows[k], center_and_half(slabs.lo[k], slabs.hi[k], *pad)),
            None => ([0.0; 3], (0.0, -NOWHERE)),
        };
        for axis in 0..3 {
            rows[5 * k + axis][i] = row[axis];
        }
        rows[5 * k + 3][i] = center;
        rows[5 * k + 4][i] = half;
    }
}

/// The center of an interval and a half-extent that exceeds both ends by `pad`.
fn center_and_half(lo: f32, hi: f32, pad: f64) -> (f32, f32) {
    // Projections of coordinates near the end of the range may exceed it; no box holds an infinity or NaN.
    let [lo, hi] = [lo, hi].map(|x| x.clamp(f32::MIN, f32::MAX));
    let center = (0.5 * (f64::from(lo) + f64::from(hi))) as f32;
    // Differences of f32 are exact in f64 except for a last bit, which the step upward covers; the proof of the pads covers the
    // rounding of the sum.
    let reach = (f64::from(hi) - f64::from(center)).max(f64::from(center) - f64::from(lo)).next_up() + pad;
    let half = reach as f32;
    (center, if f64::from(half) < reach { half.next_up() } else { half }.min(f32::MAX))
}
