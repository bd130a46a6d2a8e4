//! Builders of binary BVHs with low SAH cost: PLOC, top-down SAH, spatial splits and reinsertion.
//!
//! ```
//! use canted_obb::Aabb;
//! use canted_sah::{Builder, build};
//!
//! let boxes: Vec<Aabb> = (0..100u8)
//!     .map(f32::from)
//!     .map(|x| Aabb { min: [x, 0.0, 0.0], max: [x + 0.5, 1.0, 1.0] })
//!     .collect();
//! let bounds = boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
//! let tree = build(&boxes, &bounds, &Builder::default());
//! assert_eq!((tree.leaves.len(), tree.nodes.len()), (100, 99));
//! ```
//!
//! # When to use it
//! A radix tree is fast to build, but rays test many of its boxes: Morton codes order cells, not areas. Use these builders
//! where a tree is traced often. All of them return the [`Tree`](canted_lbvh::Tree) of `canted-lbvh`; compute its volumes
//! there, in its own leaf order.
//!
//! # Builders
//!
//! | item | method |
//! |---|---|
//! | [`build()`], [`Builder`] | entry point for all builders over boxes |
//! | [`ploc()`] | parallel locally-ordered clustering along a Morton curve |
//! | [`top_down()`] | splits from the root: midpoint, median, binned SAH, sweep SAH |
//! | [`grouped()`] | as binned SAH, or by Morton codes, with leaves of several primitives: the fastest |
//! | [`spatial()`] | as binned SAH, with spatial splits of long triangles |
//! | [`clip`] | the parts of a triangle on both sides of a plane, for spatial splits of your own |
//! | [`reinsert`] | moves subtrees of any tree to reduce the sum of surface areas |
//!
//! ```text
//! sorted leaves + boxes -> { ploc | radix tree, its top by SAH (hybrid) } -> Tree
//! boxes -> references -> { midpoint, median, binned, sweep } -> assemble -> Tree          (top_down)
//! boxes -> runs of neighbors -> { binned, codes } -> Tree over groups                      (grouped)
//! corners -> fragments -> { object split, spatial split } -> clip -> Tree over references (spatial)
//! any Tree + leaf boxes -> pairs -> { select -> search -> apply } per iteration -> Tree   (reinsertion)
//! ```
//!
//! # Guarantees
//! The same bits for any number of threads. [`top_down()`], [`spatial()`] and [`reinsert`] keep to a depth limit.
//!
//! # Cost
//! PLOC takes linear time, the top-down builders `n log n`. Memory while building, per primitive, in addition to the tree: PLOC
//! 140 bytes, binned 64, grouped 32 to 64, reinsertion 68.
//!
//! # Features
//! - `parallel` (default): all threads of the current rayon pool.
#![forbid(unsafe_code)]

use canted_lbvh::par;

mod binned;
mod builder;
mod curve;
mod grouped;
mod hybrid;
mod ploc;
mod reference;
mod reinsertion;
mod spatial;
mod top_down;

pub use builder::{Builder, build};
pub use grouped::{GroupConfig, GroupSplit, Groups, grouped};
pub use ploc::{PlocConfig, ploc};
pub use reinsertion::{ReinsertConfig, reinsert};
pub use spatial::{References, SpatialConfig, clip, spatial};
pub use top_down::{Axes, Split, TopDownConfig, top_down};
