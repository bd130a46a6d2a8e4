use std::fmt;
use std::ops::{Add, Range};

use super::{Block, Dyadic, Guide, Pixel};

/// The sums of a range of samples, block by block, so that joined parts have the bits of an undivided render.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    range: Range<u32>,
    /// The blocks of the range.
    blocks: Vec<Block>,
    /// For each pixel, row by row, the sums of each block.
    pixels: Vec<Pixel>,
    /// The same for guides; empty without AOVs.
    guides: Vec<Guide>,
}

impl Part {
    /// A part from the sums of all blocks of each pixel; `guides` may be empty.
    pub(crate) fn new(range: Range<u32>, pixels: Vec<Pixel>, guides: Vec<Guide>) -> Self {
        let blocks = Block::of(range.clone());
        Self { range, blocks, pixels, guides }
    }

    /// The sample numbers.
    #[must_use]
    pub fn range(&self) -> Range<u32> {
        self.range.clone()
    }

    /// The blocks of the range, in order.
    #[must_use]
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// The sums of each pixel's blocks, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = &[Pixel]> {
        self.pixels.chunks(self.blocks.len().max(1))
    }

    /// The guides of each pixel's blocks, row by row; nothing without AOVs.
    pub fn guides(&self) -> impl Iterator<Item = &[Guide]> {
        self.guides.chunks(self.blocks.len().max(1))
    }

    /// Joins parts of one picture, given in any order.
    ///
    /// # Errors
    /// [`JoinError`] if samples overlap or are missing between parts, or there is no part.
    ///
    /// # Panics
    /// If the parts have different numbers of pixels.
    pub fn join(mut parts: Vec<Self>) -> Result<Self, JoinError> {
        parts.sort_by_key(|part| (part.range.start, part.range.end));
        let (Some(first), Some(last)) = (parts.first(), parts.last()) else { return Err(JoinError::Empty) };
        for pair in parts.windows(2) {
            let [before, after] = [pair[0].range(), pair[1].range()];
            if after.start < before.end {
                return Err(JoinError::Overlap { before, after });
            }
            if after.start > before.end {
                return Err(JoinError::Gap { before, after });
            }
        }
        let range = first.range.start..last.range.end;
        assert!(parts.iter().all(|part| part.n_pixels() == first.n_pixels()), "parts of one picture");
        let pixels = joined(&parts, |part| &part.pixels);
        let guides = joined(&parts, |part| &part.guides);
        Ok(Self::new(range, pixels, guides))
    }

    fn n_pixels(&self) -> usize {
        self.pixels.len() / self.blocks.len().max(1)
    }
}

/// The sums of all blocks of the joined range, pixel by pixel.
fn joined<T: Copy + Default + Add<Output = T>>(parts: &[Part], sums: impl Fn(&Part) -> &Vec<T>) -> Vec<T> {
    let mut joined = Vec::new();
    let mut dyadic = Dyadic::default();
    let n_pixels = parts.iter().map(|part| sums(part).len() / part.blocks.len().max(1)).min().unwrap_or(0);
    for pixel in 0..n_pixels {
        dyadic.clear();
        for part in parts {
            let n = part.blocks.len();
            for (&block, &sum) in part.blocks.iter().zip(&sums(part)[pixel * n..(pixel + 1) * n]) {
                dyadic.push(block, sum);
            }
        }
        joined.extend(dyadic.values());
    }
    joined
}

/// Why parts cannot be joined.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JoinError {
    /// There is no part.
    Empty,
    /// Two parts share samples.
    Overlap {
        /// The range that starts first.
        before: Range<u32>,
        /// The other.
        after: Range<u32>,
    },
    /// Samples between two parts are missing.
    Gap {
        /// The range before.
        before: Range<u32>,
        /// The range after.
        after: Range<u32>,
    },
}

impl fmt::Display for JoinError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(f, "no samples to join"),
            Self::Overlap { before, after } => write!(f, "samples {before:?} and {after:?} overlap"),
            Self::Gap { before, after } => {
                write!(f, "samples {:?} between {before:?} and {after:?} are missing", before.end..after.start)
            }
        }
    }
}

impl std::error::Error for JoinError {}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two pixels with sums of powers of three, which depend on the order.
    fn part(range: Range<u32>) -> Part {
        let mut pixels = Vec::new();
        for pixel in 0..2 {
            let mut sums = Dyadic::default();
            for sample in range.clone() {
                sums.push_sample(
                    sample,
                    Pixel::of([0.1, 0.7, 3.0_f32.powi(i32::try_from(sample).unwrap_or(0) + pixel)]),
                );
            }
            pixels.extend(sums.values());
        }
        Part::new(range, pixels, Vec::new())
    }

    #[test]
    fn parts_join_in_any_order() {
        let whole = part(0..20);
        assert_eq!(Part::join(vec![part(0..20)]).unwrap(), whole);
        assert_eq!(Part::join(vec![part(5..20), part(0..5)]).unwrap(), whole);
        assert_eq!(Part::join(vec![part(13..20), part(0..5), part(5..13)]).unwrap(), whole);
        let end = Part::join(vec![part(13..20), part(5..13)]).unwrap();
        assert_eq!(end, part(5..20));
        assert_eq!(Part::join(vec![end, part(0..5)]).unwrap(), whole);
    }

    #[test]
    fn gaps_and_overlaps_are_rejected() {
        assert_eq!(Part::join(Vec::new()), Err(JoinError::Empty));
        let error = Part::join(vec![part(4..9), part(0..5)]).unwrap_err();
        assert_eq!(error.to_string(), "samples 0..5 and 4..9 overlap");
        let error = Part::join(vec![part(0..5), part(0..5)]).unwrap_err();
        assert_eq!(error.to_string(), "samples 0..5 and 0..5 overlap");
        let error = Part::join(vec![part(7..9), part(0..5)]).unwrap_err();
        assert_eq!(error.to_string(), "samples 5..7 between 0..5 and 7..9 are missing");
    }
}
