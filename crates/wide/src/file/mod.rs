//! A BVH as bytes, and back; its records as words, for other devices.
//!
//! ```text
//! offset   bytes        content
//! 0        8            "CANTWIDE"
//! 8        4            version, 6
//! 12       4, 4, 4      root word; depth; most primitives of a leaf
//! 24       8, 8, 8      cache lines of nodes; units of leaves; primitives
//! 48       36           rows of the mesh frame
//! 84       24           least and greatest coordinates
//! 108      16, 8, 8     traversal costs; predicted costs; those before the first refit, -1 where there was none
//! 140      4, 4         bytes of a unit: 160 of a half-block of triangles, 4 of an id; bytes of a primitive: 0 of triangles
//! 148      4            error of hits that boxes are padded for, relative to the coordinates
//! 152      12           reference point, which boxes are relative to
//! 164      28           unused, zero
//! 192      64 a line    nodes
//!                       units of leaves
//!                       primitives in input order
//!          8            checksum of all before
//! ```
//!
//! All of it is 32-bit words with the least byte first, on every machine. Nodes and leaves are those of memory, so a file may be mapped.

mod check;
mod error;
mod header;
mod map;
mod raw;

use std::ops::Range;

use bytemuck::Pod;
use canted_obb::PrimId;
use canted_trace::{SaveBlas, TriangleTest};

use crate::bvh::{TriangleBvh, WideBvh};
use crate::leaf::{Blocks, LeafPrimitive, SavedPrimitive, Shapes};
use crate::node::{CacheLine, HalfBlock, Nodes, Records};
use crate::simd::AvailablePath;

use check::{Expected, check_shapes, check_triangles};
pub use error::{LoadError, MapError};
pub use header::checksum;
use header::{CHECKSUM_BYTES, HEADER_BYTES, Header};
pub use map::KnownFile;
pub use raw::RawBvh;

/// Changes with what the bytes mean.
const VERSION: u32 = 7;

impl TriangleBvh {
    /// The BVH with its triangles as bytes, for [`TriangleBvh::from_bytes`]: about as many as [`WideBvh::n_bytes`], the same on
    /// every machine.
    ///
    /// The SIMD path is not part of them: the reader chooses it.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        write(self, &self.nodes, SIZES, self.leaves.test.hit_error(), [bytemuck::cast_slice(&self.leaves.halves), &[]])
    }

    /// The BVH that [`TriangleBvh::to_bytes`] wrote, bit for bit.
    ///
    /// `bytes` may be damaged or malicious, whatever their checksum: a BVH that is returned cannot panic, loop or overflow a
    /// stack, and finds every hit on its primitives. Needs memory in proportion to `bytes`.
    ///
    /// The bytes hold the error of hits that boxes are padded for; it tells the watertight test from the other two, whose hits are the same.
    ///
    /// # Errors
    /// The first thing in `bytes` that is not part of a valid BVH over triangles.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        Self::read(bytes, test_of)
    }

    /// As [`TriangleBvh::from_bytes`], with a triangle test of the reader's choice. Where its error differs from that of the writer's test,
    /// boxes are padded again.
    ///
    /// # Errors
    /// As [`TriangleBvh::from_bytes`].
    pub fn from_bytes_with(bytes: &[u8], test: TriangleTest) -> Result<Self, LoadError> {
        Self::read(bytes, |_| test)
    }

    fn read(bytes: &[u8], test: impl FnOnce(&Header) -> TriangleTest) -> Result<Self, LoadError> {
        let (header, [lines, units, _]) = sections(bytes, SIZES)?;
        let (lines, units) = (words_of(&bytes[lines]).into(), words_of(&bytes[units]).into());
        Self::of_records(&header, lines, units, test(&header))
    }

    fn of_records(
        header: &Header,
        lines: Records<CacheLine>,
        units: Records<HalfBlock>,
        test: TriangleTest,
    ) -> Result<Self, LoadError> {
        let mut nodes = nodes_of(header, lines);
        let leaves = Blocks::new(units, test);
        let expected = Expected::of(header, test.hit_error(), true)?;
        check_triangles(&mut nodes, &leaves.halves, &expected)?;
        Ok(loaded(header, nodes, leaves, expected))
    }
}

/// The test whose hits have the error that boxes are padded for.
fn test_of(header: &Header) -> TriangleTest {
    TriangleTest::ALL.into_iter().find(|test| test.hit_error() == header.hit_error).unwrap_or_default()
}

/// Bytes of a half-block of triangles, and of what is stored for a triangle in addition.
const SIZES: [usize; 2] = [size_of::<HalfBlock>(), 0];

impl<P: SavedPrimitive> WideBvh<P> {
    /// Bytes of an id, and of a primitive.
    const SIZES: [usize; 2] = {
        let (size, align) = (size_of::<P::Data>(), align_of::<P::Data>());
        assert!(size > 0 && size.is_multiple_of(4) && align >= 4, "primitives are written as 32-bit words");
        [size_of::<PrimId>(), size]
    };

    /// The BVH with its primitives as bytes, for [`WideBvh::from_bytes`], as [`TriangleBvh::to_bytes`].
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let data: Vec<P::Data> = self.primitives().into_iter().map(P::to_data).collect();
        // Of a BVH that was changed in place, without what is not used.
        let packed = self.nodes.packed(&self.leaves.order);
        let (nodes, order) = packed.as_ref().map_or((&self.nodes, &self.leaves.order), |(nodes, order)| (nodes, order));
        let order: Vec<u32> = order.iter().map(|id| id.0).collect();
        write(self, nodes, Self::SIZES, P::ERROR, [&order, bytemuck::cast_slice(&data)])
    }

    /// The BVH that [`WideBvh::to_bytes`] wrote, bit for bit if [`Primitive::ERROR`](crate::Primitive::ERROR) is the same; bytes need not be
    /// trusted, as for [`TriangleBvh::from_bytes`].
    ///
    /// # Errors
    /// The first thing in `bytes` that is not part of a valid BVH over these primitives.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        let (header, [lines, units, primitives]) = sections(bytes, Self::SIZES)?;
        let mut nodes = nodes_of(&header, words_of(&bytes[lines]).into());
        let order = words_of(&bytes[units]).into_iter().map(PrimId).collect();
        let primitives = words_of::<P::Data>(&bytes[primitives]).iter().map(P::from_data).collect();
        let mut leaves = Shapes::new(order, primitives);
        let expected = Expected::of(&header, P::ERROR, P::IS_LOCAL)?;
        check_shapes(&mut nodes, &leaves, &expected)?;
        leaves.sort();
        Ok(loaded(&header, nodes, leaves, expected))
    }
}

/// A BVH with these nodes, units of leaves and primitives as bytes.
fn write<P: LeafPrimitive>(
    bvh: &WideBvh<P>,
    nodes: &Nodes,
    sizes: [usize; 2],
    hit_error: f32,
    sections: [&[u32]; 2],
) -> Vec<u8> {
    let [n_unit_bytes, n_primitive_bytes] = sizes.map(|n| n as u32);
    let header = Header {
        n_lines: nodes.lines.len() as u64,
        n_units: (size_of_val(sections[0]) / sizes[0]) as u64,
        n_primitives: bvh.n_primitives as u64,
        root: nodes.root,
        depth: nodes.depth,
        frame: bvh.frame.rows,
        reference: bvh.frame.reference.point(),
        bounds: bvh.bounds,
        predicted: bvh.predicted,
        baseline: bvh.baseline,
        n_unit_bytes,
        n_primitive_bytes,
        hit_error,
    };
    let mut bytes = Vec::with_capacity(HEADER_BYTES + bvh.n_bytes() + CHECKSUM_BYTES);
    header.write(&mut bytes);
    for words in [bytemuck::cast_slice(&nodes.lines), sections[0], sections[1]] {
        bytes.extend(words.iter().flat_map(|word: &u32| word.to_le_bytes()));
    }
    let sum = checksum(&bytes);
    bytes.extend(sum.to_le_bytes());
    bytes
}

impl SaveBlas for TriangleBvh {
    type Error = LoadError;

    fn to_bytes(&self) -> Vec<u8> {
        Self::to_bytes(self)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        Self::from_bytes(bytes)
    }
}

impl<P: SavedPrimitive> SaveBlas for WideBvh<P> {
    type Error = LoadError;

    fn to_bytes(&self) -> Vec<u8> {
        Self::to_bytes(self)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        Self::from_bytes(bytes)
    }
}

/// A BVH of records that were checked.
fn loaded<P: LeafPrimitive>(header: &Header, nodes: Nodes, leaves: P::Leaves, expected: Expected) -> WideBvh<P> {
    let Expected { n_primitives, bounds, frame, .. } = expected;
    let (predicted, baseline, path) = (header.predicted, header.baseline, AvailablePath::detect());
    WideBvh { nodes, leaves, frame, bounds, n_primitives, predicted, baseline, path }
}

/// The header, and where nodes, leaves and primitives are.
fn sections(bytes: &[u8], sizes: [usize; 2]) -> Result<(Header, [Range<usize>; 3]), LoadError> {
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
    let expected = sizes.map(|n| n as u32);
    if found != expected {
        return Err(LoadError::Primitives { found, expected });
    }
    // The file has the length by the header, so all sections fit into memory.
    let [n_line_bytes, n_unit_bytes, _] = header.section_bytes().map(|n| n as usize);
    let (units, primitives) = (HEADER_BYTES + n_line_bytes, HEADER_BYTES + n_line_bytes + n_unit_bytes);
    Ok((header, [HEADER_BYTES..units, units..primitives, primitives..content.len()]))
}

/// Nodes of these lines; what the hierarchy of the checked records gives is added then.
fn nodes_of(header: &Header, lines: Records<CacheLine>) -> Nodes {
    let (has_oriented, pieces) = (false, vec![]);
    Nodes { lines, root: header.root, depth: header.depth, has_oriented, pieces, links: None }
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
