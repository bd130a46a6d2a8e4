//! Ray tests whose error bounds are derived: slabs, triangles, spheres.
#![forbid(unsafe_code)]

mod hit;
mod query;
mod ray;

pub use hit::{Hit, InstanceId, Side};
pub use query::{Counts, Query};
pub use ray::{Ray, ScaledRay};
