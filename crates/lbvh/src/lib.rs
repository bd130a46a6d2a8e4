//! Linear bounding volume hierarchies whose boxes may lean.
//!
//! ```text
//!                             another builder's topology -> Tree -^
//! ```
//!
//! Each station is a function of plain arrays, so it can be timed, tested and twinned alone. Every station but
//! `volumes` works on integers or copies of input numbers; all of them give the same bits for any number of threads.
//! The tree owns indices, never geometry, and knows no rays.
#![forbid(unsafe_code)]

mod bottom_up;
mod check;
mod corners;
mod cost;
mod domain;
mod leaf;
mod morton;
#[doc(hidden)]
pub mod par;
mod radix;
mod sort;
mod topology;
mod tree;
mod volume;
mod volumes;

pub use bottom_up::bottom_up;
pub use check::{Flaw, Stats, check};
pub use corners::{Corners, GeometryError, MAX_PRIMITIVES, in_leaf_order, triangle_corners};
pub use cost::{Costs, TreeCost, tree_cost};
pub use domain::{Bits, Domain};
pub use leaf::Leaf;
pub use morton::{morton_codes, morton_codes_of_boxes};
pub use radix::radix;
pub use sort::{Sorted, sort_by_code};
pub use topology::TopologyError;
pub use tree::{Child, ChildKind, MAX_DEPTH, Node, NodeId, Task, Tree};
pub use volume::{Strategy, Volume, VolumeConfig, Volumes};
pub use volumes::volumes;
