use std::mem::size_of_val;

use crate::Scene;

/// Element counts and memory use of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneStats {
    /// Number of meshes.
    pub n_meshes: usize,
    /// Number of instances.
    pub n_instances: usize,
    /// Vertices of all meshes, each mesh counted once. A position with two normals counts as two vertices.
    pub n_vertices: usize,
    /// Triangles of all meshes, each mesh counted once.
    pub n_unique_triangles: usize,
    /// Triangles of all instances.
    pub n_placed_triangles: usize,
    /// Number of materials.
    pub n_materials: usize,
    /// Number of textures.
    pub n_textures: usize,
    /// Number of [`Scene::lights`]; emissive surfaces are not included.
    pub n_lights: usize,
    /// Number of cameras.
    pub n_cameras: usize,
    /// Memory of vertices, indices and instances in bytes.
    pub geometry_bytes: usize,
    /// Memory of the decoded texels in bytes.
    pub texture_bytes: usize,
}

impl SceneStats {
    /// Counts the elements of `scene`.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let mesh_bytes = |mesh: &crate::Mesh| {
            size_of_val(&mesh.positions[..])
                + size_of_val(&mesh.triangles[..])
                + mesh.normals.as_ref().map_or(0, |normals| size_of_val(&normals[..]))
                + mesh.tangents.as_ref().map_or(0, |tangents| size_of_val(&tangents[..]))
                + mesh.uvs.as_ref().map_or(0, |uvs| size_of_val(&uvs[..]))
                + mesh.second_uvs.as_ref().map_or(0, |uvs| size_of_val(&uvs[..]))
                + mesh.colors.as_ref().map_or(0, |colors| size_of_val(&colors[..]))
        };
        Self {
            n_meshes: scene.meshes.len(),
            n_instances: scene.instances.len(),
            n_vertices: scene.meshes.iter().map(|mesh| mesh.positions.len()).sum(),
            n_unique_triangles: scene.n_unique_triangles(),
            n_placed_triangles: scene.n_placed_triangles(),
            n_materials: scene.materials.len(),
            n_textures: scene.textures.len(),
            n_lights: scene.lights.len(),
            n_cameras: scene.cameras.len(),
            geometry_bytes: scene.meshes.iter().map(mesh_bytes).sum::<usize>() + size_of_val(&scene.instances[..]),
            texture_bytes: scene.textures.iter().map(|texture| size_of_val(&texture.texels[..])).sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Encoding, Instance, Material, Mesh, MeshId, Texture, Wrap};
    use canted_obb::Affine;

    #[test]
    fn counts_each_mesh_once_and_every_instance() {
        let mesh = Mesh {
            positions: vec![[0.0; 3]; 3],
            triangles: vec![[0, 1, 2]; 2],
            uvs: Some(vec![[0.0; 2]; 3]),
            ..Mesh::default()
        };
        let instance = Instance {
            mesh: MeshId(0),
            world_from_object: Affine::IDENTITY,
            world_from_object_close: None,
            first_primitive: 0,
        };
        let texture = Texture {
            name: String::new(),
            width: 2,
            height: 1,
            texels: vec![[0; 4]; 2],
            encoding: Encoding::Srgb,
            wrap: [Wrap::Repeat; 2],
            magnification: crate::Magnification::Linear,
        };
        let scene = Scene {
            meshes: vec![mesh],
            instances: vec![instance; 3],
            materials: vec![Material::default()],
            textures: vec![texture],
            ..Scene::default()
        };
        let want = SceneStats {
            n_meshes: 1,
            n_instances: 3,
            n_vertices: 3,
            n_unique_triangles: 2,
            n_placed_triangles: 6,
            n_materials: 1,
            n_textures: 1,
            n_lights: 0,
            n_cameras: 0,
            geometry_bytes: 3 * 12 + 2 * 12 + 3 * 8 + 3 * size_of::<Instance>(),
            texture_bytes: 8,
        };
        assert_eq!(SceneStats::of(&scene), want);
    }
}
