//! Readers: from a file to a [`Scene`].

mod error;
mod folder;
mod gltf;
mod image;
mod mtl;
mod obj;
mod ply;
mod polygon;
mod repair;
mod text;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::Scene;

pub use error::ReadError;

/// Reads an OBJ (with its MTL), PLY, glTF or GLB file, and the buffers and images that it names.
///
/// The format is told by the first bytes where they are unmistakable (PLY, GLB), else by the extension. Files that the
/// file names are only read from its own folder and below. What had to be repaired or left out is told in
/// [`Scene::warnings`]. Coordinates are those of the file, in its own unit.
///
/// # Errors
/// [`ReadError`], a sentence that names the file, the place in it and the value found there.
pub fn read(path: &Path) -> Result<Scene, ReadError> {
    match format_of(path)? {
        Format::Obj => obj::read(path),
        Format::Ply => ply::read(path),
        Format::Gltf => gltf::read(path),
    }
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
