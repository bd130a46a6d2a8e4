//! Nodes as rows of eight lanes, and boxes as they hold them.

use canted_obb::Aabb;
use canted_obb::round::magnitude_up;
use canted_trace::Slabs;
use canted_trace::lanes::lower;

use super::{ALIGNED_LINES, CacheLine, ChildWord, NodeKind, ORIENTED_LINES};

/// The lower planes of an empty slot, beyond all supported coordinates; its upper planes are the negative.
pub(crate) const NOWHERE: f32 = 9.223_372e18;

/// Eight lanes of a record.
pub(crate) type Row = [f32; 8];

/// The rows of a node's lines.
#[inline(always)]
pub(crate) fn rows<const LINES: usize, const ROWS: usize>(lines: &[CacheLine], first: u32) -> &[Row; ROWS] {
    const { assert!(LINES * 2 == ROWS) };
    let first = first as usize;
    let lines: &[CacheLine; LINES] = lines[first..first + LINES].try_into().expect("the length is that of the range");
    bytemuck::cast_ref::<[CacheLine; LINES], [Row; ROWS]>(lines)
}

/// The child words of a node.
pub(crate) fn node_words(lines: &[CacheLine], kind: NodeKind, line: u32) -> &[ChildWord; 8] {
    match kind {
        NodeKind::Aligned => bytemuck::cast_ref(&rows::<ALIGNED_LINES, 8>(lines, line)[6]),
        NodeKind::Oriented => bytemuck::cast_ref(&rows::<ORIENTED_LINES, 16>(lines, line)[15]),
    }
}

/// Replaces the child word in a slot of a node.
pub(crate) fn set_word(lines: &mut [CacheLine], kind: NodeKind, line: usize, slot: usize, word: ChildWord) {
    let rows: &mut [Row] = bytemuck::cast_slice_mut(&mut lines[line..line + kind.n_lines()]);
    let row = match kind {
        NodeKind::Aligned => 6,
        NodeKind::Oriented => 15,
    };
    rows[row][slot] = f32::from_bits(word.0);
}

/// A box around everything in a subtree: all points `x` with `lo <= rows·(x - reference) <= hi`, where `reference` is
/// [`WideBvh::reference_point`](crate::WideBvh::reference_point).
///
/// Rows are unit vectors at right angles but for roundings; those of a file may be others. Planes include the padding that box tests of rays
/// need, which is at least 2^-22 of the greatest coordinate of the content, relative to the reference point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeBox {
    /// Rows.
    pub rows: [[f32; 3]; 3],
    /// Least coordinates along the rows.
    pub lo: [f64; 3],
    /// Greatest coordinates along the rows.
    pub hi: [f64; 3],
}

impl NodeBox {
    /// The box in a slot of a node; `frame` has the rows of aligned nodes.
    pub(crate) fn of_slot(lines: &[CacheLine], kind: NodeKind, line: u32, i: usize, frame: [[f32; 3]; 3]) -> Self {
        match kind {
            NodeKind::Aligned => {
                let rows = rows::<ALIGNED_LINES, 8>(lines, line);
                let plane = |row: usize| f64::from(rows[row][i]);
                Self { rows: frame, lo: [plane(0), plane(2), plane(4)], hi: [plane(1), plane(3), plane(5)] }
            }
            NodeKind::Oriented => {
                let rows = rows::<ORIENTED_LINES, 16>(lines, line);
                let end = |k: usize, side: f64| f64::from(rows[5 * k + 3][i]) + side * f64::from(rows[5 * k + 4][i]);
                let axes = std::array::from_fn(|k| std::array::from_fn(|axis| rows[5 * k + axis][i]));
                Self { rows: axes, lo: [0, 1, 2].map(|k| end(k, -1.0)), hi: [0, 1, 2].map(|k| end(k, 1.0)) }
            }
        }
    }
}

/// Rows lower x, upper x, lower y and so on, of boxes with their pads; slots without a box hold one that no ray enters.
pub(crate) fn write_boxes(rows: &mut [Row], padded: impl Fn(usize) -> Option<(Aabb, f64)>) {
    for i in 0..8 {
        write_box(rows, i, padded(i));
    }
}

/// The same of one slot.
pub(crate) fn write_box(rows: &mut [Row], i: usize, padded: Option<(Aabb, f64)>) {
    for (k, planes) in rows.chunks_exact_mut(2).enumerate() {
        (planes[0][i], planes[1][i]) = match &padded {
            Some((aabb, pad)) => (lower(aabb.min[k], *pad), -lower(-aabb.max[k], *pad)),
            None => (NOWHERE, -NOWHERE),
        };
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

/// Replaces the centers and half-extents along axis `k` of all slots, `lo` and `hi` the ends of their boxes, with their pads; slots where
/// `lo` is greater keep what they hold.
#[inline(always)]
pub(crate) fn write_intervals(rows: &mut [Row], k: usize, [lo, hi]: [&[f32; 8]; 2], pads: &[f64; 8]) {
    for i in 0..8 {
        let (center, half) = center_and_half(lo[i], hi[i], pads[i]);
        let is_used = lo[i] <= hi[i];
        rows[5 * k + 3][i] = if is_used { center } else { rows[5 * k + 3][i] };
        rows[5 * k + 4][i] = if is_used { half } else { rows[5 * k + 4][i] };
    }
}

/// The center of an interval and a half-extent that exceeds both ends by `pad`, without branches.
#[inline(always)]
fn center_and_half(lo: f32, hi: f32, pad: f64) -> (f32, f32) {
    let (least, greatest) = (|a, b| if a < b { a } else { b }, |a, b| if a > b { a } else { b });
    // Projections of coordinates near the end of the range may exceed it; no box holds an infinity or NaN.
    let (lo, hi) =
        (f64::from(least(greatest(lo, f32::MIN), f32::MAX)), f64::from(least(greatest(hi, f32::MIN), f32::MAX)));
    let center = (0.5 * (lo + hi)) as f32;
    let (above, below) = (hi - f64::from(center), f64::from(center) - lo);
    // Differences of f32 are exact in f64 except for a last bit, which the step upward covers (of a number that is not negative); the proof
    // of the pads covers the rounding of the sum.
    let reach = f64::from_bits((if above > below { above } else { below }).to_bits() + 1) + pad;
    (center, least(magnitude_up(reach), f32::MAX))
}
