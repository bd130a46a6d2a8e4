//! Peers in other languages, for the benches: bindings that are loaded while the program runs.
//!
//! Nothing is linked: without a library, or without the feature `peers`, everything builds and says what it lacks.
//! The one unsafe module of the benches is `embree::abi`.
#![cfg(feature = "peers")]
#![deny(unsafe_code)]

pub mod embree;
