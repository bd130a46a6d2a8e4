//! SAH kd-trees.
#![forbid(unsafe_code)]

mod build;
mod config;
mod extent;
mod kdtree;
mod node;
mod nodes;
mod queries;
mod sweep;
mod traverse;

pub use config::{Config, Traversal};
pub use kdtree::KdTree;
pub use nodes::{KdNodes, Memory};
