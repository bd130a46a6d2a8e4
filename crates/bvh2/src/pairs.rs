//! A binary BVH over any leaves: one node holds the boxes of two siblings, so one step tests both.

mod boxes;
mod build;
mod bvh;
mod child;
mod node;
mod order;
mod traverse;

pub use build::OrientedLeaf;
pub use bvh::PairBvh;
pub use order::PairOrder;
