//! Ray queries of a BVH, over the traversal.
//!
//! ```text
//! pass         the hits of one ray through triangles
//! triangles    tests eight at a time inside of the traversal; one match on the triangle test for each query that is not plain
//! slices       slices of rays through triangles; those that are alike walk in groups
//! primitives   tests of the caller, called from the traversal for each leaf
//! filtered     the same, after filters that test eight primitives at a time inside of the traversal
//! boxes        a function of the caller, called for each box
//! ```
//!
//! All traversals are compiled in this crate, once for each SIMD path: what is generic calls them through a function pointer for each leaf.

mod boxes;
mod crossings;
mod filtered;
mod moving;
mod pass;
mod primitives;
mod sink;
mod slices;
mod triangles;

#[cfg(test)]
mod tests;

pub use boxes::Order;
pub use crossings::CrossingParts;
pub use moving::MovingBvh;
pub use sink::TraversalCounts;
