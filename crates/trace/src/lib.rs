//! Ray tests whose error bounds are derived: boxes, triangles, spheres, segments.
//!
//! ```text
//! Ray -> ScaledRay -> SlabRay       -> boxes:     Aabb, Slabs                                -> entry t
//!                  -> Kernel::prepare -> triangles: watertight, moller_trumbore, baldwin_weber -> TriangleHit
//! ```
//!
//! Two promises hold the crate together. A triangle kernel reports points within [`HIT_ERROR`] of the true triangle;
//! a box test admits every ray that comes so near to its box, no later than at that point. So a tree over the boxes
//! loses no hit, whatever its shape, and needs no epsilon. The proofs stand beside the code: the kernels', in
//! `triangle`, and the boxes', in `slab`.
//!
//! ```
//! use canted_trace::{Kernel, Ray, ScaledRay, Side, SlabRay, Slabs, Watertight};
//!
//! let triangle = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
//! let ray = ScaledRay::new(&Ray::new([2.0, 1.0, 3.0], [0.0, 0.0, -10.0])).unwrap();
//!
//! // The box leans by 45 degrees about z; no coordinate of the triangle exceeds 4.
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
//! Coordinates may be as large as 2^62; beyond that products overflow, and a ray may miss what it should hit.
#![no_std]
#![forbid(unsafe_code)]

mod filter;
mod hit;
#[doc(hidden)]
pub mod lanes;
mod query;
mod ray;
mod rounding;
mod segment;
mod slab;
mod sphere;
mod surface_point;
mod triangle;

pub use filter::HitFilter;
pub use hit::{Hit, InstanceId, Side};
pub use query::{Counts, Query};
pub use ray::{Ray, ScaledRay};
pub use segment::segment_overlaps_aabb;
pub use slab::{AABB_PAD, MIN_DIRECTION, SLABS_PAD, SlabRay, Slabs, ray_aabb, ray_obb};
pub use sphere::Sphere;
pub use surface_point::{SurfacePoint, position_error};
pub use triangle::{
    Axis, BaldwinWeber, BaldwinWeberRecord, HIT_ERROR, Kernel, MollerTrumbore, Shear, TriangleHit, Watertight,
};
