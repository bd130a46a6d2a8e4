//! Real models, which not every machine has.

use std::path::PathBuf;

use canted_fixtures::skip;

/// The folder of models: `CANTED_SCENES`, else `../shared/scenes` beside the workspace; `None`, said aloud, where absent.
#[must_use]
pub fn models(test: &str) -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes");
    let folder = std::env::var_os("CANTED_SCENES").map_or_else(|| PathBuf::from(beside), PathBuf::from);
    if folder.is_dir() { Some(folder) } else { skip(test, format_args!("there is no folder {}", folder.display())) }
}
