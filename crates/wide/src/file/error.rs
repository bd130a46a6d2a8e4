use std::{error::Error, fmt};

use canted_obb::Aabb;

use super::header::VERSION;
use crate::Flaw;

/// Why bytes are not a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum LoadError {
    /// The first bytes are other ones.
    Magic {
        /// The first bytes.
        found: [u8; 8],
    },
    /// Written in another form, by an older or newer release.
    Version {
        /// Its version.
        found: u32,
    },
    /// Cut off, or longer than its header tells.
    Length {
        /// Bytes that there are.
        n_bytes: usize,
        /// Bytes that there should be.
        n_told: u64,
    },
    /// Damaged.
    Checksum {
        /// Checksum of the bytes as they are.
        computed: u64,
    },
    /// A cost that is not a number.
    Cost {
        /// The cost.
        value: f32,
    },
    /// More triangles than leaves have room for.
    Count {
        /// Triangles by the header.
        n_told: u64,
        /// Triangles in all leaves.
        n_places: usize,
    },
    /// Another depth than the nodes'.
    Depth {
        /// By the header.
        told: u32,
        /// Of the nodes.
        found: u32,
    },
    /// Another box than that of the vertices.
    Bounds {
        /// By the header.
        told: Aabb,
        /// Of the vertices.
        found: Aabb,
    },
    /// Records that no build makes.
    Flaw(Flaw),
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Magic { found } => write!(f, "not a tree: it begins with \"{}\"", found.escape_ascii()),
            Self::Version { found } => write!(f, "version {found} of the form; only {VERSION} is read"),
            Self::Length { n_bytes, n_told } => write!(f, "{n_bytes} bytes where there should be {n_told}"),
            Self::Checksum { computed } => write!(f, "damaged: {computed:#018x} is not the checksum at the end"),
            Self::Cost { value } => write!(f, "cost {value} is not a number"),
            Self::Count { n_told, n_places } => {
                write!(f, "{n_told} triangles by the header, but leaves hold {n_places}")
            }
            Self::Depth { told, found } => write!(f, "depth {told} by the header, but nodes are {found} deep"),
            Self::Bounds { told, found } => write!(
                f,
                "vertices from {:?} to {:?} by the header, but they go from {:?} to {:?}",
                told.min, told.max, found.min, found.max
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
