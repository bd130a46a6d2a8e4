//! The codec of vertex attributes, versions 0 and 1.
//!
//! Elements are in blocks. A block has, for each byte of an element, a plane: that byte of all elements of the block, as a
//! difference from the element before. Planes are coded in groups of 16.

use super::{Flaw, Stream};

/// First byte of a stream, without the version.
const HEADER: u8 = 0xa0;
/// Most bytes of a block.
const MAX_BLOCK_BYTES: usize = 8192;
/// Most elements of a block.
const MAX_BLOCK: usize = 256;
/// Bytes of a plane that are coded together.
const GROUP: usize = 16;

/// Bits per byte of a group, by its code: of version 0, and of version 1 by the mode of the plane.
const BITS: [[usize; 4]; 3] = [[0, 2, 4, 8], [0, 1, 2, 4], [1, 2, 4, 8]];

/// Modes of a plane of version 1; 0 and 1 are groups with [`BITS`].
const ZEROS: u8 = 2;
const STORED: u8 = 3;

/// Decodes `count` elements of `stride` bytes, a multiple of 4 up to 256.
pub(super) fn decode(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Flaw> {
    let n_words = stride / 4;
    // The tail is filled up to the bytes that the reference decoder may read ahead.
    let (mut stream, version, tail) = Stream::open(bytes, HEADER, |version| match version {
        0 => stride.max(32),
        _ => (stride + n_words).max(24),
    })?;
    let (n_controls, kinds) = if version == 0 { (0, &[][..]) } else { (n_words, &tail[tail.len() - n_words..]) };
    // The element before the first.
    let mut last = tail[tail.len() - n_controls - stride..][..stride].to_vec();
    let mut elements = vec![0; count * stride];
    let block = (MAX_BLOCK_BYTES / stride / GROUP * GROUP).min(MAX_BLOCK);
    for block in elements.chunks_mut(block * stride) {
        let n = block.len() / stride;
        let controls = stream.take(n_controls)?;
        for k in 0..n_words {
            let modes = controls.get(k).copied().unwrap_or(0);
            let mut planes = [[0; MAX_BLOCK]; 4];
            for (j, plane) in planes.iter_mut().enumerate() {
                match modes >> (2 * j) & 3 {
                    STORED => plane[..n].copy_from_slice(stream.take(n)?),
                    ZEROS => {}
                    mode => {
                        let bits = if version == 0 { BITS[0] } else { BITS[1 + usize::from(mode)] };
                        groups(&mut stream, &mut plane[..n.next_multiple_of(GROUP)], bits)?;
                    }
                }
            }
            let words = block.chunks_exact_mut(stride).map(|element| &mut element.as_chunks_mut::<4>().0[k]);
            let last = &mut last.as_chunks_mut::<4>().0[k];
            undo(words, &planes, last, kinds.get(k).copied().unwrap_or(0))?;
        }
    }
    stream.close()?;
    Ok(elements)
}

/// Decodes a plane. `bits` are those per byte of a group, by its code.
fn groups(stream: &mut Stream<'_>, plane: &mut [u8], bits: [usize; 4]) -> Result<(), Flaw> {
    let codes = stream.take((plane.len() / GROUP).div_ceil(4))?;
    for (k, group) in plane.chunks_exact_mut(GROUP).enumerate() {
        match bits[usize::from(codes[k / 4] >> (k % 4 * 2) & 3)] {
            0 => {}
            8 => group.copy_from_slice(stream.take(GROUP)?),
            bits => {
                let packed = stream.take(GROUP * bits / 8)?;
                // Stands for a byte of its own, after the packed bits.
                let escape = (1 << bits) - 1;
                for (k, byte) in group.iter_mut().enumerate() {
                    let (at, place) = (k * bits / 8, k * bits % 8);
                    // Single bits begin at the lowest, pairs and quadruples at the highest.
                    let shift = if bits == 1 { place } else { 8 - bits - place };
                    let short = packed[at] >> shift & escape;
                    *byte = if short == escape { stream.byte()? } else { short };
                }
            }
        }
    }
    Ok(())
}

/// Adds the differences in `planes` up into a word of each element. `kind` is how they were taken.
fn undo<'a>(
    words: impl Iterator<Item = &'a mut [u8; 4]>,
    planes: &[[u8; MAX_BLOCK]; 4],
    last: &mut [u8; 4],
    kind: u8,
) -> Result<(), Flaw> {
    match kind & 3 {
        // Of bytes.
        0 => add(words, planes, last, |last, difference| {
            std::array::from_fn(|k| last[k].wrapping_add(signed(difference[k].into()) as u8))
        }),
        // Of two bytes together.
        1 => add(words, planes, last, |[a, b, c, d], [e, f, g, h]| {
            let sum = |last, difference| {
                u16::from_le_bytes(last).wrapping_add(signed(u16::from_le_bytes(difference)) as u16).to_le_bytes()
            };
            let ([a, b], [c, d]) = (sum([a, b], [e, f]), sum([c, d], [g, h]));
            [a, b, c, d]
        }),
        // Of bits, rotated by the high half of the kind.
        2 => add(words, planes, last, |last, difference| {
            let difference = u32::from_le_bytes(difference).rotate_right(u32::from(kind >> 4));
            (u32::from_le_bytes(last) ^ difference).to_le_bytes()
        }),
        _ => return Err("unknown kind of differences"),
    }
    Ok(())
}

/// Sets each word to the sum of the word before and its difference.
fn add<'a>(
    words: impl Iterator<Item = &'a mut [u8; 4]>,
    planes: &[[u8; MAX_BLOCK]; 4],
    last: &mut [u8; 4],
    sum: impl Fn([u8; 4], [u8; 4]) -> [u8; 4],
) {
    for (k, word) in words.enumerate() {
        *last = sum(*last, std::array::from_fn(|j| planes[j][k]));
        *word = *last;
    }
}

/// A number whose lowest bit is the sign, as a two's complement.
fn signed(zigzag: u16) -> i32 {
    let zigzag = i32::from(zigzag);
    zigzag >> 1 ^ -(zigzag & 1)
}
