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

use self::statements::Statements;
use super::mesh_checks::MeshChecks;
use super::{ReadError, vertex_colors};
use crate::Scene;

/// Parses an OBJ file. Consecutive faces with equal object, group and material form a mesh with one instance.
///
/// `path` gives the folder of the material libraries and is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Scene, ReadError> {
    let mut statements = statements::parse(path, bytes)?;
    if statements.face_ends.is_empty() {
        let reason = if bytes.contains(&0) { "not a text file" } else { "no faces" };
        return Err(ReadError::empty(path, reason));
    }
    let mut scene = Scene { warnings: std::mem::take(&mut statements.warnings), ..Scene::default() };
    materials::materials(path, &statements.libraries, &statements.materials, &mut scene)?;
    let colors = colors(&mut statements, &mut scene);
    let mut checks = MeshChecks::default();
    checks.n_small_faces = statements.n_small_faces;
    meshes::meshes(path, &statements, colors.as_deref(), &mut scene, &mut checks)?;
    checks.finish(path, &mut scene)?;
    Ok(scene)
}

/// Linear vertex colors, if the file has usable ones. Faces without a material are white under them.
fn colors(statements: &mut Statements, scene: &mut Scene) -> Option<Vec<[f32; 4]>> {
    let colors = std::mem::take(&mut statements.colors);
    if colors.is_empty() {
        return None;
    }
    let linear = vertex_colors::linear(colors, None).map_err(|warning| scene.warnings.push(warning)).ok()?;
    for (material, name) in scene.materials.iter_mut().zip(&statements.materials) {
        if name.is_none() {
            material.base_color = [1.0; 3];
        }
    }
    Some(linear)
}

#[cfg(test)]
mod tests;
