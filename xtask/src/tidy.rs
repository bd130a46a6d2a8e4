//! `cargo xtask tidy`: style rules that formatters and lints do not cover.

mod rules;
mod words;

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};

use crate::{command::say, tables, workspace};

/// A violated rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Finding {
    /// The file, relative to the root.
    path: PathBuf,
    /// What is wrong, with line and value.
    message: String,
    /// Whether it fails the check; otherwise it is a warning.
    is_error: bool,
}

impl Finding {
    fn error(path: &Path, message: String) -> Self {
        Self { path: path.to_owned(), message, is_error: true }
    }

    fn warning(path: &Path, message: String) -> Self {
        Self { path: path.to_owned(), message, is_error: false }
    }
}

/// Prints all findings. Returns whether none is an error.
pub(crate) fn run() -> Result<bool> {
    let findings = findings()?;
    for Finding { path, message, is_error } in &findings {
        say(&format!("{}: {}: {message}", if *is_error { "error" } else { "warning" }, path.display()));
    }
    Ok(!findings.iter().any(|finding| finding.is_error))
}

/// Checks every text file of the workspace.
fn findings() -> Result<Vec<Finding>> {
    let root = workspace::root();
    let manifest_path = root.join("Cargo.toml");
    let manifest =
        fs::read_to_string(&manifest_path).with_context(|| format!("cannot read {}", manifest_path.display()))?;
    let results = tables::results()?;
    let mut findings = vec![];
    for path in workspace::files()? {
        rules::name(&path, &mut findings);
        // Files that are not UTF-8 are pictures or models.
        let Ok(text) = fs::read_to_string(root.join(&path)) else { continue };
        rules::machine_paths(&path, &text, &mut findings);
        words::retired(&path, &text, &mut findings);
        if path.extension().is_some_and(|extension| extension == "rs") {
            rules::length(&path, &text, &mut findings);
            rules::unfinished(&path, &text, &mut findings);
            rules::allows_no_unsafe(&path, &text, &mut findings);
        }
        if is_crate_root(&path) {
            rules::forbids_unsafe(&path, &text, &mut findings);
        }
        if path.extension().is_some_and(|extension| extension == "md") {
            rules::figures(&path, &text, &results, &mut findings);
        }
        if path.ends_with("README.md") || path.ends_with("Cargo.toml") {
            rules::versions(&path, &text, &manifest, &mut findings);
        }
    }
    Ok(findings)
}

/// `src/lib.rs` and `src/main.rs` of every package.
fn is_crate_root(path: &Path) -> bool {
    path.ends_with("src/lib.rs") || path.ends_with("src/main.rs")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_workspace_is_tidy() {
        let errors: Vec<Finding> = findings().unwrap().into_iter().filter(|finding| finding.is_error).collect();
        assert_eq!(errors, []);
    }

    #[test]
    fn crate_roots_of_this_workspace_are_found() {
        let files = workspace::files().unwrap();
        let roots: Vec<&PathBuf> = files.iter().filter(|path| is_crate_root(path)).collect();
        for root in ["xtask/src/main.rs", "crates/obb/src/lib.rs", "fixtures/src/lib.rs"] {
            assert!(roots.contains(&&PathBuf::from(root)), "{root} is not among {roots:?}");
        }
    }
}
