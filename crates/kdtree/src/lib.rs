//! SAH kd-trees.
#![forbid(unsafe_code)]

mod build;
mod check;
mod config;
mod extent;
mod kdtree;
mod node;
mod nodes;
mod queries;
mod sweep;
mod traverse;

pub use check::{Flaw, Stats};
pub use config::{Config, Traversal};
pub use kdtree::KdTree;
pub use nodes::{KdNodes, Memory};
