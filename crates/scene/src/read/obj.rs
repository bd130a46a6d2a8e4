//! Wavefront OBJ with its MTL.
//!
//! ```text
//! bytes -> statements -> materials (surface) -> meshes -> dedup (equal meshes become instances)
//! ```
//!
//! Triangles are numbered in file order; a polygon counts as its triangles. Dropped triangles (non-finite vertices) and
//! faces with fewer than three corners have no number.

mod dedup;
mod materials;
mod meshes;
mod statements;
mod surface;

use std::path::Path;

use super::ReadError;
use super::mesh_checks::MeshChecks;
use crate::Scene;

/// Parses an OBJ file. Consecutive faces with equal object, group and material form a mesh with one instance.
///
/// `path` gives the folder of the material libraries and is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Scene, ReadError> {
    let statements = statements::parse(path, bytes)?;
    if statements.face_ends.is_empty() {
        let reason = if bytes.contains(&0) { "not a text file" } else { "no faces" };
        return Err(ReadError::empty(path, reason));
    }
    let mut scene = Scene::default();
    materials::materials(path, &statements.libraries, &statements.materials, &mut scene)?;
    let mut checks = MeshChecks::default();
    checks.n_small_faces = statements.n_small_faces;
    meshes::meshes(path, &statements, &mut scene, &mut checks)?;
    checks.finish(path, &mut scene)?;
    Ok(scene)
}

#[cfg(test)]
mod tests;
