//! What both readers find in a file, in a common form.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use tobj::{LoadError, LoadOptions};

use crate::Scene;
use crate::read::obj::statements::{self, ABSENT, Statements};
use crate::read::{obj, text};

/// A corner: the bits of position, texture coordinate and normal.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Corner {
    position: [u32; 3],
    uv: Option<[u32; 2]>,
    normal: Option<[u32; 3]>,
}

/// A face of at least three corners.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Face {
    group: String,
    /// `None` also for names that no library has.
    material: Option<String>,
    corners: Vec<Corner>,
}

/// How the readings of a file compare.
#[derive(Debug, PartialEq)]
pub(super) enum Outcome {
    Same,
    Differ(String),
    /// `tobj` panicked.
    Panicked,
}

/// Compares both readings of a file.
pub(super) fn compare(path: &Path, bytes: &[u8]) -> Outcome {
    let Ok(theirs) = catch_unwind(AssertUnwindSafe(|| theirs(path, bytes))) else { return Outcome::Panicked };
    let difference = match (ours(path, bytes), theirs) {
        (Ok(ours), Ok(theirs)) => first_difference(&ours, &theirs),
        (Err(_), Err(_)) => None,
        (Ok(_), Err(error)) => Some(format!("tobj rejects the file: {error}")),
        (Err(error), Ok(_)) => Some(format!("ours rejects the file: {error}")),
    };
    difference.map_or(Outcome::Same, Outcome::Differ)
}

/// The first difference of two readings.
pub(super) fn first_difference(ours: &[Face], theirs: &[Face]) -> Option<String> {
    if let Some((k, (a, b))) = ours.iter().zip(theirs).enumerate().find(|(_, (a, b))| a != b) {
        return Some(format!("face {k}: ours {a:?}, tobj {b:?}"));
    }
    (ours.len() != theirs.len()).then(|| format!("ours has {} faces, tobj {}", ours.len(), theirs.len()))
}

/// Our reading. Also checks that the scene has the triangles of these faces.
pub(super) fn ours(path: &Path, bytes: &[u8]) -> Result<Vec<Face>, String> {
    let statements = statements::parse(path, bytes).map_err(|error| error.to_string())?;
    check_triangles(path, bytes, &statements);
    let mut scene = Scene::default();
    obj::materials::materials(path, &statements.libraries, &statements.materials, &mut scene)
        .map_err(|error| error.to_string())?;
    let is_known = |name: &[u8]| {
        let not_found = format!("material {} not found", text::quoted(name));
        !scene.warnings.iter().any(|warning| warning.starts_with(&not_found))
    };
    let mut faces = Vec::new();
    for (k, run) in statements.runs.iter().enumerate() {
        let end = statements.runs.get(k + 1).map_or(statements.face_ends.len(), |next| next.first_face);
        let name = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let material = statements.materials[run.material].filter(|name| is_known(name)).map(name);
        faces.extend((run.first_face..end).map(|face| Face {
            group: name(run.name),
            material: material.clone(),
            corners: statements.face(face).iter().map(|corner| our_corner(&statements, corner)).collect(),
        }));
    }
    Ok(faces)
}

/// Checks that the scene has the triangles of these faces.
fn check_triangles(path: &Path, bytes: &[u8], statements: &Statements) {
    if !statements.positions.as_flattened().iter().all(|x| x.is_finite()) {
        return;
    }
    match obj::parse(path, bytes) {
        Ok(scene) => {
            let n_triangles: usize = (0..statements.face_ends.len()).map(|face| statements.face(face).len() - 2).sum();
            assert_eq!(scene.n_placed_triangles(), n_triangles, "{:?}", scene.warnings);
        }
        Err(error) => assert!(error.to_string().contains("nothing to draw"), "{error}"),
    }
}

fn our_corner(statements: &Statements, corner: &statements::Corner) -> Corner {
    let some = |index: u32| (index != ABSENT).then_some(index as usize);
    Corner {
        position: statements.positions[corner.position as usize].map(f32::to_bits),
        uv: some(corner.uv).map(|k| statements.uvs[k].map(f32::to_bits)),
        normal: some(corner.normal).map(|k| statements.normals[k].map(f32::to_bits)),
    }
}

/// The reading of `tobj`, with libraries of the file's folder.
fn theirs(path: &Path, bytes: &[u8]) -> Result<Vec<Face>, LoadError> {
    let options = LoadOptions { ignore_points: true, ignore_lines: true, ..LoadOptions::default() };
    let library = |name: &Path| tobj::load_mtl(path.parent().unwrap_or(Path::new("")).join(name));
    let (models, materials) = tobj::load_obj_buf(&mut &*bytes, &options, library)?;
    let materials = materials.unwrap_or_default();
    let mut faces = Vec::new();
    for model in &models {
        let mesh = &model.mesh;
        let group = if model.name == "unnamed_object" { String::new() } else { model.name.clone() };
        let material = mesh.material_id.map(|id| materials[id].name.clone());
        let triangles = vec![3; mesh.indices.len() / 3];
        let mut next = 0;
        for &n_corners in if mesh.face_arities.is_empty() { &triangles } else { &mesh.face_arities } {
            let corners: Vec<Corner> = (next..next + n_corners as usize).map(|at| their_corner(mesh, at)).collect();
            next += n_corners as usize;
            if corners.len() >= 3 {
                faces.push(Face { group: group.clone(), material: material.clone(), corners });
            }
        }
    }
    Ok(faces)
}

fn their_corner(mesh: &tobj::Mesh, at: usize) -> Corner {
    let part = |numbers: &[f32], indices: &[u32], k: usize, n: usize| numbers[indices[at] as usize * n + k].to_bits();
    let uvs = (!mesh.texcoord_indices.is_empty())
        .then(|| [0, 1].map(|k| part(&mesh.texcoords, &mesh.texcoord_indices, k, 2)));
    let normals =
        (!mesh.normal_indices.is_empty()).then(|| [0, 1, 2].map(|k| part(&mesh.normals, &mesh.normal_indices, k, 3)));
    Corner { position: [0, 1, 2].map(|k| part(&mesh.positions, &mesh.indices, k, 3)), uv: uvs, normal: normals }
}
