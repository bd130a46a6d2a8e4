//! Real models, which are optional.

use std::path::PathBuf;

use canted_fixtures::skip;

/// The folder of models: `CANTED_SCENES`, else `../shared/scenes` next to the workspace; `None`, with a message, if absent.
#[must_use]
pub fn models(test: &str) -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes");
    let folder = std::env::var_os("CANTED_SCENES").map_or_else(|| PathBuf::from(default), PathBuf::from);
    if folder.is_dir() { Some(folder) } else { skip(test, format_args!("no folder {}", folder.display())) }
}
