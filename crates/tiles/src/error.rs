use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// What kind of thing went wrong with a store of tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TileErrorKind {
    /// The system did not read or write a file.
    System,
    /// A file of the store is missing, damaged or of another store.
    Damaged,
    /// Geometry, options or a query that a store does not support.
    Input,
}

/// Why a store of tiles was not written, opened or traced: one sentence, with the file where there is one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileError {
    kind: TileErrorKind,
    path: Option<PathBuf>,
    reason: String,
}

impl TileError {
    /// What kind of error it is.
    #[must_use]
    pub fn kind(&self) -> TileErrorKind {
        self.kind
    }

    /// The file or folder that it is about.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// An error of the system about a file.
    pub(crate) fn system(path: &Path, action: &str, error: &io::Error) -> Self {
        let text = error.to_string();
        let reason = text.split(" (os error").next().unwrap_or(&text).to_lowercase();
        Self { kind: TileErrorKind::System, path: Some(path.to_owned()), reason: format!("cannot {action}: {reason}") }
    }

    /// A file that is not what the store says.
    pub(crate) fn damaged(path: &Path, reason: impl fmt::Display) -> Self {
        Self { kind: TileErrorKind::Damaged, path: Some(path.to_owned()), reason: reason.to_string() }
    }

    /// A file or folder that cannot be used.
    pub(crate) fn of_path(path: &Path, reason: impl fmt::Display) -> Self {
        Self { kind: TileErrorKind::Input, path: Some(path.to_owned()), reason: reason.to_string() }
    }

    /// Something else that the caller gave.
    pub(crate) fn input(reason: impl fmt::Display) -> Self {
        Self { kind: TileErrorKind::Input, path: None, reason: reason.to_string() }
    }
}

impl fmt::Display for TileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(path) = &self.path {
            write!(f, "{}: ", path.display())?;
        }
        f.write_str(&self.reason)
    }
}

impl std::error::Error for TileError {}

/// Makes an error of the system one about a file.
pub(crate) trait Named<T> {
    /// With what was done and the file.
    fn named(self, action: &str, path: &Path) -> Result<T, TileError>;
}

impl<T> Named<T> for io::Result<T> {
    fn named(self, action: &str, path: &Path) -> Result<T, TileError> {
        self.map_err(|error| TileError::system(path, action, &error))
    }
}
