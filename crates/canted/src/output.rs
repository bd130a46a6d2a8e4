//! The only place that prints.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use anyhow::{Result, anyhow};

/// Writes a line of results. A closed pipe is not an error: whoever read has read enough.
pub(crate) fn to_stdout(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// Writes a line about the run.
pub(crate) fn to_stderr(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Tells of a place that cannot be written; nothing is left there, so that work after it may be interrupted.
pub(crate) fn probe(path: &Path) -> Result<()> {
    Whole::create(path).map(drop)
}

/// A file that appears under its name only when it is whole.
pub(crate) struct Whole {
    path: PathBuf,
    temporary: tempfile::TempPath,
    writer: BufWriter<File>,
}

impl Whole {
    /// Opens a temporary file beside `path`.
    pub(crate) fn create(path: &Path) -> Result<Self> {
        if path.is_dir() {
            return Err(anyhow!("cannot write {}: it is a folder", path.display()));
        }
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let (file, temporary) = tempfile::Builder::new()
            .prefix(".canted-")
            .suffix(".tmp")
            .tempfile_in(folder)
            .map_err(|error| anyhow!("cannot write {}: {}", path.display(), reason(&error)))?
            .into_parts();
        Ok(Self { path: path.to_owned(), temporary, writer: BufWriter::new(file) })
    }

    /// Renames the finished file to its name.
    pub(crate) fn finish(mut self) -> Result<()> {
        let name = |error: std::io::Error| anyhow!("cannot write {}: {}", self.path.display(), reason(&error));
        self.writer.flush().map_err(name)?;
        // A temporary file is private to its owner; a result is as readable as any other new file.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            self.writer.get_ref().set_permissions(std::fs::Permissions::from_mode(0o644)).map_err(name)?;
        }
        self.temporary.persist(&self.path).map_err(|error| name(error.error))
    }
}

impl Write for Whole {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.writer.write(bytes)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.writer.flush()
    }
}

/// The system's reason without its number.
fn reason(error: &std::io::Error) -> String {
    let text = error.to_string();
    text.split(" (os error").next().unwrap_or(&text).to_lowercase()
}
