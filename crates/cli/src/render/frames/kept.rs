//! `--resume`: frames that exist.

use std::path::Path;

use anyhow::{Result, anyhow};
use canted_film::read_picture;

use crate::output;

/// Whether a frame exists as a whole picture of this size. Warns about a file that is no whole picture: it is rendered again.
///
/// # Errors
/// A picture of another size, which belongs to another sequence.
pub(super) fn is_whole(path: &Path, [width, height]: [u32; 2]) -> Result<bool> {
    if !path.exists() {
        return Ok(false);
    }
    match read_picture(path) {
        Ok(picture) if [picture.width, picture.height] == [width, height] => Ok(true),
        Ok(picture) => Err(anyhow!(
            "{}: the picture is {} x {}, not {width} x {height}; remove it, or render without --resume",
            path.display(),
            picture.width,
            picture.height
        )),
        Err(error) => {
            output::warn(&format!("rendering the frame again: {error}"));
            Ok(false)
        }
    }
}
