//! Ray intersection tests with proven error bounds: boxes, triangles, spheres, segments.
//!
//! ```
//! use canted_trace::{Kernel, Ray, ScaledRay, Side, SlabRay, Slabs, Watertight};
//!
//! let triangle = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
//! let ray = ScaledRay::new(&Ray::new([2.0, 1.0, 3.0], [0.0, 0.0, -10.0])).unwrap();
//!
//! // A box rotated by 45 degrees about z; no coordinate of the triangle exceeds 4.
//! let half = 0.5f32.sqrt();
//! let slabs = Slabs::from_points([[half, half, 0.0], [-half, half, 0.0], [0.0, 0.0, 1.0]], triangle);
//! let entry = SlabRay::new(&ray, 4.0).intersect_slabs(&slabs, ray.t_max).unwrap();
//!
//! let prepared = Watertight::prepare(&ray);
//! let hit = Watertight::intersect(&prepared, &ray, &Watertight::record(triangle), ray.t_max).unwrap();
//! assert!(entry <= hit.t);
//! assert_eq!((ray.caller_t(hit.t), hit.u, hit.v, hit.side), (0.3, 0.5, 0.25, Side::Front));
//! ```
//!
//! # When to use it
//! Use it to write a BVH of your own, or for a few rays and primitives. The BVHs in the crate `canted` use it.
//!
//! # Main items
//!
//! | item | purpose |
//! |---|---|
//! | [`Intersect`], [`Crossings`] | the queries of everything that rays can hit, in all their forms |
//! | [`Overlaps`], [`Convex`] | what overlaps a region, in all forms of the question |
//! | [`Ray`], [`Hit`], [`Query`] | input and output of every query; hit filters and counters |
//! | [`SurfacePoint`] | rays that continue from a hit without hitting the same surface again |
//! | [`Kernel`]: [`Watertight`], [`MollerTrumbore`], [`BaldwinWeber`], [`Projected`]; [`TriangleTest`] | ray-triangle tests; the choice of one |
//! | [`Leaves`], [`LeafTriangles`] | queries of a BVH with a triangle at each leaf position |
//! | [`BoxBvh`], [`SaveBlas`] | the top level of a TLAS; bottom levels that it can save |
//! | [`SlabRay`], [`Slabs`], [`pad_aabb`] | ray-box tests, axis-aligned and oriented, for a traversal |
//! | [`ReferencePoint`] | boxes near a mesh that is far from the origin |
//! | [`ray_aabb`], [`ray_obb`], [`Sphere`], [`RoundSegment`], [`RoundCubic`], [`RibbonSegment`], [`RibbonCubic`], [`BezierPatch`], [`Disk`], [`Cone`], [`Ellipsoid`], [`segment_overlaps_aabb`] | single tests |
//!
//! # Guarantees
//! A triangle kernel reports points within [`HIT_ERROR`] of the exact triangle. A box test reports every ray that comes
//! this close to its box, at a `t` no greater than at that point. So a BVH of such boxes misses no hit, whatever its shape,
//! and there is no epsilon to tune. The proofs are next to the code, in `triangle` and `slab`. Coordinates may be as large
//! as 2^62; beyond that, products overflow and hits may be missed.
//!
//! # Cost
//! Every test runs in constant time and allocates nothing. Triangle kernels filter in `f32` and decide in `f64`.
//!
//! # Features
//! - `std` (default): square roots of the standard library.
//! - `parallel`: the forms of queries with `par_` use all threads of rayon.
//! - `libm`: square roots of the crate `libm`, for `no_std` targets; disable the default features.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

mod bezier_patch;
mod closest_point;
mod convex;
mod cubic_part;
mod hit;
mod intersect;
mod leaf;
mod levels;
mod moving;
mod overlaps;
mod patch_part;
mod placed;
mod quadrics;
mod query;
mod ray;
mod reference;
mod ribbon;
mod ribbon_cubic;
mod round_cubic;
mod round_segment;
mod rounding;
mod shapes;
mod slab;
mod stack;
mod surface_point;
mod triangle;

pub use bezier_patch::{BezierPatch, PatchPoint};
pub use closest_point::{DISTANCE_ERROR, TrianglePoint, closest_point_on_triangle, closest_to_zero};
pub use convex::{Convex, InvertedBox};
pub use hit::{Hit, HitLists, InstanceId, Side};
pub use intersect::{
    AcceptAt, Answer, Answers, Crossings, Intersect, Pointer, Triangles, alternate_sides, answer_one_by_one,
};
pub use leaf::{LeafTriangles, Leaves};
pub use levels::{BoxBvh, SaveBlas};
#[doc(hidden)]
pub use moving::numbers_at;
pub use moving::position_at;
pub use overlaps::Overlaps;
#[doc(hidden)]
pub use overlaps::forms;
#[doc(hidden)]
pub use placed::{Arrays, F64x4, ObjectMap, ObjectRay, PlacedRay, WorldRay};
pub use quadrics::{Cone, Disk, Ellipsoid};
pub use query::{Accept, Counts, Mapped, Query};
pub use ray::{Ray, ScaledRay};
pub use reference::ReferencePoint;
pub use ribbon::{RibbonPoint, RibbonSegment};
pub use ribbon_cubic::RibbonCubic;
pub use round_cubic::{CurvePoint, RoundCubic};
pub use round_segment::{RoundSegment, SegmentPoint};
pub use shapes::{Sphere, segment_overlaps_aabb};
pub use slab::{AABB_PAD, MIN_DIRECTION, SLABS_PAD, SlabRay, Slabs, pad_aabb, ray_aabb, ray_obb};
#[doc(hidden)]
pub use stack::with_stack;
pub use surface_point::{SurfacePoint, position_error};
pub use triangle::{
    Axis, BaldwinWeber, BaldwinWeberRecord, HIT_ERROR, Kernel, MollerTrumbore, Projected, ProjectedRecord, Shear,
    TriangleHit, TriangleTest, UnknownTriangleTest, Watertight,
};

/// Constants and scalar steps that the SIMD kernels repeat lane by lane, so that one proof covers both. Not part of the
/// stable interface.
#[doc(hidden)]
pub mod lanes {
    pub use crate::rounding::{UNIT_ROUNDOFF, lower};
    pub use crate::slab::{SQRT_3, reciprocal};
    pub use crate::triangle::baldwin_weber::weights as baldwin_weber_weights;
    pub use crate::triangle::moller_trumbore::{
        ERROR as WEIGHTS_ERROR, HEADROOM as WEIGHTS_HEADROOM, Weights, finish, weights as moller_trumbore_weights,
    };
    pub use crate::triangle::projected::weights as projected_weights;
}
