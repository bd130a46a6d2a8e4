use std::{error::Error, fmt};

use super::fields::VERSION;
use crate::InstanceError;

/// Why bytes are not a TLAS. `E` is the error of a bottom-level BVH.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum TlasLoadError<E> {
    /// The bytes are not a saved TLAS.
    Magic {
        /// The first bytes.
        found: [u8; 8],
    },
    /// Saved by a release with another format.
    Version {
        /// The version of the format.
        found: u32,
    },
    /// Fewer or more bytes than the counts in them require.
    Length {
        /// Number of bytes.
        n_bytes: usize,
    },
    /// The contents do not match the checksum in the file: it is damaged.
    Checksum {
        /// Checksum in the file.
        stored: u64,
        /// Checksum of the contents.
        computed: u64,
    },
    /// An unused word of the header is not zero.
    Header {
        /// The word.
        found: u32,
    },
    /// An instance is neither static nor moving.
    Motion {
        /// The instance.
        instance: usize,
    },
    /// An instance cannot be placed.
    Instance(InstanceError),
    /// A bottom-level BVH cannot be loaded.
    Blas {
        /// Index of the bottom-level BVH.
        blas: usize,
        /// Why it cannot be loaded.
        error: E,
    },
}

impl<E> From<InstanceError> for TlasLoadError<E> {
    fn from(error: InstanceError) -> Self {
        Self::Instance(error)
    }
}

impl<E: fmt::Display> fmt::Display for TlasLoadError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Magic { found } => write!(f, "not a TLAS file: it begins with \"{}\"", found.escape_ascii()),
            Self::Version { found } => {
                write!(f, "unsupported version {found} of the TLAS format; this release reads version {VERSION}")
            }
            Self::Length { n_bytes } => write!(f, "{n_bytes} bytes do not match the counts in the file"),
            Self::Checksum { stored, computed } => {
                write!(f, "checksum mismatch: the file says {stored:#018x}, its contents give {computed:#018x}")
            }
            Self::Header { found } => write!(f, "the unused word of the header is {found}, not 0"),
            Self::Motion { instance } => write!(f, "instance {instance} is neither static nor moving"),
            Self::Instance(error) => error.fmt(f),
            Self::Blas { blas, error } => write!(f, "bottom-level BVH {blas}: {error}"),
        }
    }
}

impl<E: Error + 'static> Error for TlasLoadError<E> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Instance(error) => Some(error),
            Self::Blas { error, .. } => Some(error),
            _ => None,
        }
    }
}
