//! Whether the workspace could be published: every package compiles from what `cargo publish` would upload.
//!
//! `cargo publish` can check that itself, but builds all dependencies of each package for it. Here the uploaded files of
//! all packages make one workspace, whose dependencies the lints have already checked.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, Result, ensure};

use crate::{
    command::{self, cargo, succeeds},
    workspace,
};

/// What cargo says where a registry does not answer.
const UNREACHABLE: [&str; 9] = [
    "failed to download",
    "failed to get",
    "Could not resolve host",
    "download of",
    "network",
    "spurious",
    "timed out",
    "unable to update registry",
    "failed to query",
];

/// What was found.
pub(crate) enum Outcome {
    Well,
    /// The last lines that say why.
    Faulty(String),
    /// The registry does not answer, which says nothing about the packages.
    Unreachable,
}

/// Packages all crates without uploading them, and checks what would be uploaded.
pub(crate) fn dry_run() -> Result<Outcome> {
    let packages = workspace::root().join("target/package");
    for path in files_in(&packages)? {
        // Files of earlier versions would be checked, too.
        fs::remove_file(&path).with_context(|| format!("cannot remove {}", path.display()))?;
    }
    let publish = cargo(&["publish", "--workspace", "--dry-run", "--no-verify", "--allow-dirty"]);
    if let Some(outcome) = fault(publish)? {
        return Ok(outcome);
    }
    let folder = unpacked(&packages)?;
    let mut check = cargo(&["check", "--workspace", "--target-dir"]);
    check.arg(workspace::root().join("target")).current_dir(&folder);
    Ok(fault(check)?.unwrap_or(Outcome::Well))
}

/// Runs a command; how it failed, if it did.
fn fault(mut command: Command) -> Result<Option<Outcome>> {
    let (is_well, errors) = command::with_errors(&mut command)?;
    Ok((!is_well).then(|| {
        if UNREACHABLE.iter().any(|words| errors.contains(words)) {
            return Outcome::Unreachable;
        }
        let lines: Vec<_> = errors.lines().collect();
        let first = lines.iter().position(|line| line.starts_with("error")).unwrap_or(0);
        Outcome::Faulty(lines[first..].iter().take(12).copied().collect::<Vec<_>>().join("\n"))
    }))
}

/// Makes a workspace of the packages in a folder; its folder.
fn unpacked(packages: &Path) -> Result<PathBuf> {
    let folder = packages.join("check");
    if folder.is_dir() {
        fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
    }
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let files = files_in(packages)?;
    ensure!(!files.is_empty(), "cargo publish left no package in {}", packages.display());
    let mut manifest = "[workspace]\nresolver = \"3\"\nmembers = [\"*\"]\n\n[patch.crates-io]\n".to_owned();
    for file in files {
        let mut tar = Command::new("tar");
        tar.arg("-xzf").arg(&file).arg("-C").arg(&folder).stdin(Stdio::null());
        ensure!(succeeds(&mut tar)?, "{} cannot be unpacked", file.display());
        // `canted-obb-0.1.0`: the version is behind the last hyphen.
        let unpacked = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let (name, _) = unpacked.rsplit_once('-').with_context(|| format!("{unpacked} has no version"))?;
        manifest += &format!("{name} = {{ path = \"{unpacked}\" }}\n");
    }
    fs::write(folder.join("Cargo.toml"), manifest).context("cannot write the manifest of the packages")?;
    // The versions that everything else was checked with.
    fs::copy(workspace::root().join("Cargo.lock"), folder.join("Cargo.lock")).context("cannot copy Cargo.lock")?;
    Ok(folder)
}

/// The packages in a folder, which may not exist.
fn files_in(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Ok(vec![]);
    }
    let entries = fs::read_dir(folder).with_context(|| format!("cannot list {}", folder.display()))?;
    let paths = entries.filter_map(|entry| entry.ok().map(|entry| entry.path()));
    let mut paths: Vec<_> =
        paths.filter(|path| path.extension().is_some_and(|extension| extension == "crate")).collect();
    paths.sort();
    Ok(paths)
}
