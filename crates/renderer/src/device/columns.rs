//! The layout of a vertex.

use canted_scene::{Mesh, Scene};

/// Offsets of the attributes of a vertex, in words; 0 for an attribute that no vertex has. Positions come first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Columns {
    pub(super) stride: u32,
    pub(super) normal: u32,
    pub(super) tangent: u32,
    pub(super) color: u32,
    pub(super) uv: u32,
    pub(super) second_uv: u32,
}

impl Columns {
    /// The attributes that the meshes of `scene` have and its materials use.
    pub(super) fn of(scene: &Scene, has_textures: bool, has_normal_maps: bool) -> Self {
        let any = |has: fn(&Mesh) -> bool| scene.meshes.iter().any(has);
        let mut columns = Self { stride: 3, ..Self::default() };
        let mut add = |is_present: bool, n_words: u32| {
            let column = columns.stride;
            columns.stride += if is_present { n_words } else { 0 };
            if is_present { column } else { 0 }
        };
        let normal = add(any(|mesh| mesh.normals.is_some()), 3);
        let tangent = add(has_normal_maps && any(|mesh| mesh.tangents.is_some()), 4);
        let color = add(any(|mesh| mesh.colors.is_some()), 4);
        let uv = add(has_textures && any(|mesh| mesh.uvs.is_some()), 2);
        let second_uv = add(has_textures && any(|mesh| mesh.second_uvs.is_some()), 2);
        Self { normal, tangent, color, uv, second_uv, ..columns }
    }
}
