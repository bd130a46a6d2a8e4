//! The meshes of the chapters.

use anyhow::Result;
use canted_fixtures::{Mesh, object_views, scaffold_nodes, scaffold_of};

use crate::models::{self, Model};

/// A lattice of few triangles, for tests.
pub(super) const SMALL: &str = "small scaffold";

/// A mesh with its usual views.
pub(super) fn of_mesh(mesh: Mesh) -> Model {
    Model { views: object_views(&mesh), mesh, placed: None }
}

/// A scene by name; `None` for a real model that is not at hand.
pub(super) fn load(name: &str) -> Result<Option<Model>> {
    if name == SMALL { Ok(Some(of_mesh(scaffold_of(1, false, scaffold_nodes(10))))) } else { models::load(name) }
}
