//! Whether the workspace could be published: every package compiles from what `cargo publish` would upload.
//!
//! `cargo publish` can check that itself, but builds all dependencies of each package for it. Here the uploaded files of
//! all packages make one workspace, whose dependencies the lints have already checked.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, ensure};

use crate::command::{self, cargo, files_with, succeeds};

const UNREACHABLE: &str = "the registry cannot be reached";

/// What cargo says where the machine cannot check a package, and why.
const UNDECIDED: [(&str, &str); 11] = [
    ("No space left", "the disk is full"),
    ("SIGKILL", "the compiler was killed"),
    ("failed to download", UNREACHABLE),
    ("failed to get", UNREACHABLE),
    ("Could not resolve host", UNREACHABLE),
    ("download of", UNREACHABLE),
    ("network", UNREACHABLE),
    ("spurious", UNREACHABLE),
    ("timed out", UNREACHABLE),
    ("unable to update registry", UNREACHABLE),
    ("failed to query", UNREACHABLE),
];

/// What was found.
pub(crate) enum Outcome {
    Well,
    /// The last lines that say why.
    Faulty(String),
    /// Why this machine cannot say, which is no fault of the packages.
    Undecided(&'static str),
}

/// Packages all crates without uploading them, and checks what would be uploaded.
pub(crate) fn dry_run() -> Result<Outcome> {
    // Where `cargo publish --dry-run` leaves its files.
    let packages = command::root().join("target/package/tmp-crate");
    for path in files_with(&packages, "crate") {
        // Files of earlier versions would be checked, too.
        fs::remove_file(&path).with_context(|| format!("cannot remove {}", path.display()))?;
    }
    let publish = cargo(&["publish", "--workspace", "--dry-run", "--no-verify", "--allow-dirty"]);
    if let Some(outcome) = fault(publish)? {
        return Ok(outcome);
    }
    let folder = unpacked(&packages)?;
    let mut check = cargo(&["check", "--workspace", "--target-dir"]);
    check.arg(command::root().join("target")).current_dir(&folder);
    Ok(fault(check)?.unwrap_or(Outcome::Well))
}

/// Runs a command; how it failed, if it did.
fn fault(mut command: Command) -> Result<Option<Outcome>> {
    let (is_well, errors) = command::with_errors(&mut command)?;
    Ok((!is_well).then(|| outcome(&errors)))
}

/// What the errors of cargo mean.
fn outcome(errors: &str) -> Outcome {
    if let Some((_, reason)) = UNDECIDED.iter().find(|(words, _)| errors.contains(words)) {
        return Outcome::Undecided(reason);
    }
    let lines: Vec<_> = errors.lines().collect();
    let first = lines.iter().position(|line| line.starts_with("error")).unwrap_or(0);
    Outcome::Faulty(lines[first..].iter().take(12).copied().collect::<Vec<_>>().join("\n"))
}

/// Makes a workspace of the packages in a folder; its folder.
fn unpacked(packages: &Path) -> Result<PathBuf> {
    let folder = packages.join("check");
    if folder.is_dir() {
        fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
    }
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let files = files_with(packages, "crate");
    ensure!(!files.is_empty(), "cargo publish left no package in {}", packages.display());
    let mut manifest = "[workspace]\nresolver = \"3\"\nmembers = [\"*\"]\n\n[patch.crates-io]\n".to_owned();
    for file in files {
        // With the time of now: files in packages all have the same time, by which cargo would take those of another build for unchanged.
        let mut tar = command::program("tar", &["-xmzf"]);
        tar.arg(&file).arg("-C").arg(&folder);
        ensure!(succeeds(&mut tar)?, "{} cannot be unpacked", file.display());
        // `canted-obb-0.1.0`: the version is behind the last hyphen.
        let unpacked = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let (name, _) = unpacked.rsplit_once('-').with_context(|| format!("{unpacked} has no version"))?;
        manifest += &format!("{name} = {{ path = \"{unpacked}\" }}\n");
    }
    // The profile that the lints have compiled the dependencies with, which ends the manifest.
    let own = fs::read_to_string(command::root().join("Cargo.toml")).context("cannot read Cargo.toml")?;
    let profile = own.find("[profile.dev]").context("Cargo.toml has no [profile.dev]")?;
    manifest = manifest + "\n" + &own[profile..];
    fs::write(folder.join("Cargo.toml"), manifest).context("cannot write the manifest of the packages")?;
    // The versions that everything else was checked with.
    fs::copy(command::root().join("Cargo.lock"), folder.join("Cargo.lock")).context("cannot copy Cargo.lock")?;
    Ok(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_told_from_what_says_nothing() {
        let Outcome::Faulty(lines) = outcome("    Checking canted\nerror[E0433]: no crate\n --> lib.rs") else {
            panic!("a compile error is a fault")
        };
        assert!(lines.starts_with("error[E0433]") && lines.ends_with("lib.rs"), "{lines}");
        for errors in ["error: failed to download from `https://index.crates.io`", "error: No space left on device"] {
            assert!(matches!(outcome(errors), Outcome::Undecided(_)), "{errors}");
        }
    }
}
