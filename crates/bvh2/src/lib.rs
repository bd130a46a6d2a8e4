//! Binary BVHs for ray tracing, with axis-aligned or oriented boxes of any volume strategy.
//!
//! ```
//! use canted_bvh2::{Bvh2, Bvh2Config};
//! use canted_trace::{Intersect, Ray};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let bvh = Bvh2::build(&positions, &[[0, 1, 2]], &Bvh2Config::default())?;
//! let hit = bvh.closest_hit(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])).expect("the ray points at the triangle");
//! assert_eq!((hit.t, hit.primitive.0), (1.0, 0));
//! # Ok::<(), canted_lbvh::GeometryError>(())
//! ```
//!
//! # When to use it
//! To compare bounding volumes: each strategy of [`VolumeConfig`](canted_lbvh::VolumeConfig) gives its own boxes over the
//! same tree. Also for geometry that changes in every frame and gets few rays: the radix tree is the fastest to build.
//! Otherwise use `WideBvh` of `canted-wide`: it traces several times as many rays per second, and supports refit, save
//! and load.
//!
//! # Types
//! | type | purpose |
//! | --- | --- |
//! | [`Bvh2`] | a BVH over triangles; [`Intersect`](canted_trace::Intersect) has its queries |
//! | [`Bvh2Config`] | length of the Morton codes, volume strategy, triangle test |
//! | [`PairBvh`] | the nodes without triangles: reports the leaves whose boxes a ray enters |
//! | [`OrientedLeaf`] | what a leaf of a [`PairBvh`] supplies |
//! | [`Bvh2Boxes`] | a BVH over oriented boxes, for the top level of a TLAS |
//! | [`PairOrder`] | order of the nodes in memory |
//!
//! # Guarantees
//! * **No lost hit.** Results are those of the triangle test on every triangle: same `t`, `u`, `v`, same primitive. Box
//!   tests are padded by the error bounds of `canted-trace`.
//! * **Ties** go to the lowest primitive, so results do not depend on tree, builder or volumes.
//! * **Determinism.** The same input gives the same bits on any number of threads.
//! * **Invalid input is reported** with the index of the triangle. Traversal never overflows its stack.
//!
//! # Cost
//! A pair of axis-aligned boxes takes 64 bytes, a pair with an oriented box 128; a triangle takes its record (36 to 68
//! bytes) and its number. There is one pair less than there are triangles. Building takes linear time.
//!
//! # Features
//! `parallel` (default): build and trace slices on all threads of the current rayon pool.
#![forbid(unsafe_code)]

mod boxes;
mod bvh2;
mod layout;
mod pairs;
mod traverse;

pub use boxes::Bvh2Boxes;
pub use bvh2::{Bvh2, Bvh2Config};
pub use layout::{OrientedLeaf, PairOrder};
pub use pairs::PairBvh;
