//! Wavefront OBJ with its MTL.
//!
//! ```text
//! bytes -> statements -> materials (surface) -> meshes -> shapes (equal meshes become instances)
//! ```
//!
//! Triangles are numbered in the order of the file's faces; a polygon counts as its triangles. Triangles that are
//! dropped for a vertex that is not finite, and faces of fewer than three corners, have no number.

mod materials;
mod meshes;
mod shapes;
mod statements;
mod surface;

use std::path::Path;

use super::ReadError;
use super::repair::Repair;
use crate::Scene;

/// Reads an OBJ file. Each run of faces with the same object, group and material is a mesh with one instance.
pub(super) fn read(path: &Path) -> Result<Scene, ReadError> {
    let bytes = std::fs::read(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    parse(path, &bytes)
}

/// The scene in `bytes`; `path` tells the folder of the material libraries, and names the file in messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Scene, ReadError> {
    let stated = statements::statements(path, bytes)?;
    if stated.face_ends.is_empty() {
        let reason = if bytes.contains(&0) { "it is not a text file" } else { "no face" };
        return Err(ReadError::empty(path, reason));
    }
    let mut scene = Scene::default();
    materials::materials(path, &stated.libraries, &stated.materials, &mut scene)?;
    let mut repair = Repair::default();
    repair.n_small_faces = stated.n_small_faces;
    meshes::meshes(path, &stated, &mut scene, &mut repair)?;
    repair.finish(path, &mut scene)?;
    Ok(scene)
}

#[cfg(test)]
mod tests;
