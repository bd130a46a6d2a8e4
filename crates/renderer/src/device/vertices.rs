//! Packs the attributes of vertices.

use bytemuck::{Pod, Zeroable};
use canted_gpu::MAX_COORDINATE;
use canted_scene::Mesh;
use glam::DVec3;

use super::materials::Columns;
use crate::surface::Pose;
use crate::{narrow, wide};

/// `Triangle` of `shared/surface/mesh`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct PackedTriangle {
    pub(super) vertices: [u32; 3],
    pub(super) material: u32,
    pub(super) normal: [f32; 3],
    pub(super) area_root: f32,
}

/// Writes an attribute of all vertices.
pub(super) fn put<const N: usize>(words: &mut [f32], stride: usize, column: u32, values: &[[f32; N]]) {
    let column = column as usize;
    for (vertex, value) in words.chunks_exact_mut(stride).zip(values) {
        vertex[column..column + N].copy_from_slice(&value.map(tame));
    }
}

/// Clamps a number so that kernels do not overflow. Positions need no clamping, because scenes beyond the limit are rejected.
fn tame(x: f32) -> f32 {
    // NaN becomes zero.
    if x.abs() <= MAX_COORDINATE {
        x
    } else if x.is_nan() {
        0.0
    } else {
        MAX_COORDINATE.copysign(x)
    }
}

/// Writes normals, tangents, colors and texture coordinates of the mesh, or their defaults.
pub(super) fn put_attributes(words: &mut [f32], mesh: &Mesh, columns: &Columns, pose: &Pose) {
    let stride = columns.stride as usize;
    if let Some(normals) = mesh.normals.as_ref().filter(|_| columns.normal > 0) {
        let cofactors = in_range(pose.cofactor);
        let image = |n: &[f32; 3]| narrow(by_columns(&cofactors, wide(*n)));
        put(words, stride, columns.normal, &normals.iter().map(image).collect::<Vec<_>>());
    }
    if let Some(tangents) = mesh.tangents.as_ref().filter(|_| columns.tangent > 0) {
        let [x, y, z, _] = pose.columns;
        let linear = in_range([x, y, z]);
        let image = |&[x, y, z, sign]: &[f32; 4]| {
            let [x, y, z] = narrow(by_columns(&linear, wide([x, y, z])));
            [x, y, z, sign]
        };
        put(words, stride, columns.tangent, &tangents.iter().map(image).collect::<Vec<_>>());
    }
    if columns.color > 0 {
        let white = || vec![[1.0; 4]; mesh.positions.len()];
        let mut colors = mesh.colors.clone().unwrap_or_else(white);
        if mesh.curves.is_some() {
            // The alpha of points of curves has no meaning.
            colors.iter_mut().for_each(|color| color[3] = 1.0);
        }
        put(words, stride, columns.color, &colors);
    }
    for (column, uvs) in [(columns.uv, &mesh.uvs), (columns.second_uv, &mesh.second_uvs)] {
        if let Some(uvs) = uvs.as_ref().filter(|_| column > 0) {
            // Beyond 2^23 texture coordinates have no fraction.
            let bounded: Vec<_> = uvs.iter().map(|uv| uv.map(|x| tame(x).clamp(-8_388_608.0, 8_388_608.0))).collect();
            put(words, stride, column, &bounded);
        }
    }
}

fn by_columns([a, b, c]: &[DVec3; 3], DVec3 { x, y, z }: DVec3) -> DVec3 {
    *a * x + *b * y + *c * z
}

/// The columns scaled so that their lengths are about 1.
pub(super) fn in_range(columns: [DVec3; 3]) -> [DVec3; 3] {
    columns.map(|column| column * (1.0 / length_of(columns)))
}

/// The Frobenius norm.
pub(super) fn length_of(columns: [DVec3; 3]) -> f64 {
    DVec3::from(columns.map(DVec3::length)).length()
}
