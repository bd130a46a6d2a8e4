//! Peers of the benches that need unsafe code: bindings that are loaded while the program runs, and experimental features of `wgpu`.
//!
//! Nothing is linked: without a library, or without the feature `peers`, everything builds and reports what is missing.
//! The modules of the benches that hold unsafe code are `embree` and `ray_queries`.
#![deny(unsafe_code)]

#[cfg(feature = "peers")]
pub mod embree;
pub mod ray_queries;
