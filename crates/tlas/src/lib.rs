//! Two-level BVHs: instances of bottom-level BVHs under any affine transform, static or moving.
//!
//! ```
//! use canted_obb::Affine;
//! use canted_tlas::{Instance, Tlas};
//! use canted_trace::{Intersect, Ray};
//! use canted_wide::TriangleBvh;
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let bvh = TriangleBvh::build(&positions, &[[0, 1, 2]])?;
//! let tlas = Tlas::new(vec![bvh], &[Instance::new(0, Affine::IDENTITY)], Default::default())?;
//! let hit = tlas.closest_hit(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])).expect("the ray points at the triangle");
//! assert_eq!((hit.t, hit.instance.0, hit.primitive.0), (1.0, 0, 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # When to use it
//! When meshes occur several times, move as rigid bodies, or change separately. A mesh that occurs once and does not move
//! needs no top level: put its triangles into one BVH, which is faster to trace.
//!
//! # Types
//! | type | purpose |
//! | --- | --- |
//! | [`Tlas`] | a top-level BVH over instances, and their bottom-level BVHs |
//! | [`Instance`] | a bottom-level BVH under a transform, with a mask; static or moving |
//! | [`Intersect`](canted_trace::Intersect) | what a bottom-level BVH supplies; implemented by all of ours |
//! | [`SaveBlas`] | a bottom-level BVH that a TLAS can save: `WideBvh` |
//! | [`TopConfig`] | how the top level is built |
//! | [`TlasEdit`] | several changes with one update of the top level |
//!
//! | task | methods |
//! | --- | --- |
//! | hits, filters, counters, slices of rays | those of [`Intersect`](canted_trace::Intersect) |
//! | crossings of surfaces | those of [`Crossings`](canted_trace::Crossings) |
//! | nearest points, signed distance, containment | [`Tlas::nearest_points`], [`Tlas::signed_distance`], [`Tlas::contains`] |
//! | overlaps with regions | those of [`Overlaps`](canted_trace::Overlaps), [`Tlas::overlapping_sphere`], [`Tlas::each_instance_in`] |
//! | masks, time | [`Ray::mask`](canted_trace::Ray::mask), [`Ray::time`](canted_trace::Ray::time) |
//! | position and normal of a hit, rays that continue | [`Tlas::surface_point`] |
//! | add, remove, move, hide | [`Tlas::insert`], [`Tlas::remove`], [`Tlas::set_transform`], [`Tlas::set_instance`], [`Tlas::set_mask`] |
//! | several changes, or other BVHs | [`Tlas::edit`], [`Tlas::replace_blas`], [`Tlas::update_blas`] |
//! | when to build again | [`Tlas::drift`], [`Tlas::rebuild_advised`], [`Tlas::rebuild`] |
//! | save, load | [`Tlas::to_bytes`], [`Tlas::from_bytes`] |
//!
//! # Guarantees
//! * **No lost hit.** Results are those of every bottom-level BVH, each with the ray in its object space. Boxes of the top
//!   level are padded by a proven error bound, which includes the rounding of the transformed ray. It depends on the instance
//!   in the box and on the ray's origin, not on the other instances.
//! * **One `t`.** Hits have the `t` of the caller's direction, whatever its length. Below, directions are scaled by powers of two,
//!   so a power of two on the direction changes nothing but `t`, by that factor.
//! * **Exact order.** `t` of different instances are compared, and tested against the interval, before they are rounded to the
//!   caller's `f32`. Where `t` is below the normal range of `f32` it is reported as subnormal or zero, and hits in order may have
//!   equal `t`; what is reached only beyond the greatest `f32` is not hit.
//! * **Ties** go to the lowest (instance, primitive), so results do not depend on the top level.
//! * **Determinism.** The same input gives the same bits on any number of threads and every SIMD path.
//! * **Invalid input is reported** with the index of the instance. Transforms may scale, shear and mirror, up to a
//!   condition number of [`MAX_CONDITION`].
//!
//! # Cost
//! An instance takes 122 to 131 bytes: a cache line that rays read, 58 to 67 in a wide top level; a moving one 300 more. A copy of
//! [`Tlas::of_copies`] takes 16 less. The first change, or query about places, keeps bounds of 48 bytes for each, and a change boxes of 28. Building is dominated by the
//! bottom-level BVHs; [`Tlas::set_instances`] builds the top level alone. A change of a single instance takes a few microseconds,
//! and the first one makes tables of about 80 bytes for each instance.
//!
//! # Features
//! `parallel` (default): build and trace slices on all threads of the current rayon pool.
#![forbid(unsafe_code)]

mod around;
mod distance;
mod edit;
mod file;
mod inside;
mod instance;
mod motion;
mod placement;
mod query;
mod slices;
mod support;
mod tlas;
mod top;
mod users;

pub use canted_trace::SaveBlas;
pub use distance::{NearestSurface, NearestSurfaces};
pub use edit::TlasEdit;
pub use file::TlasLoadError;
pub use inside::InstancePrimitive;
pub use instance::{Instance, InstanceError, MAX_CONDITION, row_sum_norm};
pub use motion::Motion;
pub use query::in_world_order;
pub use tlas::Tlas;
pub use top::{BuildBoxes, TopConfig};
