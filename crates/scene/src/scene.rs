use std::path::PathBuf;

use canted_obb::Aabb;

use crate::{Camera, Environment, Instance, Light, Material, Mesh, Texture};

/// Everything a picture needs, as plain arrays that refer to each other by index.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Triangle meshes, object space.
    pub meshes: Vec<Mesh>,
    /// Placed meshes, in file order.
    pub instances: Vec<Instance>,
    /// Materials; a scene that has a mesh has one at least.
    pub materials: Vec<Material>,
    /// Textures that materials use.
    pub textures: Vec<Texture>,
    /// Lights that the file brings.
    pub lights: Vec<Light>,
    /// Radiance from outside; `None` where the file says nothing.
    pub environment: Option<Environment>,
    /// Cameras that the file brings, in file order.
    pub cameras: Vec<Camera>,
    /// What was repaired or left out while reading: one sentence each, said once by name.
    pub warnings: Vec<String>,
    /// Files that were read beside the scene's own because it names them: libraries of materials, buffers and images.
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

    /// Whether any instance moves while the shutter is open.
    #[must_use]
    pub fn has_motion(&self) -> bool {
        self.instances.iter().any(|i| i.world_from_object_close.is_some_and(|close| close != i.world_from_object))
    }

    /// Smallest world-space box around all used vertices of all instances, of moving ones at both ends of their way.
    #[must_use]
    pub fn bounds_world(&self) -> Aabb {
        // Triangles share vertices: each is placed once, not once a triangle.
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
