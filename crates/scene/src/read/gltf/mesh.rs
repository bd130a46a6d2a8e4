//! A glTF mesh: all its primitives joined, one part each.

use std::ops::Range;

use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;

use super::document::Document;
use super::pose::Pose;
use super::primitive::{Patch, Reading};
use crate::read::ReadError;
use crate::read::repair::Repair;
use crate::{Material, MaterialId, Mesh, Part};

/// A mesh, and what was met while reading it.
#[derive(Default)]
pub(super) struct Read {
    pub(super) mesh: Mesh,
    pub(super) repair: Repair,
    pub(super) warnings: Vec<String>,
}

/// Reads mesh `index` of the file in a pose; primitives without triangles leave no part.
///
/// The last material is the default one, where a primitive needs it.
pub(super) fn read(
    document: &Document<'_>,
    index: usize,
    pose: &Pose<'_>,
    materials: &[Material],
) -> Result<Read, ReadError> {
    let source = &document.root.meshes[index];
    let mut read = Read::default();
    read.mesh.name = source.name.clone().unwrap_or_else(|| format!("mesh {index}"));
    for (k, primitive) in source.primitives.iter().enumerate() {
        let place = format!("mesh {index} primitive {k}");
        let material = match primitive.material {
            Some(material) => {
                document.get(&document.root.materials, material.value(), "material", &place)?;
                material.value()
            }
            None => document.root.materials.len(),
        };
        let reading = Reading { document, pose, material: &materials[material], place: &place };
        let patch = reading.read(primitive, &mut read.repair, &mut read.warnings)?;
        join(&mut read.mesh, patch, material)
            .ok_or_else(|| document.malformed(place, "takes its mesh beyond what 32 bits count"))?;
    }
    Ok(read)
}

/// Vertices and indices of mesh `index` that no bytes stand for.
pub(super) fn n_zeros(document: &Document<'_>, index: usize) -> usize {
    let n_zeros = |accessor: usize| {
        let accessor = document.root.accessors.get(accessor).filter(|accessor| accessor.buffer_view.is_none());
        accessor.map_or(0, |accessor| usize::try_from(accessor.count.0).unwrap_or(usize::MAX))
    };
    let read = document.root.meshes[index].primitives.iter().flat_map(|primitive| {
        let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
        [positions, primitive.indices.as_ref()].into_iter().flatten()
    });
    read.map(|accessor| n_zeros(accessor.value())).fold(0, usize::saturating_add)
}

/// Appends a patch; `None` where numbers exceed 32 bits.
///
/// Where only some patches have an attribute, the others get zeros, and white for colours.
fn join(mesh: &mut Mesh, patch: Patch, material: usize) -> Option<()> {
    if patch.triangles.is_empty() {
        return Some(());
    }
    let first_triangle = u32::try_from(mesh.triangles.len()).ok()?;
    let (before, after) = (mesh.positions.len(), mesh.positions.len() + patch.positions.len());
    let first_vertex = u32::try_from(before).ok().filter(|_| u32::try_from(after).is_ok())?;
    mesh.parts.push(Part { first_triangle, material: MaterialId(u32::try_from(material).ok()?) });
    append(&mut mesh.positions, patch.positions);
    let mut triangles = patch.triangles;
    triangles.as_flattened_mut().iter_mut().for_each(|corner| *corner += first_vertex);
    append(&mut mesh.triangles, triangles);
    let vertices = before..after;
    extend(&mut mesh.normals, patch.normals, &vertices, [0.0; 3]);
    extend(&mut mesh.tangents, patch.tangents, &vertices, [0.0; 4]);
    extend(&mut mesh.uvs, patch.uvs, &vertices, [0.0; 2]);
    extend(&mut mesh.second_uvs, patch.second_uvs, &vertices, [0.0; 2]);
    extend(&mut mesh.colors, patch.colors, &vertices, [1.0; 4]);
    Some(())
}

/// Appends a list; to an empty one without a copy, as most meshes have one primitive.
fn append<T>(list: &mut Vec<T>, mut values: Vec<T>) {
    if list.is_empty() { *list = values } else { list.append(&mut values) }
}

/// Appends values for some vertices to a list that exists once any patch has values.
fn extend<T: Copy>(list: &mut Option<Vec<T>>, values: Option<Vec<T>>, vertices: &Range<usize>, missing: T) {
    if list.is_none() && values.is_none() {
        return;
    }
    let list = list.get_or_insert_with(|| vec![missing; vertices.start]);
    append(list, values.unwrap_or_default());
    list.resize(vertices.end, missing);
}
