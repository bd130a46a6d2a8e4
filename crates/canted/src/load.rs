//! Scenes from files, or the built-in one.

use std::path::Path;

use anyhow::{Result, anyhow};
use canted_scene::Scene;

use crate::output;

/// Reads a scene, or makes the built-in one; warnings go to standard error, each once.
pub(crate) fn scene(path: Option<&Path>) -> Result<Scene> {
    let Some(path) = path else { return Ok(canted_scene::builtin()) };
    let scene = canted_scene::read(path).map_err(|error| anyhow!("{error}"))?;
    for warning in &scene.warnings {
        output::to_stderr(&format!("warning: {warning}"));
    }
    Ok(scene)
}

/// The scene's name in messages.
pub(crate) fn name(path: Option<&Path>) -> String {
    path.map_or_else(|| "built-in scene".to_owned(), |path| path.display().to_string())
}
