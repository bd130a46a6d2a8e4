//! Bounding interval hierarchies.
#![forbid(unsafe_code)]

mod bih;
mod boxes;
mod build;
mod check;
mod config;
mod node;
mod partition;
mod split;
mod traverse;

pub use bih::Bih;
pub use boxes::{BoxBih, BoxError, Memory};
pub use check::{Flaw, Stats, check};
pub use config::{Config, LeafSize};
