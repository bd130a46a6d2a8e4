use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use super::text::printable;

/// Why a file gave no scene: one sentence that names the file, the place in it and the value found there.
#[derive(Debug)]
#[non_exhaustive]
pub enum ReadError {
    /// A file could not be opened or read.
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Neither the content nor the extension tells a format that this crate reads.
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file breaks the rules of its format.
    Malformed {
        /// The file.
        path: PathBuf,
        /// Location in the file: `line 7`, `accessor 3`, `element vertex`.
        location: String,
        /// What is wrong there, with the value found.
        message: String,
    },
    /// The file is legal but asks for something that is not read.
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it asks for, by its name in the format.
        feature: String,
    },
    /// Nothing is left to draw.
    Empty {
        /// The file.
        path: PathBuf,
        /// Why: `no face`, `all 3 triangles have no area`.
        reason: String,
    },
}

impl ReadError {
    /// A breach of the format's rules at a place in the file.
    pub(crate) fn malformed(path: &Path, location: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Malformed { path: path.to_owned(), location: location.into(), message: message.into() }
    }

    /// A legal wish that is not fulfilled.
    pub(crate) fn unsupported(path: &Path, feature: impl Into<String>) -> Self {
        Self::Unsupported { path: path.to_owned(), feature: feature.into() }
    }

    /// A file without anything to draw.
    pub(crate) fn empty(path: &Path, reason: impl Into<String>) -> Self {
        Self::Empty { path: path.to_owned(), reason: reason.into() }
    }

    /// The file that the error is about.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::Io { path, .. }
            | Self::UnknownFormat { path }
            | Self::Malformed { path, .. }
            | Self::Unsupported { path, .. }
            | Self::Empty { path, .. } => path,
        }
    }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = self.path().display();
        let sentence = match self {
            Self::Io { source, .. } => format!("{file}: cannot be read: {source}"),
            Self::UnknownFormat { .. } => format!("{file}: is neither OBJ, PLY, glTF nor GLB"),
            Self::Malformed { location, message, .. } => format!("{file}: {location}: {message}"),
            Self::Unsupported { feature, .. } => format!("{file}: {feature} is not supported"),
            Self::Empty { reason, .. } => format!("{file}: nothing to draw: {reason}"),
        };
        f.write_str(&printable(&sentence))
    }
}

impl std::error::Error for ReadError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}
