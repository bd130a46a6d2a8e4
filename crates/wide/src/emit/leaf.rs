//! How primitives are written into leaves.

use canted_lbvh::Corners;
use canted_obb::PrimId;

use super::Source;
use crate::layout::{Half, Lane, MAX_LEAF};

/// Positions of a leaf's primitives, each primitive once, and their number: references may share one.
pub(super) fn distinct(source: &Source, start: u32, end: u32) -> ([u32; MAX_LEAF], usize) {
    let primitives = source.primitives;
    let mut positions = [0; MAX_LEAF];
    let mut n = 0;
    for position in start..end {
        let primitive = primitives[position as usize];
        if !source.is_shared || !positions[..n].iter().any(|&p| primitives[p as usize] == primitive) {
            positions[n] = position;
            n += 1;
        }
    }
    (positions, n)
}

/// Their number.
pub(super) fn n_distinct(source: &Source, start: u32, end: u32) -> usize {
    if source.is_shared { distinct(source, start, end).1 } else { (end - start) as usize }
}

/// Writes triangles in leaf order, and their ids, from a part of `out` on.
pub(crate) fn write_triangles(
    triangles: impl ExactSizeIterator<Item = (Corners, PrimId)>,
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
