//! Linear bounding volume hierarchies (LBVH): a binary tree over Morton codes, with axis-aligned or oriented volumes.
//!
//! ```
//! use canted_lbvh::{Bits, Domain, Strategy, VolumeConfig, check, in_leaf_order, morton_codes, radix};
//! use canted_lbvh::{sort_by_code, triangle_corners, volumes};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [9.0, 9.0, 0.0], [9.0, 9.1, 1.0]];
//! let (corners, bounds) = triangle_corners(&positions, &[[0, 1, 2], [1, 2, 3]])?;
//! let codes = morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners);
//! let tree = radix(sort_by_code(&codes, Bits::B63));
//! let leaves = in_leaf_order(&corners, &tree.leaves);
//! let volumes = volumes(&tree, &leaves, &VolumeConfig { strategy: Strategy::PcaBounded, ..VolumeConfig::default() });
//! assert_eq!(check(&tree, &volumes, &leaves).unwrap().n_leaves, 2);
//! # Ok::<(), canted_lbvh::GeometryError>(())
//! ```
//!
//! # When to use it
//! Use it to build binary BVHs very fast, or as the input of other builders: `canted-sah` improves these trees, and
//! `canted-wide` and `canted-bvh2` trace them. Without changes the SAH cost is higher than that of a SAH builder.
//!
//! # Stages
//!
//! ```text
//! triangles -> corners -> domain -> morton -> sort -> radix -> volumes      + check  cost
//!                              topology of another builder -> Tree -^
//! ```
//!
//! | item | purpose |
//! |---|---|
//! | [`triangle_corners`], [`Domain`], [`morton_codes`], [`sort_by_code`], [`radix`] | from triangles to a [`Tree`] |
//! | [`as_positions`], [`as_triangles`] | vertices and indices of other types |
//! | [`Tree`], [`Tree::from_children`] | binary tree over primitive indices; from any builder |
//! | [`volumes()`], [`Strategy`] | the bounding volume of every node |
//! | [`check()`] | verifies a tree and its volumes |
//! | [`tree_cost`], [`Costs`] | SAH cost and area sums |
//! | [`bottom_up()`] | computes a value for every node from its children, in parallel |
//!
//! # Guarantees
//! Every stage is a function of plain arrays and gives the same bits for any number of threads. A volume contains every
//! point below it, exactly. A tree stores indices, never geometry.
//!
//! # Cost
//! Time is linear in the number of primitives, except for [`Strategy::PcaUnbounded`], which visits the leaves below every
//! node. A tree takes 24 bytes per primitive, volumes 24 (axis-aligned) or 87 (oriented).
//!
//! # Features
//! - `parallel` (default): all threads of the current rayon pool.
#![forbid(unsafe_code)]

mod bottom_up;
mod check;
mod cost;
mod leaf;
mod morton;
mod numbering;
#[doc(hidden)]
pub mod par;
mod radix;
mod sort;
pub mod stages;
mod tree;
mod volumes;

pub use bottom_up::bottom_up;
pub use check::{Flaw, Stats, check};
pub use cost::{TreeCost, tree_cost};
pub use leaf::{
    BadPosition, Corners, GeometryError, Leaf, MAX_PRIMITIVES, as_positions, as_triangles, corners_of, flat_indices,
    in_leaf_order, triangle_bounds, triangle_corners,
};
pub use morton::{Bits, Domain, morton_codes, morton_codes_of_boxes};
pub use radix::radix;
pub use sort::{Sorted, sort_by_code};
pub use tree::{Child, ChildKind, MAX_DEPTH, Node, NodeId, Task, TopologyError, Tree};
pub use volumes::{Costs, Strategy, Volume, VolumeConfig, Volumes, volumes, volumes_along};
