use std::fmt;

use canted_lbvh::{GeometryError, TopologyError};
use canted_tlas::InstanceError;
use canted_wide::PrimitiveError;

/// Why a scene cannot be traced.
#[derive(Clone, Debug, PartialEq)]
pub enum PrepareError {
    /// The BVH of a mesh cannot be built.
    Geometry(GeometryError),
    /// An instance has an invalid transform.
    Instance(InstanceError),
    /// An external builder returned invalid nodes.
    Topology(TopologyError),
    /// A mesh deforms while the shutter is open, which only wide BVHs support.
    MovingTriangles,
    /// A BVH over curves cannot be built.
    Primitive(PrimitiveError),
    /// Curves are traced through wide BVHs alone.
    Curves,
    /// The scene has more triangles or vertices than one BVH can index.
    TooMany {
        /// Triangles of all instances.
        n_triangles: usize,
        /// Vertices of all instances.
        n_vertices: usize,
    },
}

impl fmt::Display for PrepareError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Geometry(error) => error.fmt(f),
            Self::Instance(error) => error.fmt(f),
            Self::Topology(error) => write!(f, "the external builder returned an invalid tree: {error}"),
            Self::MovingTriangles => {
                f.write_str("a mesh deforms while the shutter is open; use --accel wide, without --volumes")
            }
            Self::Primitive(error) => error.fmt(f),
            Self::Curves => {
                f.write_str("curves are traced through wide BVHs; use --accel wide, without --volumes and --builder")
            }
            Self::TooMany { n_triangles, n_vertices } => {
                write!(f, "{n_triangles} triangles with {n_vertices} vertices do not fit in one level")
            }
        }
    }
}

impl std::error::Error for PrepareError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Geometry(error) => Some(error),
            Self::Instance(error) => Some(error),
            Self::Topology(error) => Some(error),
            Self::Primitive(error) => Some(error),
            Self::TooMany { .. } | Self::MovingTriangles | Self::Curves => None,
        }
    }
}

impl From<PrimitiveError> for PrepareError {
    fn from(error: PrimitiveError) -> Self {
        Self::Primitive(error)
    }
}

impl From<GeometryError> for PrepareError {
    fn from(error: GeometryError) -> Self {
        Self::Geometry(error)
    }
}

impl From<InstanceError> for PrepareError {
    fn from(error: InstanceError) -> Self {
        Self::Instance(error)
    }
}

impl From<TopologyError> for PrepareError {
    fn from(error: TopologyError) -> Self {
        Self::Topology(error)
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error;

    use super::*;

    #[test]
    fn wrapped_errors_are_sources() {
        let instance = InstanceError::NotFinite { instance: 3 };
        assert_eq!(PrepareError::from(instance).source().map(ToString::to_string), Some(instance.to_string()));
        let geometry = GeometryError::TooMany { n_triangles: 1 << 31 };
        assert_eq!(PrepareError::from(geometry).source().map(ToString::to_string), Some(geometry.to_string()));
        let topology = TopologyError::Unreached { node: 1 };
        assert_eq!(PrepareError::from(topology).source().map(ToString::to_string), Some(topology.to_string()));
        assert!(PrepareError::TooMany { n_triangles: 1 << 31, n_vertices: 3 }.source().is_none());
    }
}
