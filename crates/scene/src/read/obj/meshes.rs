//! Converts runs of faces to meshes: triangulates polygons, splits vertices by position, texture coordinate and normal, and turns exactly
//! translated copies into instances.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;
use std::path::Path;

use canted_obb::Affine;
use canted_obb::vector::{sub, to_f32, to_f64};

use super::{ABSENT, Corner, Statements};
use crate::read::ReadError;
use crate::read::mesh::{MeshChecks, unit_normal, usable_uv};
use crate::{Instance, MaterialId, Mesh, MeshId, Part, Scene};

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

/// The first mesh of each shape hash.
#[derive(Default)]
struct MeshDedup {
    first: HashMap<u64, MeshId>,
}

impl MeshDedup {
    /// Adds an instance to the scene, and the mesh unless it is an exact translation of the first mesh with its hash.
    ///
    /// `None` for more than 2^32 meshes.
    fn add(&mut self, mesh: Mesh, first_primitive: u32, scene: &mut Scene) -> Option<()> {
        let next = MeshId(u32::try_from(scene.meshes.len()).ok()?);
        let first = *self.first.entry(shape_hash(&mesh)).or_insert(next);
        let copied = scene.meshes.get(first.0 as usize).and_then(|original| translation(original, &mesh));
        let mut world_from_object = Affine::IDENTITY;
        let id = if let Some(translation) = copied {
            world_from_object.columns[3] = translation;
            first
        } else {
            scene.meshes.push(mesh);
            next
        };
        scene.instances.push(Instance { mesh: id, world_from_object, world_from_object_close: None, first_primitive });
        Some(())
    }
}

/// Vertices relative to the first one; equal for exactly translated meshes, as `f64` differences are exact there.
fn relative(mesh: &Mesh) -> impl Iterator<Item = [f64; 3]> {
    let first = to_f64(mesh.positions.first().copied().unwrap_or_default());
    mesh.positions.iter().map(move |&position| sub(to_f64(position), first))
}

/// A translation-invariant hash.
fn shape_hash(mesh: &Mesh) -> u64 {
    let mut hasher = DefaultHasher::new();
    mesh.triangles.hash(&mut hasher);
    for part in &mesh.parts {
        part.material.hash(&mut hasher);
    }
    for position in relative(mesh) {
        // -0.0 and 0.0 are equal and must have equal hashes.
        position.map(|x| (x + 0.0).to_bits()).hash(&mut hasher);
    }
    hasher.finish()
}

/// The exact `f32` translation from `original` to `copy`, if there is one.
fn translation(original: &Mesh, copy: &Mesh) -> Option<[f32; 3]> {
    let same_surface = original.triangles == copy.triangles
        && original.parts == copy.parts
        && original.normals == copy.normals
        && original.uvs == copy.uvs
        && original.colors == copy.colors;
    if !same_surface || !relative(original).eq(relative(copy)) {
        return None;
    }
    let mut pairs = original.positions.iter().zip(&copy.positions);
    let (&from, &to) = pairs.next()?;
    let moved = sub(to_f64(to), to_f64(from));
    let translation = to_f32(moved);
    let is_exact = to_f64(translation) == moved && pairs.all(|(&from, &to)| sub(to_f64(to), to_f64(from)) == moved);
    is_exact.then_some(translation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MaterialId, Part};

    fn triangle(positions: [[f32; 3]; 3], material: u32) -> Mesh {
        Mesh {
            positions: positions.to_vec(),
            triangles: vec![[0, 1, 2]],
            parts: vec![Part { first_triangle: 0, material: MaterialId(material) }],
            ..Mesh::default()
        }
    }

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[track_caller]
    fn adds(meshes: Vec<Mesh>, want: &[(u32, [f32; 3])]) {
        let (mut scene, mut dedup) = (Scene::default(), MeshDedup::default());
        for (k, mesh) in (0..).zip(meshes) {
            dedup.add(mesh, 10 * k, &mut scene).unwrap();
        }
        let got: Vec<_> = scene.instances.iter().map(|i| (i.mesh.0, i.world_from_object.columns[3])).collect();
        assert_eq!(got, want);
        assert!(scene.instances.iter().zip(0..).all(|(instance, k)| instance.first_primitive == 10 * k));
    }

    #[test]
    fn exact_copies_become_instances() {
        let moved = CORNERS.map(|[x, y, z]| [x + 3.0, y - 4.5, z - 0.0]);
        adds(vec![triangle(CORNERS, 0), triangle(moved, 0)], &[(0, [0.0; 3]), (0, [3.0, -4.5, 0.0])]);
    }

    #[test]
    fn other_shapes_materials_and_inexact_copies_stay_meshes() {
        let bent = [[3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [3.0, 1.0, 1e-6]];
        adds(vec![triangle(CORNERS, 0), triangle(CORNERS, 1)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
        adds(vec![triangle(CORNERS, 0), triangle(bent, 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
        // The translation 2^25 + 1 is not representable in `f32`.
        let (far, farther) = (-1.0, 33_554_432.0);
        let at = |x: f32| [[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
        adds(vec![triangle(at(far), 0), triangle(at(farther), 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
    }

    #[test]
    fn copies_that_lose_detail_by_rounding_stay_meshes() {
        // All differences to the far triangle round to the same number, but only one triangle has an area.
        let near = [[1e-10, 0.0, 0.0], [2e-10, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let far = [[1e10, 0.0, 0.0], [1e10, 0.0, 0.0], [1e10, 1.0, 0.0]];
        adds(vec![triangle(near, 0), triangle(far, 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
    }

    #[test]
    fn negative_zero_equals_zero() {
        let mut negative = CORNERS;
        negative[0] = [-0.0, 0.0, -0.0];
        adds(vec![triangle(CORNERS, 0), triangle(negative, 0)], &[(0, [0.0; 3]), (0, [0.0; 3])]);
    }
}
