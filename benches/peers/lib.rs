//! Peers in other languages, for the benches: bindings that are loaded while the program runs.
//!
//! Nothing is linked: without a library, or without the feature `peers`, everything builds and reports what is missing.
//! The one module of the benches that holds unsafe code is `embree`.
#![cfg(feature = "peers")]
#![deny(unsafe_code)]

pub mod embree;
