//! Converts runs of faces to meshes: triangulates polygons, splits vertices by position, texture coordinate and normal.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use super::dedup::MeshDedup;
use super::statements::{ABSENT, Corner, Statements};
use crate::read::ReadError;
use crate::read::mesh_checks::{MeshChecks, unit_normal, usable_uv};
use crate::{MaterialId, Mesh, Part, Scene};

/// Adds an instance for each nonempty run, with a new mesh unless an equal one exists.
pub(super) fn meshes(
    path: &Path,
    statements: &Statements,
    colors: Option<&[[f32; 4]]>,
    scene: &mut Scene,
    checks: &mut MeshChecks,
) -> Result<(), ReadError> {
    let mut dedup = MeshDedup::default();
    let mut first_primitive = 0_u32;
    for (k, run) in statements.runs.iter().enumerate() {
        let end = statements.runs.get(k + 1).map_or(statements.face_ends.len(), |next| next.first_face);
        let material = &scene.materials[run.material];
        let is_textured = material.textures().next().is_some();
        let faces = triangles(statements, run.first_face..end, is_textured, checks);
        let too_many = || ReadError::unsupported(path, "more than 2^32 triangles, vertices or materials");
        let material = u32::try_from(run.material).map(MaterialId).map_err(|_| too_many())?;
        let name = String::from_utf8_lossy(run.name).into_owned();
        let mesh = mesh(name, material, &faces, statements, colors).ok_or_else(too_many)?;
        let n_triangles = u32::try_from(faces.len()).map_err(|_| too_many())?;
        if n_triangles > 0 {
            dedup.add(mesh, first_primitive, scene).ok_or_else(too_many)?;
        }
        first_primitive = first_primitive.checked_add(n_triangles).ok_or_else(too_many)?;
    }
    Ok(())
}

/// Triangles of a range of faces. Texture coordinates are dropped if the material has no texture.
fn triangles(
    statements: &Statements,
    faces: Range<usize>,
    is_textured: bool,
    checks: &mut MeshChecks,
) -> Vec<[Corner; 3]> {
    let mut kept = Vec::with_capacity(faces.len());
    let (mut polygon, mut cuts) = (Vec::new(), Vec::new());
    for face in faces {
        let corners = statements.face(face);
        polygon.clear();
        polygon.extend(corners.iter().map(|corner| statements.positions[corner.position as usize]));
        checks.triangulate(&polygon, &mut cuts);
        let corner = |k: usize| if is_textured { corners[k] } else { Corner { uv: ABSENT, ..corners[k] } };
        kept.extend(cuts.iter().map(|cut| cut.map(corner)));
    }
    kept
}

/// The mesh of these triangles, with vertices numbered by first use; `None` for more than 2^32 vertices.
fn mesh(
    name: String,
    material: MaterialId,
    triangles: &[[Corner; 3]],
    statements: &Statements,
    colors: Option<&[[f32; 4]]>,
) -> Option<Mesh> {
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
    mesh.positions = vertices.iter().map(|vertex| statements.positions[vertex.position as usize]).collect();
    if vertices.iter().any(|vertex| vertex.uv != ABSENT) {
        let uv = |vertex: &Corner| statements.uvs.get(vertex.uv as usize).map_or([0.0; 2], |&uv| usable_uv(uv));
        mesh.uvs = Some(vertices.iter().map(uv).collect());
    }
    if vertices.iter().any(|vertex| vertex.normal != ABSENT) {
        let normal =
            |vertex: &Corner| statements.normals.get(vertex.normal as usize).map_or([0.0; 3], |&n| unit_normal(n));
        mesh.normals = Some(vertices.iter().map(normal).collect());
    }
    // White changes nothing.
    let colors = colors.map(|all| vertices.iter().map(|vertex| all[vertex.position as usize]).collect::<Vec<_>>());
    mesh.colors = colors.filter(|colors| colors.iter().any(|&color| color != [1.0; 4]));
    Some(mesh)
}
