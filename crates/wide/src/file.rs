//! A BVH as bytes, and back.
//!
//! ```text
//! offset   bytes        content
//! 0        8            "CANTWIDE"
//! 8        4            version, 5
//! 12       4, 4, 4      root word; depth; most primitives of a leaf
//! 24       8, 8, 8      cache lines of nodes; units of leaves; primitives
//! 48       36           rows of the mesh frame
//! 84       24           least and greatest coordinates
//! 108      16, 8, 8     traversal costs; predicted costs; those before the first refit, -1 where there was none
//! 140      4, 4         bytes of a unit: 160 of a half-block of triangles, 4 of an id; bytes of a primitive: 0 of triangles
//! 148      4            error of hits that boxes are padded for, relative to the coordinates
//! 152      12           reference point, which boxes are relative to
//! 164      12           unused, zero
//! 176      64 a line    nodes
//!                       units of leaves
//!                       primitives in input order
//!          8            checksum of all before
//! ```
//!
//! All of it is 32-bit words with the least byte first, on every machine.

mod check;
mod checksum;
mod error;
mod header;

use std::borrow::Cow;

use bytemuck::Pod;
use canted_obb::PrimId;

use crate::bvh::WideBvh;
use crate::layout::{Half, Nodes};
use crate::leaf::LeafPrimitive;
use crate::primitive::SavedPrimitive;
use crate::records::Records;
use crate::shape::Shapes;
use crate::simd::Proven;
use crate::traverse::LaneKernel;
use crate::triangle::{Blocks, Triangle};

use check::{Expected, check_shapes, check_triangles};
use checksum::checksum;
pub use error::LoadError;
use header::{CHECKSUM_BYTES, HEADER_BYTES, Header};

/// What [`WideBvh::to_bytes`] can write: triangles, and every [`SavedPrimitive`].
///
/// This trait cannot be implemented directly.
pub trait SavedLeaves: LeafPrimitive {
    /// Bytes of a unit of leaves, and of a primitive that is stored in addition; multiples of four.
    #[doc(hidden)]
    const SIZES: [usize; 2];

    /// Units of leaves and primitives as words.
    #[doc(hidden)]
    fn sections(leaves: &Self::Leaves) -> [Cow<'_, [u32]>; 2];

    /// Leaves from these sections, of any content.
    #[doc(hidden)]
    fn from_sections(units: &[u8], primitives: &[u8]) -> Self::Leaves;

    /// Whether all records are those that a build makes; pads boxes for the hits of this type.
    #[doc(hidden)]
    fn check(nodes: &mut Nodes, leaves: &Self::Leaves, expected: &Expected) -> Result<(), LoadError>;
}

impl<K: LaneKernel> SavedLeaves for Triangle<K> {
    const SIZES: [usize; 2] = [size_of::<Half>(), 0];

    fn sections(Blocks { halves, .. }: &Blocks) -> [Cow<'_, [u32]>; 2] {
        [Cow::Borrowed(bytemuck::cast_slice(halves)), Cow::Borrowed(&[])]
    }

    fn from_sections(units: &[u8], _: &[u8]) -> Blocks {
        Records::from(words_of::<Half>(units)).into()
    }

    fn check(nodes: &mut Nodes, blocks: &Blocks, expected: &Expected) -> Result<(), LoadError> {
        check_triangles(nodes, &blocks.halves, expected)
    }
}

impl<P: SavedPrimitive> SavedLeaves for P {
    const SIZES: [usize; 2] = {
        let (size, align) = (size_of::<P::Data>(), align_of::<P::Data>());
        assert!(size > 0 && size.is_multiple_of(4) && align >= 4, "primitives are written as 32-bit words");
        [size_of::<PrimId>(), size]
    };

    fn sections(leaves: &Shapes<P>) -> [Cow<'_, [u32]>; 2] {
        let data: Vec<P::Data> = leaves.primitives.iter().map(P::to_data).collect();
        let order = leaves.order.iter().map(|id| id.0).collect();
        [Cow::Owned(order), Cow::Owned(bytemuck::cast_slice(&data).to_vec())]
    }

    fn from_sections(units: &[u8], primitives: &[u8]) -> Shapes<P> {
        let order = words_of(units).into_iter().map(PrimId).collect();
        Shapes { order, primitives: words_of::<P::Data>(primitives).iter().map(P::from_data).collect() }
    }

    fn check(nodes: &mut Nodes, leaves: &Shapes<P>, expected: &Expected) -> Result<(), LoadError> {
        check_shapes(nodes, leaves, expected)
    }
}

impl<P: SavedLeaves> WideBvh<P> {
    /// The BVH with its primitives as bytes, for [`WideBvh::from_bytes`]: about as many as [`WideBvh::n_bytes`], the same on
    /// every machine.
    ///
    /// The triangle test and the SIMD path are not part of them: the reader chooses both. Boxes are padded for the error of the
    /// writer's test; where the reader's differs, boxes are padded again.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let sections = P::sections(&self.leaves);
        #[expect(clippy::cast_possible_truncation, reason = "sizes of small types")]
        let [n_unit_bytes, n_primitive_bytes] = P::SIZES.map(|n| n as u32);
        let header = Header {
            n_lines: self.nodes.lines.len() as u64,
            n_units: (size_of_val(&sections[0][..]) / P::SIZES[0]) as u64,
            n_primitives: self.n_primitives as u64,
            root: self.nodes.root,
            depth: self.nodes.depth,
            frame: self.frame.rows,
            reference: self.frame.reference.point(),
            bounds: self.bounds,
            predicted: self.predicted,
            baseline: self.baseline,
            n_unit_bytes,
            n_primitive_bytes,
            hit_error: P::ERROR,
        };
        let mut bytes = Vec::with_capacity(HEADER_BYTES + self.n_bytes() + CHECKSUM_BYTES);
        header.write(&mut bytes);
        for words in [bytemuck::cast_slice(&self.nodes.lines), &sections[0], &sections[1]] {
            bytes.extend(words.iter().flat_map(|word: &u32| word.to_le_bytes()));
        }
        let sum = checksum(&bytes);
        bytes.extend(sum.to_le_bytes());
        bytes
    }

    /// The BVH that [`WideBvh::to_bytes`] wrote, bit for bit if the triangle test is the same.
    ///
    /// `bytes` may be damaged or malicious, whatever their checksum: a BVH that is returned cannot panic, loop or overflow a
    /// stack, and finds every hit on its primitives. Needs memory in proportion to `bytes`.
    ///
    /// # Errors
    /// The first thing in `bytes` that is not part of a valid BVH over these primitives.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        let (header, mut nodes, [units, primitives]) = read(bytes, P::SIZES)?;
        let leaves = P::from_sections(units, primitives);
        let expected = Expected::of(&header, P::ERROR, P::IS_LOCAL)?;
        P::check(&mut nodes, &leaves, &expected)?;
        let Expected { n_primitives, bounds, frame, .. } = expected;
        let (predicted, baseline, path) = (header.predicted, header.baseline, Proven::detect());
        Ok(Self { nodes, leaves, frame, bounds, n_primitives, predicted, baseline, path })
    }
}

/// The header, the nodes, and the bytes of leaves and primitives.
fn read(bytes: &[u8], sizes: [usize; 2]) -> Result<(Header, Nodes, [&[u8]; 2]), LoadError> {
    let header = Header::read(bytes)?;
    if header.n_bytes() != bytes.len() as u64 {
        return Err(LoadError::Length { n_bytes: bytes.len(), n_expected: header.n_bytes() });
    }
    // The header was read, so there are more bytes than a checksum has.
    let (content, stored) = bytes.split_last_chunk::<CHECKSUM_BYTES>().unwrap_or((bytes, &[0; CHECKSUM_BYTES]));
    let (stored, computed) = (u64::from_le_bytes(*stored), checksum(content));
    if stored != computed {
        return Err(LoadError::Checksum { stored, computed });
    }
    let found = [header.n_unit_bytes, header.n_primitive_bytes];
    #[expect(clippy::cast_possible_truncation, reason = "sizes of small types")]
    let expected = sizes.map(|n| n as u32);
    if found != expected {
        return Err(LoadError::Primitives { found, expected });
    }
    // The file has the length by the header, so all sections fit into memory.
    #[expect(clippy::cast_possible_truncation, reason = "at most the number of bytes")]
    let [n_line_bytes, n_unit_bytes, _] = header.section_bytes().map(|n| n as usize);
    let (lines, rest) = content[HEADER_BYTES..].split_at(n_line_bytes);
    let (units, primitives) = rest.split_at(n_unit_bytes);
    let nodes = Nodes { lines: words_of(lines).into(), root: header.root, depth: header.depth };
    Ok((header, nodes, [units, primitives]))
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
