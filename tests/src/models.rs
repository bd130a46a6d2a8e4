//! Real models, which are optional.

use std::path::PathBuf;

use canted_fixtures::skip;

/// The folder of models: `CANTED_SCENES`, else `../shared/scenes` next to the workspace.
#[must_use]
pub fn folder() -> PathBuf {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes");
    std::env::var_os("CANTED_SCENES").map_or_else(|| PathBuf::from(default), PathBuf::from)
}

/// Why there are no models; `None` if there are.
#[must_use]
pub fn missing() -> Option<String> {
    let folder = folder();
    (!folder.is_dir()).then(|| format!("no folder {}", folder.display()))
}

/// The folder of models; `None`, with a message, if absent.
#[must_use]
pub fn models(test: &str) -> Option<PathBuf> {
    missing().map_or_else(|| Some(folder()), |reason| skip(test, reason))
}
