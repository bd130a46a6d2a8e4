//! Environment maps in Radiance HDR and OpenEXR format, distinguished by signature.

mod exr;
mod hdr;
#[cfg(test)]
mod tests;

use std::fs;
use std::path::Path;

use super::ReadError;
use crate::EnvironmentImage;

/// Largest number of texels: 16384 x 8192, 1.5 GiB as `f32`.
const MAX_TEXELS: u64 = 1 << 27;

/// Decoded texels, unchecked.
struct Texels {
    width: u32,
    height: u32,
    list: Vec<[f32; 3]>,
}

/// Reads an equirectangular environment map (`.hdr`, `.exr`) of linear RGB radiance, with scale 1 and rotation 0.
///
/// EXR files use the first layer with `R`, `G` and `B`, or only `Y`. Non-finite and negative texels become black with a
/// warning.
///
/// # Errors
/// [`ReadError`] if the format is unknown, the data is truncated, or the size exceeds what the data can hold.
pub fn read_environment(path: &Path, warnings: &mut Vec<String>) -> Result<EnvironmentImage, ReadError> {
    parse(path, &fs::read(path).map_err(ReadError::io(path))?, warnings)
}

/// Parses `bytes`; `path` is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8], warnings: &mut Vec<String>) -> Result<EnvironmentImage, ReadError> {
    let Texels { width, height, list: mut texels } = match bytes {
        [0x76, 0x2f, 0x31, 0x01, ..] => exr::decode(bytes),
        [b'#', b'?', ..] => hdr::decode(bytes),
        _ => Err("unsupported format (expected Radiance HDR or OpenEXR)".to_owned()),
    }
    .map_err(|message| ReadError::malformed(path, "environment map", message))?;
    let n_bad = texels.iter_mut().filter_map(blacken).count();
    if n_bad > 0 {
        warnings.push(format!("{}: replacing non-finite or negative texels by black: {n_bad}", path.display()));
    }
    let name = path.display().to_string();
    Ok(EnvironmentImage { name, width, height, texels, scale: [1.0; 3], turn_degrees: 0.0 })
}

/// Sets a non-finite or negative texel to zero; `None` for valid ones.
fn blacken(texel: &mut [f32; 3]) -> Option<()> {
    let is_bad = !texel.iter().all(|x| x.is_finite() && *x >= 0.0);
    is_bad.then(|| *texel = [0.0; 3])
}
