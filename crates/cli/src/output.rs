//! What is printed, and checks of the places that are written.

use std::{
    fs,
    io::{ErrorKind, Write},
    path::{Path, PathBuf},
};

use anyhow::{Result, anyhow};
use canted_film::{AtomicFile, WriteError};

/// Writes a line of results. A closed pipe is not an error: whoever read has read enough.
///
/// # Errors
/// Standard output that takes no more, as a file on a full disk.
pub(crate) fn to_stdout(text: &str) -> Result<()> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(anyhow!("cannot write standard output: {error}")),
        _ => Ok(()),
    }
}

/// Writes a line about the run.
pub(crate) fn to_stderr(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Tells of a place that cannot be written; nothing is left there, so that work after it may be interrupted.
pub(crate) fn probe(path: &Path) -> Result<(), WriteError> {
    AtomicFile::create(path).map(drop)
}

/// A file, and what the command line calls it.
pub(crate) type Named<'a> = (&'a str, &'a Path);

/// Refuses outputs that would replace an input or each other, by whatever way their names lead to one file.
pub(crate) fn check_distinct(inputs: &[Named], outputs: &[Named]) -> Result<()> {
    let mut taken: Vec<(&str, PathBuf)> = inputs.iter().map(|&(name, path)| (name, meant(path))).collect();
    for &(name, path) in outputs {
        let file = meant(path);
        if let Some((earlier, _)) = taken.iter().find(|(_, other)| *other == file) {
            return Err(anyhow!("{earlier} and {name} are one file, {}", path.display()));
        }
        taken.push((name, file));
    }
    Ok(())
}

/// The file that a name means, whether it is there or not.
fn meant(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let beside = || Some(fs::canonicalize(folder).ok()?.join(path.file_name()?));
    fs::canonicalize(path).ok().or_else(beside).unwrap_or_else(|| path.to_owned())
}
