use std::path::PathBuf;

use canted_obb::Aabb;

use crate::{Camera, Environment, Instance, Light, Material, Mesh, Texture};

/// A scene as plain arrays that refer to each other by index.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Triangle meshes, object space.
    pub meshes: Vec<Mesh>,
    /// Instances of meshes, in file order.
    pub instances: Vec<Instance>,
    /// Materials; at least one if the scene has a mesh.
    pub materials: Vec<Material>,
    /// Textures that materials use.
    pub textures: Vec<Texture>,
    /// Lights from the file.
    pub lights: Vec<Light>,
    /// Environment light; `None` if the file defines none.
    pub environment: Option<Environment>,
    /// Cameras in file order.
    pub cameras: Vec<Camera>,
    /// The name of each camera, else of its node; empty without a name.
    pub camera_names: Vec<String>,
    /// What the reader repaired or skipped, one sentence each, without repetition.
    pub warnings: Vec<String>,
    /// Files that the scene's file references and that were read: material libraries, buffers and images.
    pub files: Vec<PathBuf>,
}

impl Scene {
    /// Triangles of all meshes, each mesh counted once.
    #[must_use]
    pub fn n_unique_triangles(&self) -> usize {
        self.meshes.iter().map(|mesh| mesh.triangles.len()).sum()
    }

    /// Triangles of all instances.
    #[must_use]
    pub fn n_placed_triangles(&self) -> usize {
        self.instances.iter().map(|instance| self.meshes[instance.mesh.0 as usize].triangles.len()).sum()
    }

    /// Whether any instance moves, or any mesh deforms, while the shutter is open.
    #[must_use]
    pub fn has_motion(&self) -> bool {
        self.meshes.iter().any(|mesh| mesh.close.is_some()) || self.has_moving_instances()
    }

    fn has_moving_instances(&self) -> bool {
        self.instances.iter().any(|i| i.world_from_object_close.is_some_and(|close| close != i.world_from_object))
    }

    /// World-space bounds of all instances; what moves counts at shutter open and shutter close.
    #[must_use]
    pub fn bounds_world(&self) -> Aabb {
        // Transforms each vertex once rather than once per triangle.
        let used: Vec<Vec<[f32; 3]>> = self.meshes.iter().map(Mesh::used_positions).collect();
        let mut bounds = Aabb::EMPTY;
        for instance in &self.instances {
            for &position in &used[instance.mesh.0 as usize] {
                bounds.grow(instance.world_from_object.point(position));
                if let Some(close) = instance.world_from_object_close {
                    bounds.grow(close.point(position));
                }
            }
        }
        bounds
    }
}
