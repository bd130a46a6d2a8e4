//! Each test against an oracle simpler than itself: exact rationals, plain `f64`, or the same ray bit for bit.
//!
//! Not covered here: BVHs, instances and SIMD, which belong to the crates above.

mod boxes;
mod continued_rays;
mod filters;
mod inputs;
mod invariance;
mod kernels;
mod shapes;
mod watertight;
