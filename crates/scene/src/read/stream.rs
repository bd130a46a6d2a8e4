//! Triangles of files that are read a part at a time, in memory that does not depend on the size of the file.
//!
//! A binary STL file with the size that it declares, and a binary PLY file of vertices and faces; other files are read whole.

use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::Path;

use super::error::ReadError;
use super::mesh::{PART, TakeTriangles};
use super::ply;

/// Bytes before the first triangle of a binary STL file, and of a triangle.
const START_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;

/// Calls `visit` with the triangles of a file in order, in parts, without those that have a vertex that is not finite, as
/// [`read`](crate::read) skips them. Returns warnings; `None` without a call where the file cannot be read in parts. About `memory` bytes
/// hold vertices that faces share.
///
/// # Errors
/// A file that cannot be read; the first error of `visit`.
pub fn stream_triangles<E: From<ReadError>>(
    path: &Path,
    memory: u64,
    mut visit: impl FnMut(&[[[f32; 3]; 3]]) -> Result<(), E>,
) -> Result<Option<Vec<String>>, E> {
    let has_extension = |name: &str| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(name));
    match () {
        () if has_extension("stl") => binary_stl(path, &mut visit),
        () if has_extension("ply") => ply::stream::triangles(path, memory, &mut visit),
        () => Ok(None),
    }
}

fn binary_stl<E: From<ReadError>>(path: &Path, visit: &mut TakeTriangles<'_, E>) -> Result<Option<Vec<String>>, E> {
    // What cannot be opened is reported by the reader of whole files.
    let Ok(file) = File::open(path) else { return Ok(None) };
    let Some(n_bytes) = file.metadata().ok().filter(|found| found.is_file()).map(|found| found.len()) else {
        return Ok(None);
    };
    let mut file = BufReader::with_capacity(1 << 20, file);
    let mut start = [0; START_BYTES];
    if file.read_exact(&mut start).is_err() {
        return Ok(None);
    }
    let n = start.last_chunk().map_or(0, |count| u64::from(u32::from_le_bytes(*count)));
    if n == 0 || n * TRIANGLE_BYTES as u64 + START_BYTES as u64 != n_bytes {
        return Ok(None);
    }
    let (mut bytes, mut triangles, mut n_dropped) = (vec![], vec![], 0_usize);
    let mut left = n as usize;
    while left > 0 {
        let n_part = left.min(PART);
        left -= n_part;
        bytes.resize(n_part * TRIANGLE_BYTES, 0);
        file.read_exact(&mut bytes).map_err(|error| ReadError::io(path)(error))?;
        triangles.clear();
        for record in bytes.as_chunks::<TRIANGLE_BYTES>().0 {
            let numbers = record.as_chunks::<4>().0;
            // The first three numbers are the normal.
            let corners: [[f32; 3]; 3] =
                std::array::from_fn(|i| std::array::from_fn(|k| f32::from_le_bytes(numbers[3 + 3 * i + k])));
            if corners.as_flattened().iter().all(|x| x.is_finite()) {
                triangles.push(corners);
            } else {
                n_dropped += 1;
            }
        }
        visit(&triangles)?;
    }
    let warning = (n_dropped > 0).then(|| format!("skipping triangles with a non-finite vertex: {n_dropped}"));
    Ok(Some(warning.into_iter().collect()))
}
