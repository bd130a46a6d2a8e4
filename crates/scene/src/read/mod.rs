//! Readers: from a file to a [`Scene`].

mod environment;
mod error;
mod exr;
mod folder;
mod gltf;
mod image;
mod mtl;
mod obj;
mod ply;
mod polygon;
mod remarks;
mod repair;
mod text;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::Scene;

pub use self::exr::declared_exr_samples;
pub use environment::read_environment;
pub use error::ReadError;
pub(crate) use image::decode;
pub(crate) use text::quoted;

/// What a reader is told beside the file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Seconds into the file's first animation, which poses the scene; `None` for the pose that the file has without it.
    /// Before the first key and behind the last it stands still. Of a file with several animations the others are left
    /// out, as they are as a rule alternatives; a warning says so.
    pub time: Option<f32>,
}

/// Reads an OBJ (with its MTL), PLY, glTF or GLB file, and the buffers and images that it names.
///
/// The format is told by the first bytes where they are unmistakable (PLY, GLB), else by the extension. Files that the
/// file names are only read from its own folder and below. What had to be repaired or left out is told in
/// [`Scene::warnings`]. Coordinates are those of the file, in its own unit.
///
/// # Errors
/// [`ReadError`], a sentence that names the file, the place in it and the value found there.
pub fn read(path: &Path) -> Result<Scene, ReadError> {
    read_with(path, &ReadOptions::default())
}

/// As [`read`], posed by an animation of the file.
///
/// # Errors
/// As [`read`].
pub fn read_with(path: &Path, options: &ReadOptions) -> Result<Scene, ReadError> {
    let format = format_of(path)?;
    let mut scene = match format {
        Format::Obj => obj::read(path)?,
        Format::Ply => ply::read(path)?,
        Format::Gltf => return gltf::read(path, options),
    };
    if let Some(time) = options.time {
        scene.warnings.push(format!("the format knows no animation, the time {time} changes nothing"));
    }
    Ok(scene)
}

/// The formats told apart.
enum Format {
    Obj,
    Ply,
    Gltf,
}

/// Tells the format by the first bytes, then by the extension.
fn format_of(path: &Path) -> Result<Format, ReadError> {
    let io_error = |source| ReadError::Io { path: path.to_owned(), source };
    let mut first = Vec::new();
    File::open(path).map_err(io_error)?.take(4).read_to_end(&mut first).map_err(io_error)?;
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match (&first[..], &extension[..]) {
        (b"glTF", _) => Ok(Format::Gltf),
        (b"ply\n" | b"ply\r", _) => Ok(Format::Ply),
        (_, "gltf" | "glb") => Ok(Format::Gltf),
        (_, "ply") => Ok(Format::Ply),
        (_, "obj") => Ok(Format::Obj),
        _ => Err(ReadError::UnknownFormat { path: path.to_owned() }),
    }
}

#[cfg(test)]
mod tests;
