//! A built tree as bytes, and back.
//!
//! ```text
//! at    bytes        what
//! 0     8            "CANTWIDE"
//! 8     4            version, 3
//! 12    4, 4, 4      root word; depth; most triangles of a leaf
//! 24    8, 8, 8      cache lines of nodes; half-blocks of triangles; triangles
//! 48    36           rows of the mesh's frame
//! 84    24           least and greatest coordinates of vertices
//! 108   16, 8, 8     costs of visits; predicted costs; those before the first refit, -1 where there was none
//! 140   20           nothing yet, zero
//! 160   64 a line    nodes
//!       160 a half   triangles
//!       8            checksum of all before
//! ```
//!
//! Numbers have their least byte first on every machine.

mod check;
mod checksum;
mod error;
mod header;

use std::marker::PhantomData;

use bytemuck::Pod;

use crate::emit::Records;
use crate::layout::Half;
use crate::traverse::{LaneKernel, MeshFrame};
use crate::{SimdPath, WideBvh};

use check::{Promise, check};
use checksum::checksum;
pub use error::LoadError;
use header::{CHECKSUM_BYTES, HEADER_BYTES, Header};

impl<K: LaneKernel> WideBvh<K> {
    /// The tree as bytes, for [`WideBvh::from_bytes`]: about as many as [`WideBvh::n_bytes`], the same on every machine.
    ///
    /// Its vertices go with it, the kernel and the SIMD path do not: both are the reader's choice.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let Records { lines, halves, root, depth } = &self.records;
        let header = Header {
            n_lines: lines.len() as u64,
            n_halves: halves.len() as u64,
            n_triangles: self.n_triangles as u64,
            root: *root,
            depth: *depth,
            frame: self.frame.rows,
            bounds: self.bounds,
            predicted: self.predicted,
            wear: self.wear,
        };
        let mut bytes = Vec::with_capacity(HEADER_BYTES + self.n_bytes() + CHECKSUM_BYTES);
        header.write(&mut bytes);
        for words in [bytemuck::cast_slice::<_, u32>(lines), bytemuck::cast_slice(halves)] {
            bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        }
        let sum = checksum(&bytes);
        bytes.extend(sum.to_le_bytes());
        bytes
    }

    /// The tree that [`WideBvh::to_bytes`] made bytes of, bit for bit.
    ///
    /// Nothing in `bytes` is taken on trust, whoever wrote it and whatever its checksum: the tree that comes back
    /// cannot panic, loop or overflow a stack, and finds every hit on the triangles in it. Takes no more memory than
    /// in proportion to `bytes`.
    ///
    /// # Errors
    /// The first thing in `bytes` that no tree of ours holds.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        let header = Header::read(bytes)?;
        if header.n_bytes() != bytes.len() as u64 {
            return Err(LoadError::Length { n_bytes: bytes.len(), n_told: header.n_bytes() });
        }
        let (content, sum) = bytes.split_at(bytes.len() - CHECKSUM_BYTES);
        let computed = checksum(content);
        if computed.to_le_bytes() != sum {
            return Err(LoadError::Checksum { computed });
        }
        // The file is as long as told, so all of this fits.
        let n_line_bytes = content.len() - HEADER_BYTES - bytes_of::<Half>(header.n_halves);
        let (lines, halves) = content[HEADER_BYTES..].split_at(n_line_bytes);
        let records =
            Records { lines: words_of(lines), halves: words_of(halves), root: header.root, depth: header.depth };
        let Ok(n_triangles) = usize::try_from(header.n_triangles) else {
            return Err(LoadError::Count { n_told: header.n_triangles, n_places: 0 });
        };
        let (bounds, frame) = (header.bounds, header.frame);
        check(&records, &Promise { n_triangles, depth: header.depth, bounds, frame })?;
        Ok(Self {
            records,
            frame: MeshFrame::new(frame),
            bounds,
            n_triangles,
            predicted: header.predicted,
            wear: header.wear,
            path: SimdPath::detect(),
            kernel: PhantomData,
        })
    }
}

/// Bytes of `n` records that are known to lie in memory.
fn bytes_of<T>(n: u64) -> usize {
    usize::try_from(n).unwrap_or(usize::MAX).saturating_mul(size_of::<T>())
}

/// Records made of 32-bit words, least byte first.
fn words_of<T: Pod>(bytes: &[u8]) -> Vec<T> {
    let mut records = vec![T::zeroed(); bytes.len() / size_of::<T>()];
    let words: &mut [u32] = bytemuck::cast_slice_mut(&mut records);
    for (word, bytes) in words.iter_mut().zip(bytes.as_chunks::<4>().0) {
        *word = u32::from_le_bytes(*bytes);
    }
    records
}

#[cfg(test)]
mod tests;
