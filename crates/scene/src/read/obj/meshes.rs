//! Runs of faces as meshes: polygons are cut, vertices split where position, texture coordinate or normal differ.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use super::shapes::Shapes;
use super::statements::{ABSENT, Corner, Statements};
use crate::read::repair::{Repair, unit_normal, usable_uv};
use crate::read::{ReadError, polygon};
use crate::{MaterialId, Mesh, Part, Scene};

/// Adds a mesh and an instance for each run that has a triangle left, or an instance alone where the shape is known.
pub(super) fn meshes(
    path: &Path,
    stated: &Statements,
    scene: &mut Scene,
    repair: &mut Repair,
) -> Result<(), ReadError> {
    let mut shapes = Shapes::default();
    let mut first_primitive = 0_u32;
    for (k, run) in stated.runs.iter().enumerate() {
        let end = stated.runs.get(k + 1).map_or(stated.face_ends.len(), |next| next.first_face);
        let material = &scene.materials[run.material];
        let is_textured = material.textures().next().is_some();
        let faces = triangles(stated, run.first_face..end, is_textured, repair);
        let too_many = || ReadError::unsupported(path, "more than 2^32 triangles, vertices or materials");
        let material = u32::try_from(run.material).map(MaterialId).map_err(|_| too_many())?;
        let name = String::from_utf8_lossy(run.name).into_owned();
        let mesh = mesh(name, material, &faces, stated).ok_or_else(too_many)?;
        let n_triangles = u32::try_from(faces.len()).map_err(|_| too_many())?;
        if n_triangles > 0 {
            shapes.place(mesh, first_primitive, scene).ok_or_else(too_many)?;
        }
        first_primitive = first_primitive.checked_add(n_triangles).ok_or_else(too_many)?;
    }
    Ok(())
}

/// The triangles of a range of faces that are kept. Corners forget what their material does not need.
fn triangles(stated: &Statements, faces: Range<usize>, is_textured: bool, repair: &mut Repair) -> Vec<[Corner; 3]> {
    let mut kept = Vec::with_capacity(faces.len());
    let (mut polygon, mut cuts) = (Vec::new(), Vec::new());
    for face in faces {
        let corners = stated.face(face);
        polygon.clear();
        polygon.extend(corners.iter().map(|corner| stated.positions[corner.position as usize]));
        cuts.clear();
        repair.n_tangled_faces += usize::from(polygon::triangulate(&polygon, &mut cuts) == polygon::Cut::Tangled);
        for &cut in &cuts {
            if repair.keeps(cut.map(|k| polygon[k])) {
                kept.push(cut.map(|k| if is_textured { corners[k] } else { Corner { uv: ABSENT, ..corners[k] } }));
            }
        }
    }
    kept
}

/// The mesh of these triangles, vertices numbered by first use; `None` for more vertices than 32 bits can number.
fn mesh(name: String, material: MaterialId, triangles: &[[Corner; 3]], stated: &Statements) -> Option<Mesh> {
    let mut mesh = Mesh { name, parts: vec![Part { first_triangle: 0, material }], ..Mesh::default() };
    mesh.triangles.reserve_exact(triangles.len());
    let mut vertices = Vec::new();
    let mut numbers = HashMap::new();
    for corners in triangles {
        let mut triangle = [0; 3];
        for (&corner, vertex) in corners.iter().zip(&mut triangle) {
            let next = u32::try_from(vertices.len()).ok()?;
            *vertex = *numbers.entry(corner).or_insert(next);
            if *vertex == next {
                vertices.push(corner);
            }
        }
        mesh.triangles.push(triangle);
    }
    mesh.positions = vertices.iter().map(|vertex| stated.positions[vertex.position as usize]).collect();
    if vertices.iter().any(|vertex| vertex.uv != ABSENT) {
        let uv = |vertex: &Corner| stated.uvs.get(vertex.uv as usize).map_or([0.0; 2], |&uv| usable_uv(uv));
        mesh.uvs = Some(vertices.iter().map(uv).collect());
    }
    if vertices.iter().any(|vertex| vertex.normal != ABSENT) {
        let normal = |vertex: &Corner| stated.normals.get(vertex.normal as usize).map_or([0.0; 3], |&n| unit_normal(n));
        mesh.normals = Some(vertices.iter().map(normal).collect());
    }
    Some(mesh)
}
