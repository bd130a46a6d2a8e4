//! Meshes: joins primitives, one part each.

use std::ops::Range;

use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;

use super::document::Document;
use super::pose::Pose;
use super::primitive::{PrimitiveMesh, PrimitiveReader};
use crate::read::ReadError;
use crate::read::mesh_checks::MeshChecks;
use crate::{Material, MaterialId, Mesh, Part};

/// A mesh with its checks and warnings.
#[derive(Default)]
pub(super) struct Read {
    pub(super) mesh: Mesh,
    pub(super) checks: MeshChecks,
    pub(super) warnings: Vec<String>,
}

/// Reads mesh `index` in a pose; primitives without triangles add no part.
///
/// The last of `materials` is the default material, if a primitive uses it.
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
        let location = format!("mesh {index} primitive {k}");
        let material = match primitive.material {
            Some(material) => {
                document.get(&document.root.materials, material.value(), "material", &location)?;
                material.value()
            }
            None => document.root.materials.len(),
        };
        let reader = PrimitiveReader {
            document,
            pose,
            material: &materials[material],
            mesh: index,
            number: k,
            location: &location,
        };
        let primitive_mesh = reader.read(primitive, &mut read.checks, &mut read.warnings)?;
        join(&mut read.mesh, primitive_mesh, material)
            .ok_or_else(|| document.malformed(location, "more than 2^32 vertices or triangles in a mesh"))?;
    }
    Ok(read)
}

/// Number of vertices and indices of mesh `index` without a buffer view.
pub(super) fn n_virtual_elements(document: &Document<'_>, index: usize) -> usize {
    let n_virtual_elements = |accessor: usize| {
        let accessor = document.root.accessors.get(accessor).filter(|accessor| accessor.buffer_view.is_none());
        accessor.map_or(0, |accessor| usize::try_from(accessor.count.0).unwrap_or(usize::MAX))
    };
    let read = document.root.meshes[index].primitives.iter().flat_map(|primitive| {
        let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
        [positions, primitive.indices.as_ref()].into_iter().flatten()
    });
    read.map(|accessor| n_virtual_elements(accessor.value())).fold(0, usize::saturating_add)
}

/// Appends a primitive; `None` for more than 2^32 vertices or triangles.
///
/// If only some primitives have an attribute, the others get zeros, or white for colors.
fn join(mesh: &mut Mesh, primitive_mesh: PrimitiveMesh, material: usize) -> Option<()> {
    if primitive_mesh.triangles.is_empty() {
        return Some(());
    }
    let first_triangle = u32::try_from(mesh.triangles.len()).ok()?;
    let (before, after) = (mesh.positions.len(), mesh.positions.len() + primitive_mesh.positions.len());
    let first_vertex = u32::try_from(before).ok().filter(|_| u32::try_from(after).is_ok())?;
    mesh.parts.push(Part { first_triangle, material: MaterialId(u32::try_from(material).ok()?) });
    append(&mut mesh.positions, primitive_mesh.positions);
    let mut triangles = primitive_mesh.triangles;
    triangles.as_flattened_mut().iter_mut().for_each(|corner| *corner += first_vertex);
    append(&mut mesh.triangles, triangles);
    let vertices = before..after;
    extend(&mut mesh.normals, primitive_mesh.normals, &vertices, [0.0; 3]);
    extend(&mut mesh.tangents, primitive_mesh.tangents, &vertices, [0.0; 4]);
    extend(&mut mesh.uvs, primitive_mesh.uvs, &vertices, [0.0; 2]);
    extend(&mut mesh.second_uvs, primitive_mesh.second_uvs, &vertices, [0.0; 2]);
    extend(&mut mesh.colors, primitive_mesh.colors, &vertices, [1.0; 4]);
    Some(())
}

/// Appends a list, without a copy if `list` is empty: most meshes have one primitive.
fn append<T>(list: &mut Vec<T>, mut values: Vec<T>) {
    if list.is_empty() { *list = values } else { list.append(&mut values) }
}

/// Appends an optional attribute; the list exists once any primitive has values.
fn extend<T: Copy>(list: &mut Option<Vec<T>>, values: Option<Vec<T>>, vertices: &Range<usize>, missing: T) {
    if list.is_none() && values.is_none() {
        return;
    }
    let list = list.get_or_insert_with(|| vec![missing; vertices.start]);
    append(list, values.unwrap_or_default());
    list.resize(vertices.end, missing);
}
