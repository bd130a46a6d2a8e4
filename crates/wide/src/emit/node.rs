//! Nodes as rays read them.

use canted_lbvh::{Child, ChildKind};
use canted_obb::Aabb;
use canted_trace::Slabs;

use super::{Draft, Source, range};
use crate::layout::{Line, NOWHERE, NodeKind, Row, Word};

/// Writes a node's boxes and child words.
pub(super) fn write_node(source: &Source, draft: &Draft, out: &mut [Line]) {
    let rows: &mut [Row] = bytemuck::cast_slice_mut(out);
    let word_row = match draft.kind {
        NodeKind::Aligned => {
            write_boxes(&mut rows[..6], |i| {
                let aabb = aligned_box(source, draft.children.get(i)?.0);
                Some((aabb.min, aabb.max))
            });
            6
        }
        NodeKind::Oriented => {
            let slabs = |&(child, _): &(Child, Word)| slabs_of(source, child, (source.frames)(child));
            for i in 0..8 {
                write_slabs(rows, i, draft.children.get(i).map(slabs).as_ref());
            }
            15
        }
    };
    for (i, slot) in rows[word_row].iter_mut().enumerate() {
        let word = draft.children.get(i).map_or(Word::EMPTY, |&(_, word)| word);
        *slot = f32::from_bits(word.0);
    }
}

fn aligned_box(source: &Source, child: Child) -> Aabb {
    match child.kind() {
        ChildKind::Leaf(place) => source.leaf_boxes[place as usize],
        ChildKind::Inner(id) => source.inner_boxes[id.index()],
    }
}

/// Rows lo x, hi x, lo y, hi y, lo z, hi z; slots without a box hold one that no ray enters.
pub(crate) fn write_boxes(rows: &mut [Row], bounds: impl Fn(usize) -> Option<([f32; 3], [f32; 3])>) {
    for i in 0..8 {
        let (lo, hi) = bounds(i).unwrap_or(([NOWHERE; 3], [-NOWHERE; 3]));
        for (k, planes) in rows.chunks_exact_mut(2).enumerate() {
            planes[0][i] = lo[k];
            planes[1][i] = hi[k];
        }
    }
}

/// A box with these rows around all vertices below a child.
fn slabs_of(source: &Source, child: Child, rows: [[f32; 3]; 3]) -> Slabs {
    let (start, end) = range(source.tree, child);
    Slabs::from_points(rows, source.corners[start as usize..end as usize].iter().flatten().copied())
}

/// For each axis a row, a centre and a half-extent; a slot without a box holds one that no ray enters.
pub(crate) fn write_slabs(rows: &mut [Row], i: usize, slabs: Option<&Slabs>) {
    for k in 0..3 {
        let (row, (center, half)) = match slabs {
            Some(slabs) => (slabs.rows[k], middle(slabs.lo[k], slabs.hi[k])),
            None => ([0.0; 3], (0.0, -NOWHERE)),
        };
        for axis in 0..3 {
            rows[5 * k + axis][i] = row[axis];
        }
        rows[5 * k + 3][i] = center;
        rows[5 * k + 4][i] = half;
    }
}

/// An interval by its middle and a half-extent that reaches both ends.
#[expect(clippy::cast_possible_truncation, reason = "the half-extent is taken from the rounded middle, and upward")]
fn middle(lo: f32, hi: f32) -> (f32, f32) {
    let center = (0.5 * (f64::from(lo) + f64::from(hi))) as f32;
    // Differences of f32 are exact in f64 but for a last bit, which the step upward covers.
    let reach = (f64::from(hi) - f64::from(center)).max(f64::from(center) - f64::from(lo)).next_up();
    let half = reach as f32;
    (center, if f64::from(half) < reach { half.next_up() } else { half })
}
