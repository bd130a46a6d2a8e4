//! A BVH as bytes, and back.
//!
//! ```text
//! offset   bytes        content
//! 0        8            "CANTWIDE"
//! 8        4            version, 3
//! 12       4, 4, 4      root word; depth; most primitives of a leaf
//! 24       8, 8, 8      cache lines of nodes; units of leaves; primitives
//! 48       36           rows of the mesh frame
//! 84       24           least and greatest coordinates
//! 108      16, 8, 8     traversal costs; predicted costs; those before the first refit, -1 where there was none
//! 140      4, 4         bytes of a unit: 160 of a half-block of triangles, 4 of an id; bytes of a primitive: 0 of triangles
//! 148      12           unused, zero
//! 160      64 a line    nodes
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

use bytemuck::Pod;
use canted_obb::PrimId;

use crate::bvh::WideBvh;
use crate::layout::{Half, Nodes};
use crate::leaf::LeafPrimitive;
use crate::primitive::SavedPrimitive;
use crate::shape::Shapes;
use crate::simd::SimdPath;
use crate::traverse::{LaneKernel, MeshFrame};
use crate::triangle::Triangle;

use check::{Expected, check_shapes, check_triangles};
use checksum::checksum;
pub use error::LoadError;
use header::{CHECKSUM_BYTES, HEADER_BYTES, Header};

impl<K: LaneKernel> WideBvh<Triangle<K>> {
    /// The BVH as bytes, for [`WideBvh::from_bytes`]: about as many as [`WideBvh::n_bytes`], the same on every machine.
    ///
    /// The triangles are included. The triangle test and the SIMD path are not: the reader chooses them.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        self.write(Sizes::of::<Half, ()>(), bytemuck::cast_slice(&self.leaves), &[])
    }

    /// The BVH that [`WideBvh::to_bytes`] wrote, bit for bit.
    ///
    /// `bytes` may be damaged or malicious, whatever their checksum: a BVH that is returned cannot panic, loop or overflow a
    /// stack, and finds every hit on its triangles. Needs memory in proportion to `bytes`.
    ///
    /// # Errors
    /// The first thing in `bytes` that is not part of a valid BVH.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        let (header, nodes, units, _) = read(bytes, Sizes::of::<Half, ()>())?;
        let leaves = words_of::<Half>(units);
        check_triangles(&nodes, &leaves, &Expected::of(&header)?)?;
        Ok(Self::from_header(&header, nodes, leaves))
    }
}

impl<P: SavedPrimitive> WideBvh<P> {
    /// The BVH as bytes, with its primitives.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        const { assert!(is_words::<P::Data>(), "primitives are written as 32-bit words") };
        let data: Vec<P::Data> = self.leaves.primitives.iter().map(P::to_data).collect();
        let order: Vec<u32> = self.leaves.order.iter().map(|id| id.0).collect();
        self.write(Sizes::of::<PrimId, P::Data>(), &order, bytemuck::cast_slice(&data))
    }

    /// The BVH that [`WideBvh::to_bytes`] wrote; for damaged or malicious bytes see there.
    ///
    /// # Errors
    /// The first thing in `bytes` that is not part of a valid BVH over primitives of this type.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        const { assert!(is_words::<P::Data>(), "primitives are read as 32-bit words") };
        let (header, nodes, units, data) = read(bytes, Sizes::of::<PrimId, P::Data>())?;
        let order = words_of::<u32>(units).into_iter().map(PrimId).collect();
        let primitives = words_of::<P::Data>(data).iter().map(P::from_data).collect();
        let leaves = Shapes { order, primitives };
        check_shapes(&nodes, &leaves, &Expected::of(&header)?)?;
        Ok(Self::from_header(&header, nodes, leaves))
    }
}

/// Bytes of a unit of leaves and of a primitive that is stored besides.
#[derive(Clone, Copy, PartialEq)]
struct Sizes {
    unit: u32,
    primitive: u32,
}

impl Sizes {
    /// Of these types; both are made of 32-bit words.
    fn of<U, D>() -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "sizes of small types")]
        let [unit, primitive] = [size_of::<U>(), size_of::<D>()].map(|n| n as u32);
        Self { unit, primitive }
    }
}

impl<P: LeafPrimitive> WideBvh<P> {
    fn write(&self, sizes: Sizes, units: &[u32], primitives: &[u32]) -> Vec<u8> {
        let header = Header {
            n_lines: self.nodes.lines.len() as u64,
            n_units: (size_of_val(units) / sizes.unit as usize) as u64,
            n_primitives: self.n_primitives as u64,
            root: self.nodes.root,
            depth: self.nodes.depth,
            frame: self.frame.rows,
            bounds: self.bounds,
            predicted: self.predicted,
            baseline: self.baseline,
            n_unit_bytes: sizes.unit,
            n_primitive_bytes: sizes.primitive,
        };
        let mut bytes = Vec::with_capacity(HEADER_BYTES + self.n_bytes() + CHECKSUM_BYTES);
        header.write(&mut bytes);
        for words in [bytemuck::cast_slice(&self.nodes.lines), units, primitives] {
            bytes.extend(words.iter().flat_map(|word: &u32| word.to_le_bytes()));
        }
        let sum = checksum(&bytes);
        bytes.extend(sum.to_le_bytes());
        bytes
    }

    fn from_header(header: &Header, nodes: Nodes, leaves: P::Leaves) -> Self {
        let Header { bounds, predicted, baseline, .. } = *header;
        #[expect(clippy::cast_possible_truncation, reason = "checked to be at most the number in all leaves")]
        let n_primitives = header.n_primitives as usize;
        let (frame, path) = (MeshFrame::new(header.frame), SimdPath::detect());
        Self { nodes, leaves, frame, bounds, n_primitives, predicted, baseline, path }
    }
}

/// The header, the nodes, and the bytes of leaves and primitives.
fn read(bytes: &[u8], sizes: Sizes) -> Result<(Header, Nodes, &[u8], &[u8]), LoadError> {
    let header = Header::read(bytes)?;
    if header.n_bytes() != bytes.len() as u64 {
        return Err(LoadError::Length { n_bytes: bytes.len(), n_expected: header.n_bytes() });
    }
    let (content, sum) = bytes.split_at(bytes.len() - CHECKSUM_BYTES);
    let computed = checksum(content);
    if computed.to_le_bytes() != sum {
        return Err(LoadError::Checksum { computed });
    }
    let (found, expected) = ([header.n_unit_bytes, header.n_primitive_bytes], [sizes.unit, sizes.primitive]);
    if found != expected {
        return Err(LoadError::Primitives { found, expected });
    }
    // The file has the length by the header, so all sections fit into memory.
    #[expect(clippy::cast_possible_truncation, reason = "at most the number of bytes")]
    let [n_line_bytes, n_unit_bytes, _] = header.section_bytes().map(|n| n as usize);
    let (lines, rest) = content[HEADER_BYTES..].split_at(n_line_bytes);
    let (units, primitives) = rest.split_at(n_unit_bytes);
    let nodes = Nodes { lines: words_of(lines), root: header.root, depth: header.depth };
    Ok((header, nodes, units, primitives))
}

/// Whether values are made of 32-bit words.
const fn is_words<D>() -> bool {
    size_of::<D>() > 0 && size_of::<D>().is_multiple_of(4) && align_of::<D>() >= 4
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
