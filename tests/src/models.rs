//! Real models, which not every machine has.

use std::path::PathBuf;

/// The folder of models: `CANTED_SCENES`, else `../shared/scenes` beside the workspace; `None`, said aloud, where absent.
#[must_use]
#[expect(clippy::print_stderr, reason = "a skipped test says so")]
pub fn models(test: &str) -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes");
    let folder = std::env::var_os("CANTED_SCENES").map_or_else(|| PathBuf::from(beside), PathBuf::from);
    if !folder.is_dir() {
        eprintln!("{test}: skipped, there is no folder {}", folder.display());
        return None;
    }
    Some(folder)
}
