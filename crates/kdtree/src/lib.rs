//! SAH kd-trees over triangles with perfect splits, traced with a stack or with ropes.
//!
//! ```
//! use canted_kdtree::{KdTreeConfig, KdTree};
//! use canted_trace::{Intersect, Ray};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let tree = KdTree::build(&positions, &[[0, 1, 2]], &KdTreeConfig::default())?;
//! let hit = tree.closest_hit(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])).expect("the ray points at the triangle");
//! assert_eq!((hit.t, hit.primitive.0), (1.0, 0));
//! # Ok::<(), canted_lbvh::GeometryError>(())
//! ```
//!
//! # When to use it
//! To compare a partition of space with one of primitives: kd-trees are what older ray tracers and many papers measure. Most rays are
//! faster than those of `Bvh2` of `canted-bvh2`, but the build takes far longer. Otherwise use `WideBvh` of `canted-wide`: it traces
//! several times as many rays per second, builds faster, and supports refit, save and load. A kd-tree is rebuilt when a vertex
//! moves.
//!
//! # Stages
//!
//! ```text
//! triangles -> extents -> sorted events -> sweep -> split, triangles clipped to both cells -> nodes -> (ropes)
//! ray -> planes -> leaves in order -> triangle tests                                             + check
//! ```
//!
//! # Types
//! | type | purpose |
//! | --- | --- |
//! | [`KdTree`] | a kd-tree over triangles; [`Intersect`](canted_trace::Intersect) has its queries |
//! | [`KdTreeConfig`] | costs, empty-space bonus, limits, triangle test |
//! | [`KdTraversal`] | with a stack, or with ropes |
//! | [`KdSplit`] | by cost, or at midpoints, to compare with |
//! | [`KdNodes`] | planes and leaves without triangles: reports the triangles that a ray may hit; [`KdNodes::check`] |
//! | [`KdTreeMemory`] | bytes of nodes, ropes, references and triangles |
//!
//! # Guarantees
//! * **No lost hit.** Results are those of the triangle test on every triangle: same `t`, `u`, `v`, same primitive. Triangles are
//!   padded relative to their own coordinates and rays relative to their origin, by the error bounds of `canted-trace`; the proof is
//!   in `traverse.rs`.
//! * **Ties** go to the lowest primitive, and a triangle in several leaves is reported once, so results do not depend on the
//!   configuration or the traversal. Both traversals visit the same leaves in the same order.
//! * **Determinism.** The same input gives the same bits on any number of threads.
//! * **Bounded size.** Depth is at most `8 + 1.3·log2(n)` and there are at most 16 references per triangle, by default. Equal
//!   triangles share a leaf.
//! * **Invalid input is reported** with the index of the triangle. Traversal never overflows its stack.
//!
//! # Cost
//! A node takes 8 bytes and a reference 4, ropes 64 per leaf, a triangle its record (36 to 68 bytes). Ropes need no stack, which
//! matters on GPUs; on CPUs they are slower. Building takes `O(n log n)` time for `n` references.
//!
//! # Sources
//! Wald, Havran: On building fast kd-trees for ray tracing, and on doing that in O(N log N), 2006. Havran: Heuristic ray shooting
//! algorithms, 2000. Popov, Günther, Seidel, Slusallek: Stackless kd-tree traversal for high performance GPU ray tracing, 2007.
//! The empty-space bonus is that of Silva 2010, whose traversal is corrected: the far cell is not entered where the plane is beyond the
//! interval, and near and far follow the direction, not the origin.
//!
//! # Features
//! `parallel` (default): build and trace slices on all threads of the current rayon pool.
#![forbid(unsafe_code)]

mod build;
mod check;
mod config;
mod extent;
mod kdtree;
mod node;
mod nodes;
mod sweep;
mod traverse;

pub use check::{KdTreeFlaw, KdTreeStats};
pub use config::{KdSplit, KdTraversal, KdTreeConfig};
pub use kdtree::KdTree;
pub use nodes::{KdNodes, KdTreeMemory};
