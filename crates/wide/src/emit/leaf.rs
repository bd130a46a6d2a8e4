//! How primitives are written into leaves.

use canted_lbvh::Corners;
use canted_obb::PrimId;

use crate::layout::{HALF_WORDS, Half, MAX_LEAF, PART_LANES};

/// Positions of a leaf's primitives, each primitive once, and their number: references may share one.
pub(super) fn distinct(primitives: &[PrimId], start: u32, end: u32) -> ([u32; MAX_LEAF], usize) {
    let mut positions = [0; MAX_LEAF];
    let mut n = 0;
    for position in start..end {
        let primitive = primitives[position as usize];
        if !positions[..n].iter().any(|&p| primitives[p as usize] == primitive) {
            positions[n] = position;
            n += 1;
        }
    }
    (positions, n)
}

/// A triangle's lane in its leaf: its first word, and the distance to the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Lane {
    first: usize,
    step: usize,
}

impl Lane {
    /// Rows of vertices; then follows that of ids.
    pub(crate) const ID_ROW: usize = 9;

    /// Of triangle `i` in a leaf of `n` that starts in this part of a half-block: blocks of eight precede a last block of four.
    pub(crate) fn of(i: usize, n: usize, part: usize) -> Self {
        if i / 8 * 8 + 4 >= n {
            Self { first: i / 4 * HALF_WORDS + part * PART_LANES + i % 4, step: 4 }
        } else {
            Self { first: i / 8 * 2 * HALF_WORDS + i % 8, step: 8 }
        }
    }

    /// The word of a row: nine coordinates, then the id.
    pub(crate) fn word(self, row: usize) -> usize {
        self.first + row * self.step
    }
}

/// Writes triangles in leaf order, and their ids, from a part of `out` on.
pub(crate) fn write_triangles<'a>(
    triangles: impl ExactSizeIterator<Item = (&'a Corners, PrimId)>,
    part: usize,
    out: &mut [Half],
) {
    let n = triangles.len();
    let words: &mut [u32] = bytemuck::cast_slice_mut(out);
    for (i, (corners, id)) in triangles.enumerate() {
        let lane = Lane::of(i, n, part);
        for (row, x) in corners.as_flattened().iter().enumerate() {
            words[lane.word(row)] = x.to_bits();
        }
        words[lane.word(Lane::ID_ROW)] = id.0;
    }
}

/// Writes ids in leaf order.
pub(crate) fn write_ids(ids: impl Iterator<Item = PrimId>, out: &mut [PrimId]) {
    out.iter_mut().zip(ids).for_each(|(out, id)| *out = id);
}
