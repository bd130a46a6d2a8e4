//! Scenes that change: vertices of a mesh, transforms of instances.
//!
//! Reads: new vertices or transforms. Writes: a scene that is committed again.
//! Holds: as in `scene`; a change takes the scene exclusively, so no ray is traced meanwhile.
//! Source: Embree API reference, `rtcore_geometry.h`.
#![expect(unsafe_code, reason = "the C interface; every block states why it is sound")]

use super::scene::{BUFFER_VERTEX, FORMAT_FLOAT3X4_COLUMN_MAJOR};
use super::{Library, Mesh, Options, Placement, Quality, Scene, SceneError};

/// What Embree does with a mesh whose vertices have moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Update {
    /// `RTC_BUILD_QUALITY_REFIT`.
    Refit,
    /// `RTC_BUILD_QUALITY_LOW`.
    Rebuild,
}

/// A mesh in a dynamic scene.
pub struct MovingMesh(Scene);

impl MovingMesh {
    /// Builds the mesh.
    ///
    /// # Errors If Embree reports an error.
    pub fn new(library: &Library, mesh: &Mesh<'_>, n_threads: usize, update: Update) -> Result<Self, SceneError> {
        let quality = match update {
            Update::Refit => Quality::Refit,
            Update::Rebuild => Quality::Low,
        };
        Ok(Self(Scene::of_mesh(library, mesh, &Options { quality, is_robust: false, n_threads })?))
    }

    /// The scene, for rays.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.0
    }

    /// Moves the vertices and updates the scene.
    ///
    /// # Errors If Embree reports an error.
    ///
    /// # Panics If the number of vertices has changed.
    pub fn update(&mut self, positions: &[[f32; 3]]) -> Result<(), SceneError> {
        let new = positions.as_flattened();
        let old = &mut self.0.buffers[0].positions;
        // One float of padding follows.
        assert_eq!(new.len() + 1, old.len(), "the vertices of the same mesh");
        old[..new.len()].copy_from_slice(new);
        let f = &self.0.device.library.functions;
        // SAFETY: the scene holds geometry 0, the mesh, whose buffer was changed in place.
        unsafe {
            let geometry = (f.get_geometry)(self.0.scenes[0], 0);
            (f.update_buffer)(geometry, BUFFER_VERTEX, 0);
            (f.commit_geometry)(geometry);
        }
        self.0.commit(0)
    }
}

/// Instances in a scene of Embree's default quality.
pub struct MovingInstances(Scene);

impl MovingInstances {
    /// Builds the meshes, and a level of instances above.
    ///
    /// # Errors If Embree reports an error.
    pub fn new(
        library: &Library,
        meshes: &[Mesh<'_>],
        placements: &[Placement],
        n_threads: usize,
    ) -> Result<Self, SceneError> {
        let options = Options { quality: Quality::Low, is_robust: false, n_threads };
        Ok(Self(Scene::of_instances(library, meshes, placements, &options)?))
    }

    /// Moves every instance and updates the scene.
    ///
    /// # Errors If Embree reports an error.
    pub fn update(&mut self, transforms: &[[[f32; 3]; 4]]) -> Result<(), SceneError> {
        let f = &self.0.device.library.functions;
        for (id, matrix) in (0u32..).zip(transforms) {
            // SAFETY: instances were attached in this order, so the scene holds this geometry; the matrix is copied.
            unsafe {
                let geometry = (f.get_geometry)(self.0.scenes[0], id);
                (f.set_transform)(geometry, 0, FORMAT_FLOAT3X4_COLUMN_MAJOR, (&raw const *matrix).cast());
                (f.commit_geometry)(geometry);
            }
        }
        self.0.commit(0)
    }
}
