//! Stanford PLY, ASCII and binary of both byte orders.
//!
//! ```text
//! bytes -> header -> body (vertices and faces, others are skipped) -> mesh
//! ```
//!
//! Gives one mesh with one instance, in the file's vertex order. Texture coordinates are kept if a comment names a texture,
//! vertex colors always. Triangle strips become triangles.

mod body;
mod faces;
mod header;
mod table;

use std::path::Path;

use self::faces::Faces;
use self::table::Table;
use super::folder::Folder;
use super::mesh_checks::{MeshChecks, unit_normal, usable_uv};
use super::{ReadError, image, single, text, vertex_colors};
use crate::{Material, Mesh, Scene, TextureId, TextureRef};

/// Parses a PLY file; `path` gives the folder of the texture and is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Scene, ReadError> {
    let (header, body) = header::header(path, bytes)?;
    let (table, is_read_to_end) = table::table(path, &header, body)?;
    if table.faces.is_empty() {
        return Err(ReadError::empty(path, "no faces"));
    }
    let mut scene = Scene { warnings: header.warnings, ..Scene::default() };
    if !is_read_to_end {
        scene.warnings.push("ignoring bytes after the last declared element".into());
    }
    let mut material = material(path, header.texture, &mut scene);
    let mut checks = MeshChecks::default();
    let mut table = table;
    let triangles = triangles(path, &table.positions, std::mem::take(&mut table.faces), &mut checks)?;
    let colors = table.colors.take().and_then(|colors| {
        vertex_colors::linear(colors, table.max_color).map_err(|warning| scene.warnings.push(warning)).ok()
    });
    if colors.is_some() {
        // Colors are reflectances, not factors of the default gray.
        material.base_color = [1.0; 3];
    }
    let mesh = Mesh { colors, ..mesh(table, triangles, !scene.textures.is_empty()) };
    single::add(path, mesh, material, checks, scene)
}

/// The default material, or one with the texture of the header.
fn material(path: &Path, texture: Option<&[u8]>, scene: &mut Scene) -> Material {
    let Some(name) = texture else { return Material::default() };
    let name = String::from_utf8_lossy(name);
    let bytes = Folder::of(path).map_err(|error| error.to_string()).and_then(|folder| {
        let bytes = folder.read(&name);
        scene.files = folder.found();
        bytes
    });
    match bytes.and_then(|bytes| image::decode(&name, &bytes)) {
        Ok(texture) => {
            scene.textures.push(texture);
            Material {
                base_color: [1.0; 3],
                base_color_texture: Some(TextureRef::new(TextureId(0))),
                ..Material::default()
            }
        }
        Err(message) => {
            scene.warnings.push(format!("skipping texture {}: {message}", text::quoted(name.as_bytes())));
            Material::default()
        }
    }
}

/// Triangulates the faces in file order and checks vertex indices. Where all are triangles, the result is in their memory.
fn triangles(
    path: &Path,
    positions: &[[f32; 3]],
    faces: Faces,
    checks: &mut MeshChecks,
) -> Result<Vec<[u32; 3]>, ReadError> {
    let position = |face: usize, index: u32| {
        positions.get(index as usize).copied().ok_or_else(|| {
            let message = format!("vertex index {index} out of range ({} vertices)", positions.len());
            ReadError::malformed(path, format!("face {face}"), message)
        })
    };
    let polygons = match faces.into_triangles() {
        Ok(mut triangles) => {
            for (face, &index) in triangles.iter().enumerate().flat_map(|(face, t)| t.iter().map(move |i| (face, i))) {
                position(face, index)?;
            }
            triangles.retain(|triangle| checks.keeps(triangle.map(|index| positions[index as usize])));
            return Ok(triangles);
        }
        Err(polygons) => polygons,
    };
    let mut triangles = Vec::with_capacity(polygons.len());
    let (mut corners, mut cuts) = (Vec::new(), Vec::new());
    for (face, indices) in polygons.iter().enumerate() {
        if indices.len() < 3 {
            checks.n_small_faces += 1;
            continue;
        }
        corners.clear();
        for &index in indices {
            corners.push(position(face, index)?);
        }
        checks.triangulate(&corners, &mut cuts);
        triangles.extend(cuts.iter().map(|cut| cut.map(|k| indices[k])));
    }
    Ok(triangles)
}

fn mesh(table: Table, triangles: Vec<[u32; 3]>, is_textured: bool) -> Mesh {
    let normals = table.normals.map(|normals| normals.into_iter().map(unit_normal).collect());
    let uvs = table.uvs.filter(|_| is_textured).map(|uvs| uvs.into_iter().map(usable_uv).collect());
    Mesh { positions: table.positions, triangles, normals, uvs, ..Mesh::default() }
}

#[cfg(test)]
mod tests;
