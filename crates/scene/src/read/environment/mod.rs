//! Pictures of all directions: Radiance HDR and OpenEXR, told apart by their first bytes.

mod exr;
mod hdr;
#[cfg(test)]
mod tests;

use std::fs;
use std::path::Path;

use super::ReadError;
use crate::EnvironmentImage;

/// Most texels of a picture: 16384 x 8192, 1.5 GiB as `f32`.
const MAX_TEXELS: u64 = 1 << 27;

/// The texels of a picture, as the file has them.
struct Texels {
    width: u32,
    height: u32,
    list: Vec<[f32; 3]>,
}

/// Reads a picture of all directions (`.hdr`, `.exr`), linear RGB radiance, not scaled and not turned.
///
/// Of an EXR the first layer that has `R`, `G` and `B`, or `Y` alone, is taken. Texels that are not finite or negative
/// become black, which `warnings` says.
///
/// # Errors
/// [`ReadError`] for a file that is neither, ends early, or promises more texels than it can hold.
pub fn read_environment(path: &Path, warnings: &mut Vec<String>) -> Result<EnvironmentImage, ReadError> {
    let bytes = fs::read(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    parse(path, &bytes, warnings)
}

/// The picture in `bytes`; `path` names it.
pub(super) fn parse(path: &Path, bytes: &[u8], warnings: &mut Vec<String>) -> Result<EnvironmentImage, ReadError> {
    let Texels { width, height, list: mut texels } = match bytes {
        [0x76, 0x2f, 0x31, 0x01, ..] => exr::decode(bytes),
        [b'#', b'?', ..] => hdr::decode(bytes),
        _ => Err("the content is neither Radiance HDR nor OpenEXR".to_owned()),
    }
    .map_err(|message| ReadError::malformed(path, "environment", message))?;
    let n_bad = texels.iter_mut().filter_map(blacken).count();
    if n_bad > 0 {
        warnings.push(format!("{}: texels that are not finite or negative are black: {n_bad}", path.display()));
    }
    let name = path.display().to_string();
    Ok(EnvironmentImage { name, width, height, texels, scale: [1.0; 3], turn_degrees: 0.0 })
}

/// Sets a texel that no light can have to zero; `None` for the others.
fn blacken(texel: &mut [f32; 3]) -> Option<()> {
    let is_bad = !texel.iter().all(|x| x.is_finite() && *x >= 0.0);
    is_bad.then(|| *texel = [0.0; 3])
}
