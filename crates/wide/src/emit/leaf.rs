//! What leaves hold, and how it is written.

use canted_obb::PrimId;

use super::Source;
use crate::layout::{HALF_WORDS, Half, MAX_LEAF, PART_LANES, PARTS};

/// What leaves hold.
pub(crate) trait LeafForm {
    /// What a leaf takes some of.
    type Place: Copy + Send;
    const UNSET: Self::Place;
    /// Parts of one that words can name.
    const PARTS: usize;
    /// Most primitives of a leaf that takes one part only.
    const IN_PART: usize;

    /// How many of them `n` primitives take.
    fn n_places(n: usize) -> usize;

    /// Writes the primitives of these places in leaf order, from a part of `out` on.
    fn write(source: &Source, places: &[u32], part: usize, out: &mut [Self::Place]);
}

/// Leaves hold half-blocks of triangles.
pub(super) enum Triangles {}

impl LeafForm for Triangles {
    type Place = Half;
    const UNSET: Half = Half([0; HALF_WORDS]);
    const PARTS: usize = PARTS;
    const IN_PART: usize = PART_LANES;

    fn n_places(n: usize) -> usize {
        n_halves(n)
    }

    fn write(source: &Source, places: &[u32], part: usize, out: &mut [Half]) {
        write_triangles(source, places, part, out);
    }
}

/// Leaves hold numbers of primitives.
pub(crate) enum Numbers {}

impl LeafForm for Numbers {
    type Place = PrimId;
    const UNSET: PrimId = PrimId(0);
    const PARTS: usize = 1;
    const IN_PART: usize = 0;

    fn n_places(n: usize) -> usize {
        n
    }

    fn write(source: &Source, places: &[u32], _: usize, out: &mut [PrimId]) {
        for (out, &place) in out.iter_mut().zip(places) {
            *out = source.primitives[place as usize];
        }
    }
}

/// Half-blocks that hold `n` triangles.
pub(crate) fn n_halves(n: usize) -> usize {
    n.div_ceil(4)
}

/// Places of a leaf's primitives, each primitive once, and their number: references may share one.
pub(super) fn distinct(source: &Source, start: u32, end: u32) -> ([u32; MAX_LEAF], usize) {
    let mut places = [0; MAX_LEAF];
    let mut n = 0;
    for place in start..end {
        let primitive = source.primitives[place as usize];
        if !places[..n].iter().any(|&p| source.primitives[p as usize] == primitive) {
            places[n] = place;
            n += 1;
        }
    }
    (places, n)
}

fn write_triangles(source: &Source, places: &[u32], part: usize, out: &mut [Half]) {
    let n = places.len();
    let words: &mut [u32] = bytemuck::cast_slice_mut(out);
    for (i, &place) in places.iter().enumerate() {
        // Blocks of eight lie before a last block of four.
        let in_four = i / 8 * 8 + 4 >= n;
        let (block, width) = if in_four { (i / 4 * 40, 4) } else { (i / 8 * 80, 8) };
        let lane = part * PART_LANES + i % width;
        let vertices = source.corners[place as usize].as_flattened();
        for (row, &x) in vertices.iter().enumerate() {
            words[block + row * width + lane] = x.to_bits();
        }
        words[block + 9 * width + lane] = source.primitives[place as usize].0;
    }
}
