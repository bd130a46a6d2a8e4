//! The meshes and scenes of the chapters.

use anyhow::Result;
use canted_fixtures::{Mesh, object_views, scaffold_nodes, scaffold_of};
use canted_scene::{Light, Scene};

use crate::models::{self, Model};

/// A lattice of few triangles, for tests.
pub(super) const SMALL: &str = "small scaffold";

/// A mesh with its default views.
pub(super) fn of_mesh(mesh: Mesh) -> Model {
    Model { views: object_views(&mesh), mesh, placed: None }
}

/// A scene by name; `None` for a real model that is not available.
pub(super) fn load(name: &str) -> Result<Option<Model>> {
    if name == SMALL { Ok(Some(of_mesh(scaffold_of(1, false, scaffold_nodes(10))))) } else { models::load(name) }
}

/// Sponza with its textures, under a sky and a sun that shines into its court; `None` if the model is not available.
pub(super) fn lit_sponza() -> Result<Option<Scene>> {
    let scene = models::scene("sponza")?;
    Ok(scene.map(|scene| {
        let direction = [-0.282_166, -0.940_553, -0.188_111];
        let lights = vec![Light::Sun { direction, irradiance: [20.0, 19.0, 17.0] }];
        Scene { environment: Some([4.0, 5.0, 6.5].into()), lights, ..scene }
    }))
}
