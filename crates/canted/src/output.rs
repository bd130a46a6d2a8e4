//! What is printed, and checks of the places that are written.

use std::{
    fs,
    io::{ErrorKind, Write},
    path::{Path, PathBuf},
};

use anyhow::{Result, anyhow};
use canted_renderer::{Whole, WriteError};

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
    Whole::create(path).map(drop)
}

/// Refuses two options that name one file, of which one is written.
pub(crate) fn check_distinct(a: (&str, &Path), b: (&str, &Path)) -> Result<()> {
    if meant(a.1) != meant(b.1) {
        return Ok(());
    }
    Err(anyhow!("{} and {} are one file, {}", a.0, b.0, b.1.display()))
}

/// The file that a name means, whether it is there or not.
fn meant(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let beside = || Some(fs::canonicalize(folder).ok()?.join(path.file_name()?));
    fs::canonicalize(path).ok().or_else(beside).unwrap_or_else(|| path.to_owned())
}
