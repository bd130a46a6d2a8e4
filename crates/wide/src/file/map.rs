//! A BVH traced from the pages of its file.

use std::ops::Range;
use std::path::Path;

use canted_trace::TriangleTest;

use super::header::{CHECKSUM_BYTES, HEADER_BYTES};
use super::{LoadError, MapError, SIZES, sections, test_of};
use crate::bvh::TriangleBvh;
use crate::leaf::Blocks;
use crate::node::{CacheLine, HalfBlock, Map, Nodes, Records};

impl TriangleBvh {
    /// The BVH in a file that holds the bytes of [`TriangleBvh::to_bytes`], without a copy: rays are traced from the pages of the file.
    ///
    /// The whole file is read and checked once, as [`TriangleBvh::from_bytes`] does, which takes memory in proportion to it for a moment. A refit or an edit
    /// copies it into memory first. On systems without memory maps, and where the least byte is not first, the file is read.
    ///
    /// # A file that changes
    /// The file must not be written or truncated while the BVH exists: replace it by renaming another one, as programs do that write atomically; the BVH then keeps
    /// the old one. No system gives a map that is safe from other processes. Where a file is written in place, answers are wrong, or a query panics or does not end; where it is
    /// truncated, Linux ends the process by SIGBUS.
    ///
    /// # Errors
    /// A file that cannot be read, or that is not a valid BVH over triangles.
    pub fn map(path: impl AsRef<Path>) -> Result<Self, MapError> {
        Self::map_part(path.as_ref(), 0, None)
    }

    /// As [`TriangleBvh::map`], of a file in which the BVH starts at a byte, a multiple of 64, and ends with the file; with a triangle test of the reader's
    /// choice.
    ///
    /// # Errors
    /// As [`TriangleBvh::map`].
    pub fn map_part(path: &Path, first: u64, test: Option<TriangleTest>) -> Result<Self, MapError> {
        if let Some(map) = Map::open(path)? {
            let first = usize::try_from(first).unwrap_or(usize::MAX).min(map.bytes().len());
            let (header, [lines, units, _]) = sections(&map.bytes()[first..], SIZES)?;
            let of_file = |section: &Range<usize>| section.start + first..section.end + first;
            // Elsewhere than at a multiple of 64, it is copied.
            if let Some((lines, units)) = map.records(of_file(&lines)).zip(map.records(of_file(&units))) {
                let (lines, units) = (Records::mapped(lines), Records::mapped(units));
                return Ok(Self::of_records(&header, lines, units, test.unwrap_or_else(|| test_of(&header)))?);
            }
        }
        let bytes = std::fs::read(path)?;
        let bytes = bytes.get(usize::try_from(first).unwrap_or(usize::MAX)..).unwrap_or_default();
        Ok(test.map_or_else(|| Self::from_bytes(bytes), |test| Self::from_bytes_with(bytes, test))?)
    }

    /// What [`TriangleBvh::map_known`] needs of a BVH that [`TriangleBvh::map`] read from a file.
    #[doc(hidden)]
    #[must_use]
    pub fn known_file(&self) -> KnownFile {
        let Self { nodes, leaves, frame, bounds, n_primitives, predicted, baseline, path } = self;
        let lines = HEADER_BYTES..HEADER_BYTES + size_of_val(&nodes.lines[..]);
        let units = lines.end..lines.end + size_of_val(&leaves.halves[..]);
        let Nodes { root, depth, has_oriented, ref pieces, .. } = *nodes;
        let nodes = Nodes { lines: vec![].into(), root, depth, has_oriented, pieces: pieces.clone(), links: None };
        let leaves = Blocks::new(vec![].into(), leaves.test);
        let (frame, predicted, baseline, path) = (*frame, *predicted, *baseline, *path);
        let empty =
            Self { nodes, leaves, frame, bounds: *bounds, n_primitives: *n_primitives, predicted, baseline, path };
        KnownFile { empty, lines, units }
    }

    /// As [`TriangleBvh::map`], of a file that it has checked, in this process, and that was not written since: nothing waits for
    /// the file before rays need it.
    ///
    /// # Errors
    /// A file that cannot be read, or that has another length.
    #[doc(hidden)]
    pub fn map_known(path: impl AsRef<Path>, known: &KnownFile) -> Result<Self, MapError> {
        if let Some(map) = Map::open(path.as_ref())? {
            let (n_bytes, n_expected) = (map.bytes().len(), known.units.end + CHECKSUM_BYTES);
            if n_bytes != n_expected {
                return Err(LoadError::Length { n_bytes, n_expected: n_expected as u64 }.into());
            }
            let records = map.records::<CacheLine>(known.lines.clone()).zip(map.records(known.units.clone()));
            if let Some((lines, units)) = records {
                map.read_ahead();
                let mut bvh = known.empty.clone();
                bvh.nodes.lines = Records::mapped(lines);
                bvh.leaves = Blocks::new(Records::<HalfBlock>::mapped(units), bvh.leaves.test);
                return Ok(bvh);
            }
        }
        Self::map(path)
    }
}

/// What is known of a file that was mapped and checked: all but its records.
#[doc(hidden)]
#[derive(Clone, Debug)]
pub struct KnownFile {
    /// A BVH without records.
    empty: TriangleBvh,
    lines: Range<usize>,
    units: Range<usize>,
}
