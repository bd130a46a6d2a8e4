//! Peers of the benches that need unsafe code: bindings that are loaded while the program runs.
//!
//! Nothing is linked: without a library, or without the feature `peers`, everything builds and reports what is missing.
#![deny(unsafe_code)]

#[cfg(feature = "peers")]
pub mod embree;
