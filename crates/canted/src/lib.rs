#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

/// Stages of BVH construction: oriented boxes, binary trees, their builders and bounding volumes.
pub mod build {
    pub use canted_lbvh as lbvh;
    pub use canted_obb as obb;
    pub use canted_sah as sah;
}

/// Loaders for OBJ, PLY and glTF files (feature `scene`).
#[cfg(feature = "scene")]
pub use canted_scene as scene;

/// Construction and traversal on GPUs (feature `gpu`).
#[cfg(feature = "gpu")]
pub use canted_gpu as gpu;

// Geometry.
pub use canted_obb::{Aabb, Affine, Moments, Obb, PrimId};

// Rays, hits and tests of single primitives.
pub use canted_trace::{
    BaldwinWeber, Convex, Counts, HIT_ERROR, Hit, HitFilter, InstanceId, Kernel, MollerTrumbore, Query, Ray, ScaledRay,
    Side, Sphere, SurfacePoint, TriangleHit, TrianglePoint, Watertight, closest_point_on_triangle,
};

// BVHs and kd-trees over primitives.
pub use canted_bih::{Bih, BoxBih, Config as BihConfig, LeafSize, Memory as BihMemory};
pub use canted_bvh2::{BuildConfig as Bvh2Config, Bvh2};
pub use canted_kdtree::{Config as KdTreeConfig, KdTree, Memory as KdTreeMemory, Traversal as KdTraversal};
pub use canted_lbvh::{GeometryError, Strategy, VolumeConfig};
pub use canted_sah::Builder;
pub use canted_wide::{
    ClosestPoint, Config, Costs, DistanceShape, HitLists, LaneKernel, LeafPrimitive, LoadError, NearestPoint, NodeKind,
    PredictedCost, Preset, Primitive, PrimitiveError, PrimitiveHit, Refit, RefitError, SavedPrimitive, SimdPath, Sizes,
    TraversalCounts, Triangle, TriangleBvh, WideBvh, bounds_of_points, extent_of_points,
};

// Instances.
pub use canted_tlas::{
    Blas, CrossingBlas, Instance, InstanceError, RayOptions, SaveBlas, Tlas, TlasEdit, TlasLoadError, TopConfig,
};
