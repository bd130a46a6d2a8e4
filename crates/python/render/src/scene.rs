//! Meshes of arrays in a scene file of text.

use std::path::Path;

use canted_obb::Affine;
use canted_scene::{Instance, Material, MaterialId, Mesh, MeshId, Part, Scene, SceneFile};
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::error::invalid;

/// What errors call a scene that is no file. Paths in it are relative to the current folder.
const NAME: &str = "scene";

/// A mesh as `canted_render.scene` checked it: name, vertices, triangles, then normals, texture coordinates and colors of vertices.
#[derive(FromPyObject)]
pub(crate) struct MeshArrays<'py>(
    String,
    PyReadonlyArray2<'py, f32>,
    PyReadonlyArray2<'py, u32>,
    Option<PyReadonlyArray2<'py, f32>>,
    Option<PyReadonlyArray2<'py, f32>>,
    Option<PyReadonlyArray2<'py, f32>>,
);

/// The scene file with the meshes as the content of its assets.
pub(crate) fn file(text: &str, meshes: &[MeshArrays<'_>]) -> PyResult<SceneFile> {
    let mut file = SceneFile::parse(text.as_bytes(), Path::new(NAME)).map_err(invalid)?;
    for mesh in meshes {
        file = file.with_asset(&mesh.0, content(mesh)?);
    }
    Ok(file)
}

/// A mesh as a scene of its own.
fn content(MeshArrays(name, vertices, triangles, normals, uvs, colors): &MeshArrays<'_>) -> PyResult<Scene> {
    let optional = |array: &Option<PyReadonlyArray2<'_, f32>>| array.as_ref().map(rows).transpose();
    let mesh = Mesh {
        name: name.clone(),
        positions: rows(vertices)?,
        triangles: rows_of(triangles)?,
        normals: optional(normals)?,
        uvs: uvs.as_ref().map(rows_of).transpose()?,
        colors: colors.as_ref().map(rows_of).transpose()?,
        parts: vec![Part { first_triangle: 0, material: MaterialId(0) }],
        ..Mesh::default()
    };
    let n = mesh.positions.len();
    let all_in_range = mesh.triangles.iter().flatten().all(|&index| (index as usize) < n);
    let lengths =
        [mesh.normals.as_ref().map(Vec::len), mesh.uvs.as_ref().map(Vec::len), mesh.colors.as_ref().map(Vec::len)];
    if !all_in_range || lengths.into_iter().flatten().any(|length| length != n) {
        return Err(invalid(format!("mesh '{name}' has an index or a row that belongs to no vertex")));
    }
    let instance = Instance {
        mesh: MeshId(0),
        world_from_object: Affine::IDENTITY,
        world_from_object_close: None,
        first_primitive: 0,
    };
    let material = Material { name: name.clone(), ..Material::default() };
    Ok(Scene { meshes: vec![mesh], instances: vec![instance], materials: vec![material], ..Scene::default() })
}

fn rows(array: &PyReadonlyArray2<'_, f32>) -> PyResult<Vec<[f32; 3]>> {
    rows_of(array)
}

/// The rows of a contiguous array of `N` columns.
fn rows_of<T: numpy::Element + Copy, const N: usize>(array: &PyReadonlyArray2<'_, T>) -> PyResult<Vec<[T; N]>> {
    let is_fit = array.is_c_contiguous() && array.shape()[1] == N;
    let numbers = if is_fit { array.as_slice().ok() } else { None };
    let numbers = numbers.ok_or_else(|| invalid(format!("an array does not have {N} contiguous columns")))?;
    Ok(numbers.as_chunks().0.to_vec())
}
