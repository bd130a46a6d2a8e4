//! `cargo xtask tidy`: the rules of style that a program can check.
//!
//! Formatting and lints have tools of their own; here is what they do not see.

mod rules;

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};

use crate::{claims::Measured, command::say, workspace};

/// What breaks a rule, or comes near.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Finding {
    /// The file, relative to the root.
    path: PathBuf,
    /// What is wrong there, with place and value.
    message: String,
    /// Whether it must be mended, not only thought about.
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

/// Prints all findings; whether none of them is an error.
pub(crate) fn run() -> Result<bool> {
    let findings = findings()?;
    for Finding { path, message, is_error } in &findings {
        say(&format!("{}: {}: {message}", if *is_error { "error" } else { "warning" }, path.display()));
    }
    Ok(!findings.iter().any(|finding| finding.is_error))
}

/// Reads every file of the workspace that is text and puts it before the rules.
fn findings() -> Result<Vec<Finding>> {
    let root = workspace::root();
    let manifest_path = root.join("Cargo.toml");
    let manifest =
        fs::read_to_string(&manifest_path).with_context(|| format!("cannot read {}", manifest_path.display()))?;
    let measured = Measured::read()?;
    let mut findings = vec![];
    for path in workspace::files()? {
        // What is not UTF-8 is a picture or a model.
        let Ok(text) = fs::read_to_string(root.join(&path)) else { continue };
        rules::machine_paths(&path, &text, &mut findings);
        if path.extension().is_some_and(|extension| extension == "rs") {
            rules::length(&path, &text, &mut findings);
            rules::unfinished(&path, &text, &mut findings);
            rules::lifts_no_ban(&path, &text, &mut findings);
        }
        if is_crate_root(&path) {
            rules::forbids_unsafe(&path, &text, &mut findings);
        }
        if path.extension().is_some_and(|extension| extension == "md") {
            rules::figures(&path, &text, &measured, &mut findings);
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
    fn the_rules_see_this_workspace() {
        let files = workspace::files().unwrap();
        let roots: Vec<&PathBuf> = files.iter().filter(|path| is_crate_root(path)).collect();
        for root in ["xtask/src/main.rs", "crates/obb/src/lib.rs", "fixtures/src/lib.rs"] {
            assert!(roots.contains(&&PathBuf::from(root)), "{root} is not among {roots:?}");
        }
    }
}
