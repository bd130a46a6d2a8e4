//! Ray tests whose error bounds are derived: slabs, triangles, spheres.
#![forbid(unsafe_code)]

mod count;
mod hit;
mod ray;

pub use count::{Count, Counts};
pub use hit::{Hit, InstanceId, Side};
pub use ray::Ray;
