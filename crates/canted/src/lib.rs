#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

// Geometry.
pub use canted_obb::{Aabb, Affine, PrimId};

// Rays, hits, and what answers queries.
pub use canted_trace::{
    Accept, Crossings, Hit, InstanceId, Intersect, Ray, Side, SurfacePoint, TriangleTest, Triangles,
};

// BVHs.
pub use canted_lbvh::GeometryError;
pub use canted_wide::{Config, Preset, Primitive, TriangleBvh, WideBvh};

// Instances.
pub use canted_tlas::{Instance, Tlas};

/// How BVHs are built and updated, what is known of them, and the stages of construction as crates of their own.
pub mod build {
    pub use canted_lbvh::{self as lbvh, Strategy, VolumeConfig};
    pub use canted_obb::{self as obb, Moments, Obb};
    pub use canted_sah::{self as sah, Builder};
    pub use canted_wide::{
        Costs, EditError, Flaw, MAX_PRIMITIVES, MAX_TRIANGLES, NodeKind, PredictedCost, PrimitiveError, Refit,
        RefitError, SimdPath, Sizes, bounds_of_points, extent_of_box, extent_of_points,
    };
}

/// Distances, containment and overlaps: what their queries take and return.
pub mod distance {
    pub use canted_tlas::{InstancePrimitive, NearestSurface};
    pub use canted_trace::{Convex, InvertedBox, Overlaps, TrianglePoint, closest_point_on_triangle, closest_to_zero};
    pub use canted_wide::{ClosestPoint, DistanceShape, NearestPoint, WindingNumbers};
}

/// BVHs as bytes; with the feature `tiles`, meshes that are larger than memory as folders of tiles, which answer as one BVH.
pub mod file {
    #[cfg(feature = "tiles")]
    pub use canted_tiles as tiles;
    pub use canted_tlas::TlasLoadError;
    pub use canted_trace::SaveBlas;
    pub use canted_wide::{LoadError, SavedPrimitive};
}

/// Bodies against bodies: touching pairs, distances, self-intersections and casts.
pub mod collide {
    pub use canted_collide::{
        Body, Capsule, Contact, ContactChanges, Contacts, Distance, Hull, InstanceDistance, InstancePair, Pose,
        PrimitivePair, Segment, Shape, SphereContact, cast, cast_at_instances, cast_sphere, closest_instance_pairs,
        closest_pairs, count_pairs, count_touching, distance, each_pair, each_touching, first_pair, first_touching,
        instance_pairs, overlaps, pairs, pairs_within, self_intersections, touches, touching,
    };
}

/// How instances are placed, changed and moved.
pub mod instance {
    pub use canted_tlas::{InstanceError, MAX_CONDITION, Motion, TlasEdit, TopConfig};
    pub use canted_trace::BoxBvh;
}

/// Tests of single primitives, their error bounds, and what implementors of [`Intersect`] and [`Primitive`] need.
pub mod kernel {
    pub use canted_trace::{
        AcceptAt, Answer, Answers, BaldwinWeber, BezierPatch, Cone, Counts, Disk, Ellipsoid, HIT_ERROR, HitLists,
        Kernel, LeafTriangles, Leaves, MollerTrumbore, Projected, Query, ReferencePoint, RibbonCubic, RibbonSegment,
        RoundCubic, RoundSegment, ScaledRay, SlabRay, Slabs, Sphere, TriangleHit, Watertight, position_error, ray_aabb,
        ray_obb,
    };
    pub use canted_wide::{PrimitiveHit, TraversalCounts};
}

/// Structures besides [`TriangleBvh`]: over moving triangles, and those of the literature, each with a feature of its name.
pub mod structure {
    #[cfg(feature = "bih")]
    pub use canted_bih::{Bih, BihConfig, BihFlaw, BihMemory, BihStats, BoxBih, BoxBihError, LeafSize};
    #[cfg(feature = "bvh2")]
    pub use canted_bvh2::{Bvh2, Bvh2Boxes, Bvh2Config, PairBvh, PairOrder};
    #[cfg(feature = "kdtree")]
    pub use canted_kdtree::{KdNodes, KdTraversal, KdTree, KdTreeConfig, KdTreeFlaw, KdTreeMemory, KdTreeStats};
    pub use canted_wide::MovingBvh;
}

/// Loaders for OBJ, PLY, STL, OFF and glTF files.
#[cfg(feature = "scene")]
pub use canted_scene as scene;

/// Construction and traversal on GPUs.
#[cfg(feature = "gpu")]
pub use canted_gpu as gpu;
