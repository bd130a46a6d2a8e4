//! Whether the workspace could be published: every package builds from what `cargo publish` would upload.

use anyhow::Result;

use crate::command::{self, cargo};

/// Packages and builds all crates without uploading; whether all is well.
///
/// `None` where the registry cannot be reached, which says nothing about the packages.
pub(crate) fn dry_run() -> Result<Option<bool>> {
    let mut command = cargo(&["publish", "--workspace", "--dry-run", "--allow-dirty"]);
    // What is built is thrown away.
    let (is_well, errors) = command::with_errors(command.env("CARGO_PROFILE_DEV_DEBUG", "none"))?;
    let offline = ["failed to download", "Could not resolve host", "download of config.json failed", "network"];
    if !is_well && offline.iter().any(|words| errors.contains(words)) {
        return Ok(None);
    }
    Ok(Some(is_well))
}
