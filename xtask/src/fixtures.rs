//! `cargo xtask fixtures`: writes the procedural scenes as files.

use std::path::Path;

use anyhow::{Context, Result};

use crate::command;

/// Writes every procedural scene into `dir` and prints the paths.
pub(crate) fn run(dir: &Path) -> Result<bool> {
    let paths = canted_fixtures::write_all(dir).with_context(|| format!("cannot write into {}", dir.display()))?;
    for path in paths {
        command::say(&path.display().to_string());
    }
    Ok(true)
}
