//! Stanford PLY, ASCII and binary of both byte orders.
//!
//! ```text
//! bytes -> header -> body (vertices, faces; all else is skipped) -> mesh
//! ```
//!
//! One mesh and one instance, in the file's vertex order. Texture coordinates are kept where a comment names an image.

mod body;
mod header;
mod table;

use std::path::Path;

use canted_obb::Affine;

use self::table::Table;
use super::folder::Folder;
use super::repair::{Repair, unit_normal, usable_uv};
use super::{ReadError, image, polygon, text};
use crate::{Instance, Material, MaterialId, Mesh, MeshId, Part, Scene, TextureId, TextureRef};

/// Reads a PLY file as one mesh.
pub(super) fn read(path: &Path) -> Result<Scene, ReadError> {
    let bytes = std::fs::read(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    parse(path, &bytes)
}

/// The scene in `bytes`; `path` tells the folder of the image, and names the file in messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Scene, ReadError> {
    let (header, body) = header::header(path, bytes)?;
    let (table, is_read_to_end) = table::table(path, &header, body)?;
    if table.face_ends.is_empty() {
        return Err(ReadError::empty(path, "no face"));
    }
    let mut scene = Scene::default();
    if !is_read_to_end {
        scene.warnings.push("bytes behind the last declared element are ignored".into());
    }
    let material = material(path, header.texture, &mut scene);
    scene.materials.push(material);
    let mut repair = Repair::default();
    let triangles = triangles(path, &table, &mut repair)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let is_textured = !scene.textures.is_empty();
    scene.meshes.push(mesh(name, table, triangles, is_textured));
    let (mesh, world_from_object) = (MeshId(0), Affine::IDENTITY);
    scene.instances.push(Instance { mesh, world_from_object, world_from_object_close: None, first_primitive: 0 });
    repair.finish(path, &mut scene)?;
    Ok(scene)
}

/// A plain material, or one with the image that the header names.
fn material(path: &Path, texture: Option<&[u8]>, scene: &mut Scene) -> Material {
    let Some(name) = texture else { return Material::default() };
    let name = String::from_utf8_lossy(name);
    let bytes = Folder::of(path).map_err(|error| error.to_string()).and_then(|folder| {
        let bytes = folder.read(&name).map_err(|refusal| refusal.to_string());
        scene.files = folder.into_found();
        bytes
    });
    match bytes.and_then(|bytes| image::decode(&name, &bytes).map_err(|error| error.to_string())) {
        Ok(texture) => {
            scene.textures.push(texture);
            Material {
                base_color: [1.0; 3],
                base_color_texture: Some(TextureRef::new(TextureId(0))),
                ..Material::default()
            }
        }
        Err(message) => {
            scene.warnings.push(format!("texture {} is left out: {message}", text::quoted(name.as_bytes())));
            Material::default()
        }
    }
}

/// The faces as triangles of vertex numbers, in file order; every number is that of a vertex.
fn triangles(path: &Path, table: &Table, repair: &mut Repair) -> Result<Vec<[u32; 3]>, ReadError> {
    let mut triangles = Vec::with_capacity(table.face_ends.len());
    let (mut corners, mut cuts) = (Vec::new(), Vec::new());
    let mut start = 0;
    for (face, &end) in table.face_ends.iter().enumerate() {
        let indices = &table.corners[start..end];
        start = end;
        if indices.len() < 3 {
            repair.n_small_faces += 1;
            continue;
        }
        corners.clear();
        for &index in indices {
            let position = table.positions.get(index as usize).ok_or_else(|| {
                let message = format!("vertex index {index} of {}", table.positions.len());
                ReadError::malformed(path, format!("face {face}"), message)
            })?;
            corners.push(*position);
        }
        cuts.clear();
        repair.n_tangled_faces += usize::from(polygon::triangulate(&corners, &mut cuts) == polygon::Cut::Tangled);
        let kept = cuts.iter().filter(|cut| repair.keeps(cut.map(|k| corners[k])));
        triangles.extend(kept.map(|cut| cut.map(|k| indices[k])));
    }
    Ok(triangles)
}

fn mesh(name: String, table: Table, triangles: Vec<[u32; 3]>, is_textured: bool) -> Mesh {
    let normals = table.normals.map(|normals| normals.into_iter().map(unit_normal).collect());
    let uvs = table.uvs.filter(|_| is_textured).map(|uvs| uvs.into_iter().map(usable_uv).collect());
    let parts = vec![Part { first_triangle: 0, material: MaterialId(0) }];
    Mesh { name, positions: table.positions, triangles, normals, uvs, parts, ..Mesh::default() }
}

#[cfg(test)]
mod tests;
