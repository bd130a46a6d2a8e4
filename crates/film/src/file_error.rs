use std::fmt;
use std::path::{Path, PathBuf};

/// Why a file was not read or written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError {
    action: &'static str,
    path: PathBuf,
    reason: String,
}

impl FileError {
    pub(crate) fn read(path: &Path, reason: impl fmt::Display) -> Self {
        Self { action: "read", path: path.to_owned(), reason: reason.to_string() }
    }

    pub(crate) fn write(path: &Path, reason: impl fmt::Display) -> Self {
        Self { action: "write", path: path.to_owned(), reason: reason.to_string() }
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cannot {} {}: {}", self.action, self.path.display(), self.reason)
    }
}

impl std::error::Error for FileError {}
