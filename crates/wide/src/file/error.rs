use std::{error::Error, fmt, io};

use canted_obb::Aabb;

use super::VERSION;
use crate::node::Flaw;

/// Why bytes are not a BVH.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum LoadError {
    /// The first bytes are wrong.
    Magic {
        /// The first bytes.
        found: [u8; 8],
    },
    /// Another version of the format, of an older or newer release.
    Version {
        /// Its version.
        found: u32,
    },
    /// The length is not that of the header.
    Length {
        /// Number of bytes.
        n_bytes: usize,
        /// Number of bytes by the header.
        n_expected: u64,
    },
    /// The contents do not match the checksum in the file: it is damaged.
    Checksum {
        /// Checksum in the file.
        stored: u64,
        /// Checksum of the contents.
        computed: u64,
    },
    /// Leaves of other primitives: the sizes by the header, in bytes, are not those of the type that is loaded.
    Primitives {
        /// Bytes of a unit of leaves, and of a primitive.
        found: [u32; 2],
        /// Those of the type.
        expected: [u32; 2],
    },
    /// A cost that is NaN.
    Cost {
        /// The cost.
        value: f32,
    },
    /// An error of hits, which boxes are padded for, that is negative, above 1/8 or NaN.
    HitError {
        /// The error.
        found: f32,
    },
    /// A reference point that boxes cannot be relative to: beyond [`ReferencePoint::MAX`](canted_trace::ReferencePoint::MAX), or not the origin
    /// where hits have errors relative to it.
    Reference {
        /// The point.
        found: [f32; 3],
    },
    /// More primitives than all leaves hold.
    Count {
        /// Primitives by the header.
        n_expected: u64,
        /// Primitives in all leaves.
        n_found: usize,
    },
    /// The depth by the header is not that of the nodes.
    Depth {
        /// By the header.
        expected: u32,
        /// Of the nodes.
        found: u32,
    },
    /// The bounds by the header are not those of the primitives.
    Bounds {
        /// By the header.
        expected: Aabb,
        /// Of the primitives.
        found: Aabb,
    },
    /// Invalid records.
    Flaw(Flaw),
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Magic { found } => write!(f, "not a BVH file: it begins with \"{}\"", found.escape_ascii()),
            Self::Version { found } => write!(f, "unsupported format version {found}; expected {VERSION}"),
            Self::Length { n_bytes, n_expected } => write!(f, "{n_bytes} bytes, expected {n_expected}"),
            Self::Checksum { stored, computed } => {
                write!(f, "checksum mismatch: the file says {stored:#018x}, its contents give {computed:#018x}")
            }
            Self::Primitives { found, expected } => {
                write!(f, "leaves and primitives of {found:?} bytes; those of the type have {expected:?}")
            }
            Self::Cost { value } => write!(f, "cost {value} is not a number"),
            Self::HitError { found } => write!(f, "boxes padded for an error of {found}; expected one from 0 to 1/8"),
            Self::Reference { found } => write!(f, "boxes cannot be relative to the point {found:?}"),
            Self::Count { n_expected, n_found } => {
                write!(f, "{n_expected} primitives by the header, but leaves hold {n_found}")
            }
            Self::Depth { expected, found } => write!(f, "depth {expected} by the header, but {found} of the nodes"),
            Self::Bounds { expected, found } => write!(
                f,
                "bounds from {:?} to {:?} by the header, but primitives extend from {:?} to {:?}",
                expected.min, expected.max, found.min, found.max
            ),
            Self::Flaw(flaw) => write!(f, "{flaw}"),
        }
    }
}

impl Error for LoadError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Flaw(flaw) => Some(flaw),
            _ => None,
        }
    }
}

impl From<Flaw> for LoadError {
    fn from(flaw: Flaw) -> Self {
        Self::Flaw(flaw)
    }
}

/// Why a file was not mapped.
#[derive(Debug)]
#[non_exhaustive]
pub enum MapError {
    /// The system did not read or map it.
    System(io::Error),
    /// It is not a BVH.
    Load(LoadError),
}

impl fmt::Display for MapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::System(error) => error.fmt(f),
            Self::Load(error) => error.fmt(f),
        }
    }
}

impl Error for MapError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::System(error) => Some(error),
            Self::Load(error) => Some(error),
        }
    }
}

impl From<io::Error> for MapError {
    fn from(error: io::Error) -> Self {
        Self::System(error)
    }
}

impl From<LoadError> for MapError {
    fn from(error: LoadError) -> Self {
        Self::Load(error)
    }
}
