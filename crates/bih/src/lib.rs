//! Bounding interval hierarchies (BIH) for ray tracing: two planes per node, built by an in-place partition.
//!
//! ```
//! use canted_bih::{Bih, BihConfig};
//! use canted_trace::{Intersect, Ray};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let bih = Bih::build(&positions, &[[0, 1, 2]], &BihConfig::default())?;
//! let hit = bih.closest_hit(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])).expect("the ray points at the triangle");
//! assert_eq!((hit.t, hit.primitive.0), (1.0, 0));
//! # Ok::<(), canted_lbvh::GeometryError>(())
//! ```
//!
//! # When to use it
//! For geometry that changes in every frame and gets few rays: compared with `Bvh2` of `canted-bvh2` over a radix tree, a BIH
//! builds in half the time, takes less memory, and traces as many rays per second or more. Where more than a few rays per
//! triangle are traced, use `WideBvh` of `canted-wide`, which traces several times as many.
//!
//! # Method
//! A node splits the longest axis of its cell of space in the middle. Primitives go to the side of their center, in place. The
//! node stores the greatest coordinate on the left and the least one on the right, so children may overlap or leave a
//! gap, and no primitive is referred to twice. Where the primitives fill less than the node, a clip node with both
//! planes cuts the margin off first ([`BihConfig::tight_factor`]). Rays visit the nearer child first, skip gaps, and drop what
//! begins behind the best hit.
//!
//! ```text
//! boxes -> items -> { clip | split: partition } per node -> nodes + references  -> traverse -> leaves
//! triangles ------------------------------------------------------> records --------------------^
//! ```
//!
//! Source: Wächter, Keller, "Instant ray tracing: the bounding interval hierarchy", 2006, and a thesis that adds the tight-box
//! rule. Each departure is stated beside the code.
//!
//! # Types
//! | type | purpose |
//! | --- | --- |
//! | [`Bih`] | a BIH over triangles; [`Intersect`](canted_trace::Intersect) has its queries |
//! | [`BihConfig`], [`LeafSize`] | primitives in a leaf, triangle test, tight-box factor |
//! | [`BoxBih`] | the nodes without triangles: reports the boxes that a ray may hit |
//! | [`BihMemory`] | bytes of nodes, references and triangles |
//! | [`check()`], [`BihStats`], [`BihFlaw`] | verifies a BIH |
//!
//! # Guarantees
//! * **No lost hit.** Results are those of the triangle test on every triangle: same `t`, `u`, `v`, same primitive. Planes are
//!   padded by the error bounds of `canted-trace`.
//! * **Ties** go to the lowest primitive, so results do not depend on the configuration.
//! * **Determinism.** The same input gives the same bits on any number of threads.
//! * **Bounded depth.** At most [`BoxBih::MAX_DEPTH`] levels for any input, so neither the build nor a traversal overflows a stack.
//!   Primitives whose boxes have the same center share a leaf, however many there are.
//! * **Invalid input is reported** with the index of the triangle or box.
//!
//! # Cost
//! A node takes 16 bytes; there are about 0.4 nodes per triangle, and with one triangle per leaf 2 to 3. A triangle takes
//! its record (36 to 68 bytes) and its number. Building takes `n` times the depth, about `n log n`; memory while
//! building is 32 bytes per primitive.
//!
//! # Features
//! `parallel` (default): build and trace slices on all threads of the current rayon pool.
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
pub use boxes::{BihMemory, BoxBih, BoxBihError};
pub use check::{BihFlaw, BihStats, check};
pub use config::{BihConfig, LeafSize};
