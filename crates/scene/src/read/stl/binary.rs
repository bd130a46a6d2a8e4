//! Binary STL: a header of 80 bytes, a count, and 50 bytes per triangle, little-endian.

use std::path::Path;

use super::{Triangles, too_many};
use crate::read::ReadError;

/// Header and count.
const START_BYTES: usize = 84;
/// Normal, three vertices and an attribute of two bytes.
const TRIANGLE_BYTES: usize = 50;

/// The declared number of triangles.
fn count(bytes: &[u8]) -> Option<u32> {
    bytes.get(80..START_BYTES)?.try_into().ok().map(u32::from_le_bytes)
}

/// Whether a file of `n_bytes` with this start has exactly the size that it declares.
pub(super) fn has_declared_size(start: &[u8], n_bytes: u64) -> bool {
    let expected = |n: u32| u64::from(n) * TRIANGLE_BYTES as u64 + START_BYTES as u64;
    count(start).is_some_and(|n| n_bytes == expected(n))
}

/// Reads all triangles. Bytes after the last one and attributes are reported.
pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    triangles: &mut Triangles,
    warnings: &mut Vec<String>,
) -> Result<(), ReadError> {
    let n_declared = count(bytes).ok_or_else(|| {
        let message = format!("{} bytes, but a binary STL file has at least {START_BYTES}", bytes.len());
        ReadError::malformed(path, "header", message)
    })?;
    let (records, rest) = bytes[START_BYTES..].as_chunks::<TRIANGLE_BYTES>();
    let n = usize::try_from(n_declared).ok().filter(|&n| n <= records.len()).ok_or_else(|| {
        let message = format!("{n_declared} triangles declared, but the remaining data holds {}", records.len());
        ReadError::malformed(path, "header", message)
    })?;
    if n < records.len() || !rest.is_empty() {
        warnings.push("ignoring bytes after the last declared triangle".to_owned());
    }
    triangles.triangles.reserve_exact(n);
    let mut n_attributes = 0_usize;
    for record in &records[..n] {
        let (numbers, attribute) = record.as_chunks::<4>();
        // The first three numbers are the normal.
        let number = |k: usize| f32::from_le_bytes(numbers[k]);
        let corner = |k: usize| [number(3 * k + 3), number(3 * k + 4), number(3 * k + 5)];
        triangles.add([corner(0), corner(1), corner(2)]).ok_or_else(|| too_many(path))?;
        n_attributes += usize::from(attribute != [0, 0]);
    }
    if n_attributes > 0 {
        warnings.push(format!("ignoring attributes of triangles (colors): {n_attributes}"));
    }
    Ok(())
}
