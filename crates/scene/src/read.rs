//! Readers for OBJ, PLY, glTF and environment maps.

mod animated;
mod environment;
mod error;
mod exr;
mod folder;
mod gltf;
mod image;
mod mesh_checks;
mod mtl;
mod obj;
mod ply;
mod polygon;
mod text;
mod warning_groups;

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use crate::Scene;

pub use self::exr::declared_exr_samples;
pub use animated::AnimatedScene;
pub use environment::read_environment;
pub use error::ReadError;
pub(crate) use image::decode;
pub(crate) use text::quoted;

/// Options of [`read_with`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Time in seconds at which an animation of the file poses the scene; `None` for the default pose. Times outside the
    /// animation are clamped to it.
    pub time: Option<f32>,
    /// Name of the animation, or its number from 0 where no animation has that name. `None` for the first animation; others
    /// are then ignored with a warning, as they are usually alternatives.
    pub animation: Option<String>,
}

/// Reads an OBJ (with MTL), PLY, glTF or GLB file with the buffers and images it references.
///
/// The format is determined by the signature (PLY, GLB), else by the extension. Referenced files are only read from the
/// folder of `path` and below. Repairs and skipped elements are reported in [`Scene::warnings`]. Coordinates keep the file's
/// unit.
///
/// # Errors
/// [`ReadError`] with file, location and value.
pub fn read(path: &Path) -> Result<Scene, ReadError> {
    read_with(path, &ReadOptions::default())
}

/// As [`read`], with options.
///
/// # Errors
/// As [`read`].
pub fn read_with(path: &Path, options: &ReadOptions) -> Result<Scene, ReadError> {
    match format_of(path)? {
        Format::Gltf => gltf::read(path, options),
        format => {
            let mut scene = read_static(path, &format, options)?;
            if let Some(time) = options.time {
                scene.warnings.push(format!("ignoring time {time}: {format:?} files have no animation"));
            }
            Ok(scene)
        }
    }
}

/// Reads a file of a format without animations.
fn read_static(path: &Path, format: &Format, options: &ReadOptions) -> Result<Scene, ReadError> {
    if let Some(wanted) = &options.animation {
        return Err(ReadError::UnknownAnimation { path: path.to_owned(), wanted: wanted.clone(), known: Vec::new() });
    }
    let parse = if matches!(format, Format::Obj) { obj::parse } else { ply::parse };
    parse(path, &read_file(path)?)
}

#[derive(Debug)]
enum Format {
    Obj,
    Ply,
    Gltf,
}

/// The format by signature, then by extension.
fn format_of(path: &Path) -> Result<Format, ReadError> {
    let io_error = ReadError::io(path);
    let mut first = Vec::new();
    File::open(path).map_err(&io_error)?.take(4).read_to_end(&mut first).map_err(&io_error)?;
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

/// Reads all bytes of a file.
fn read_file(path: &Path) -> Result<Vec<u8>, ReadError> {
    fs::read(path).map_err(ReadError::io(path))
}

#[cfg(test)]
mod tests;
