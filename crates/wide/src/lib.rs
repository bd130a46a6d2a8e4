//! An eight-wide BVH with oriented bounding boxes, traced with SIMD, over triangles or any shape.
//!
//! # Ten lines
//! ```
//! use canted_trace::{Intersect, Ray};
//! use canted_wide::TriangleBvh;
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let bvh = TriangleBvh::build(&positions, &[[0, 1, 2]])?;
//! let ray = Ray::new([0.25, 0.5, 1.0], [0.0, 0.0, -1.0]);
//! let hit = bvh.closest_hit(&ray).expect("the ray hits the triangle");
//! assert_eq!((hit.t, hit.u, hit.v, hit.primitive.0), (1.0, 0.25, 0.5, 0));
//!
//! // Slices of rays take one call; `par_closest_hits` distributes them over threads.
//! let rays = [ray, Ray::new([2.0, 2.0, 1.0], [0.0, 0.0, -1.0])];
//! let mut hits = [None; 2];
//! bvh.closest_hits(&rays, &mut hits);
//! assert_eq!(hits, [Some(hit), None]);
//! # Ok::<(), canted_lbvh::GeometryError>(())
//! ```
//!
//! # When should I use this?
//! Use it for many thin or long primitives that are not aligned with x, y and z: trusses, scaffolds, cables, hair, machines,
//! rotated buildings. An axis-aligned box around a diagonal strut is mostly empty and an oriented box is not, so a ray
//! tests a fraction of the primitives. The builder chooses the kind of each node by predicted traversal cost, so a mesh that
//! gains nothing gets axis-aligned nodes.
//!
//! Oriented nodes gain **nothing** on scans, terrain and axis-aligned architecture; there this is one more eight-wide BVH. If
//! the mesh changes in every frame and few rays are traced, a binary BVH builds faster. For many instances of a mesh, use
//! `canted-tlas` over these BVHs.
//!
//! # Main types
//! | type | content |
//! | --- | --- |
//! | [`WideBvh`] | the BVH; `P` is what it is over |
//! | [`TriangleBvh`], [`MovingBvh`] | `WideBvh<Triangle>`: over triangles; over triangles that move while the shutter is open |
//! | [`Primitive`] | the trait of your own shapes; spheres, round segments and boxes implement it |
//! | [`Config`], [`Preset`], [`Costs`] | how a BVH is built, and its triangle test |
//! | [`RawBvh`] | nodes and leaves as words, for devices |
//!
//! | task | method |
//! | --- | --- |
//! | the first hit, or whether there is one | [`Intersect::closest_hit`](canted_trace::Intersect::closest_hit), [`Intersect::occluded`](canted_trace::Intersect::occluded) |
//! | every hit; every crossing of a surface, once | [`Intersect::all_hits`](canted_trace::Intersect::all_hits), [`Crossings::crossings`](canted_trace::Crossings::crossings) |
//! | only hits that a function accepts | [`Intersect::closest_hit_with`](canted_trace::Intersect::closest_hit_with) and an [`Accept`](canted_trace::Accept) |
//! | slices, on one thread or on all | [`Intersect::closest_hits`](canted_trace::Intersect::closest_hits), [`Intersect::par_closest_hits`](canted_trace::Intersect::par_closest_hits), and similar |
//! | which boxes a ray enters; which primitives come near it | [`WideBvh::traverse`] of a `WideBvh<Aabb>`; [`WideBvh::visit_along`] |
//! | nodes and leaves, for a walk of your own | [`WideBvh::root`], [`WideBvh::lanes`], [`WideBvh::child`] |
//! | distances, containment, overlaps | [`WideBvh::nearest_point`], [`TriangleBvh::contains`], [`TriangleBvh::winding_numbers`], those of [`Overlaps`](canted_trace::Overlaps) |
//! | moved primitives | [`TriangleBvh::refit`], which reports when to rebuild |
//! | single primitives that come, go and move | [`WideBvh::insert`], [`WideBvh::remove`], [`WideBvh::move_one`], [`WideBvh::drift`] |
//! | the primitives | [`TriangleBvh::triangle`], [`TriangleBvh::triangles`], `primitives` |
//! | counts of visited nodes and leaves | [`TriangleBvh::traversal_counts`] |
//! | a BVH as bytes | [`TriangleBvh::to_bytes`], [`TriangleBvh::from_bytes`] |
//!
//! # Guarantees
//! * **No lost hit.** Results are those of testing every primitive: the same `t`, `u`, `v` and primitive. Box tests are padded
//!   by a proven error bound that grows with the distance of a ray's origin; the proof is at the head of `traverse`. Coordinates may
//!   reach 2^62 in magnitude. With the default test, [`Watertight`](canted_trace::Watertight), a closed mesh has no leaks.
//! * **Ties** go to the lowest primitive, so results do not depend on the builder or the preset.
//! * **Determinism.** The same input gives the same BVH and the same hits, bit for bit, on any number of threads and
//!   every [`SimdPath`].
//! * **Invalid input is reported.** An index out of range or a vertex that is not finite is an error with the index of the
//!   triangle; bytes that are no valid BVH are rejected. A ray with a NaN component, an infinite origin or
//!   direction, a zero direction or an empty interval never hits.
//!   Stacks cannot overflow.
//!
//! # Cost
//! An aligned node takes 256 bytes, an oriented one 512, four triangles 160. [`Preset::Dynamic`] collapses a binary tree by Morton codes over groups of primitives, [`Preset::Fast`] one by the
//! surface area heuristic in about twice the time, [`Preset::Balanced`] searches for a frame of the mesh and uses smaller groups,
//! [`Preset::Quality`] optimizes the tree further. Where a sample shows that oriented nodes may pay, all but the first build trees with a
//! primitive per leaf, which takes several times as long. A build of [`Preset::Fast`] without oriented nodes takes less than twice the
//! memory of its BVH, the BVH included. A BVH holds at most 2^27 triangles where leaves are full ([`MAX_TRIANGLES`]), 2^26 other primitives.
//!
//! # Features
//! `parallel`, on by default, builds and traces slices on all threads with `rayon`; results are identical.
//!
//! # How it works
//! ```text
//! build      items (boxes along any frame) -> frame of the mesh -> binary tree (canted-sah), over groups of primitives
//!            -> frames, where a sample of subtrees shows that oriented nodes may pay: bottom-up, few candidates for each
//!            -> collapse: dynamic programming over node kinds, by predicted cost -> layout -> records
//! node       nodes of 256 and 512 bytes, words that name children; their checks
//! leaf       triangles in blocks of eight, primitives of the caller
//! traverse   one ray through nodes, with scalar, avx2, avx512 or neon instructions; the proof that no hit is lost
//! query      what becomes of hits: closest, any, all, crossings
//! update     new boxes for primitives that have moved
//! edit       changes of single primitives
//! ```
//!
//! A ray goes from [`Intersect::closest_hit`](canted_trace::Intersect::closest_hit) to `closest_hit_scaled` in `query/triangles.rs`, to `walk` in `traverse/walk.rs` with the
//! instructions of the machine, and to the triangle test of a leaf in `query/triangles.rs` and `traverse/block.rs`. All traversals are
//! compiled in this crate, whatever the primitive.
//!
//! Sources: Woop et al. 2014 for nodes with a frame for each child, which they use for curves; Ylitie et al. 2017 for the
//! collapse by dynamic programming, here over kinds of nodes too; Wald et al. 2020 for frames carried up a binary tree.
#![deny(unsafe_code)]

mod build;
mod bvh;
mod config;
mod distance;
mod edit;
mod file;
mod leaf;
mod node;
mod query;
mod simd;
mod subtree;
mod support;
mod traverse;
mod update;

use canted_lbvh::par;

pub use build::PrimitiveError;
pub use bvh::{PredictedCost, Sizes, TriangleBvh, WideBvh};
pub use config::{Config, Costs, Preset};
pub use distance::{ClosestPoint, DistanceShape, Found, NearestList, NearestPoint, Place, WindingNumbers};
pub use edit::EditError;
pub use file::{KnownFile, LoadError, MapError, RawBvh, checksum};
pub use leaf::{
    LeafPrimitive, Moves, Moving, Primitive, PrimitiveHit, SavedPrimitive, Triangle, bounds_of_points, extent_of_box,
    extent_of_points,
};
pub use node::{Flaw, MAX_PRIMITIVES, MAX_TRIANGLES, NodeBox, NodeKind};
pub use query::{CrossingParts, MovingBvh, Order, TraversalCounts};
pub use simd::{Loops, SimdPath};
pub use subtree::{NodeLanes, Subtree};
#[doc(hidden)]
pub use traverse::{Prepared, PreparedRays};
pub use update::{Refit, RefitError};
