//! A BVH with its vertex indices as a file.
//!
//! ```text
//! offset   bytes        content
//! 0        8            "CANTEDPY"
//! 8        4            version, 2
//! 12       4, 4         triangle test and preset, by their order; the number of presets: unknown
//! 20       4            bit 0: whether there are indices; bit 1: whether the origin was chosen near the mesh
//! 24       24           origin
//! 48       8, 8         vertices; triangles
//! 64       12 each      indices
//!          8            checksum of all before: FNV-1a
//!                       zeros up to a multiple of 64, so that the BVH may be mapped
//!                       the BVH as `WideBvh::to_bytes` writes it, with a checksum of its own
//! ```
//!
//! All numbers have the least byte first.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use canted::{Preset, TriangleBvh, TriangleTest};
use pyo3::prelude::*;

use crate::arrays::NO_ORIGIN;
use crate::error::{invalid, of_file};
use crate::geometry::Geometry;

const MAGIC: &[u8; 8] = b"CANTEDPY";
const VERSION: u32 = 2;
const HEADER_BYTES: usize = 64;

/// Of a BVH in a file.
const ALIGNMENT: usize = 64;

/// How files of the Rust library start.
const RUST_MAGIC: &[u8; 8] = b"CANTWIDE";

/// Writes to a temporary name, then renames.
pub(crate) fn save(path: &Path, geometry: &Geometry) -> PyResult<()> {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}.tmp", std::process::id()));
    let temporary = PathBuf::from(name);
    let written = fs::write(&temporary, to_bytes(geometry)).and_then(|()| fs::rename(&temporary, path));
    written.map_err(|error| {
        // Best effort: the first error is the one to report.
        let _ = fs::remove_file(&temporary);
        of_file(path, &error)
    })
}

/// Reads a file of `save`, or of the Rust library.
pub(crate) fn load(path: &Path) -> PyResult<Geometry> {
    let bytes = fs::read(path).map_err(|error| of_file(path, &error))?;
    from_bytes(&bytes).map_err(|sentence| invalid(format!("{}: {sentence}", path.display())))
}

pub(crate) fn to_bytes(geometry: &Geometry) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    let known = Preset::ALL.iter().position(|&known| Some(known) == geometry.preset);
    let test = TriangleTest::ALL.iter().position(|&test| test == geometry.mesh.test());
    let flags = usize::from(geometry.triangles.is_some()) | usize::from(geometry.is_near) << 1;
    let numbers = [test.unwrap_or(0), known.unwrap_or(Preset::ALL.len()), flags];
    bytes.extend(VERSION.to_le_bytes());
    for number in numbers {
        bytes.extend(u32::try_from(number).unwrap_or(u32::MAX).to_le_bytes());
    }
    bytes.extend(geometry.origin.iter().flat_map(|x| x.to_le_bytes()));
    let triangles = geometry.triangles.as_ref().map_or(&[][..], |triangles| &triangles[..]);
    for count in [geometry.n_vertices, triangles.len()] {
        bytes.extend((count as u64).to_le_bytes());
    }
    bytes.extend(triangles.as_flattened().iter().flat_map(|index| index.to_le_bytes()));
    let sum = checksum(&bytes);
    bytes.extend(sum.to_le_bytes());
    bytes.resize(bytes.len().next_multiple_of(ALIGNMENT), 0);
    bytes.extend(geometry.mesh.to_bytes());
    bytes
}

/// The BVH, or a sentence about what is wrong.
pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Geometry, String> {
    parse(bytes, bytes.len() as u64, |first, test| {
        let bytes = usize::try_from(first).ok().and_then(|first| bytes.get(first..)).unwrap_or_default();
        TriangleBvh::from_bytes_with(bytes, test).map_err(|error| error.to_string())
    })
}

/// Reads a file of `save`, or of the Rust library, whose BVH stays in the file.
pub(crate) fn map(path: &Path) -> PyResult<Geometry> {
    let mut file = File::open(path).map_err(|error| of_file(path, &error))?;
    let n_bytes = file.metadata().map_err(|error| of_file(path, &error))?.len();
    let mut head = vec![];
    let mut read = |n: u64| (&mut file).take(n).read_to_end(&mut head).map_err(|error| of_file(path, &error));
    read(HEADER_BYTES as u64)?;
    let n_triangles = head.get(56..64).and_then(|bytes| bytes.try_into().ok()).map_or(0, u64::from_le_bytes);
    if head.starts_with(MAGIC) {
        let mut read = |n: u64| (&mut file).take(n).read_to_end(&mut head).map_err(|error| of_file(path, &error));
        read(n_triangles.saturating_mul(12).saturating_add(8))?;
    }
    let named = |sentence: String| invalid(format!("{}: {sentence}", path.display()));
    parse(&head, n_bytes, |first, test| {
        TriangleBvh::map_part(path, first, Some(test)).map_err(|error| error.to_string())
    })
    .map_err(named)
}

/// What `bytes` say, the start of a file, and the BVH that `load` reads from a place on.
fn parse(
    bytes: &[u8],
    n_bytes: u64,
    load: impl Fn(u64, TriangleTest) -> Result<TriangleBvh, String>,
) -> Result<Geometry, String> {
    if bytes.starts_with(RUST_MAGIC) {
        let mesh = Arc::new(load(0, TriangleTest::Watertight)?);
        let winding = Arc::default();
        let n_vertices = 0;
        return Ok(Geometry {
            mesh,
            triangles: None,
            n_vertices,
            origin: NO_ORIGIN,
            is_near: false,
            preset: None,
            winding,
        });
    }
    let short = || format!("the file has {n_bytes} bytes and ends too early");
    let (header, rest) = bytes.split_at_checked(HEADER_BYTES).ok_or_else(short)?;
    if !header.starts_with(MAGIC) {
        return Err("the file is not a BVH: it starts with other bytes than CANTEDPY or CANTWIDE".to_owned());
    }
    let words = header.as_chunks::<4>().0;
    let word = |i: usize| u32::from_le_bytes(words[i]);
    let doubles = header.as_chunks::<8>().0;
    if word(2) != VERSION {
        return Err(format!("the file has version {}; this package reads version {VERSION}", word(2)));
    }
    let n_index_bytes = u64::from_le_bytes(doubles[7]).checked_mul(12).and_then(|n| usize::try_from(n).ok());
    let (indices, rest) = n_index_bytes.and_then(|n| rest.split_at_checked(n)).ok_or_else(short)?;
    let (stored, _) = rest.split_first_chunk::<8>().ok_or_else(short)?;
    if u64::from_le_bytes(*stored) != checksum(&bytes[..HEADER_BYTES + indices.len()]) {
        return Err("the file is damaged: its checksum is wrong".to_owned());
    }
    let test =
        TriangleTest::ALL.get(word(3) as usize).ok_or_else(|| format!("the file has triangle test {}", word(3)))?;
    let mesh = load((HEADER_BYTES + indices.len() + 8).next_multiple_of(ALIGNMENT) as u64, *test)?;
    let origin = std::array::from_fn(|k| f64::from_le_bytes(doubles[3 + k]));
    let n_vertices = u64::from_le_bytes(doubles[6]);
    let triangles: Vec<[u32; 3]> =
        indices.as_chunks::<12>().0.iter().map(|t| std::array::from_fn(|k| index(t, k))).collect();
    let has_triangles = word(5) & 1 != 0;
    let is_valid = origin.iter().all(|x| x.is_finite())
        && (!has_triangles || triangles.len() == mesh.n_primitives())
        && triangles.as_flattened().iter().all(|&index| u64::from(index) < n_vertices);
    if !is_valid {
        return Err("the file has an origin or vertex indices that do not belong to its BVH".to_owned());
    }
    Ok(Geometry {
        mesh: Arc::new(mesh),
        triangles: has_triangles.then(|| Arc::new(triangles)),
        n_vertices: usize::try_from(n_vertices).map_err(|error| error.to_string())?,
        origin,
        is_near: word(5) & 2 != 0,
        preset: Preset::ALL.get(word(4) as usize).copied(),
        winding: Arc::default(),
    })
}

/// An index of a triangle of twelve bytes.
fn index(triangle: &[u8; 12], k: usize) -> u32 {
    u32::from_le_bytes(triangle.as_chunks::<4>().0[k])
}

/// FNV-1a of 64 bits.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |sum, &byte| (sum ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}
