//! Rays through triangles, fast where geometry is thin, long or leaning: eight-wide trees whose boxes may lean.
//!
//! # Ten lines
//! Triangles in, rays in, hits out:
//!
//! ```
//! use canted_trace::{Ray, Watertight};
//! use canted_wide::{Config, Preset, WideBvh};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let tree = WideBvh::<Watertight>::build(&positions, &[[0, 1, 2]], &Config::preset(Preset::Balanced))?;
//! let ray = Ray::new([0.25, 0.5, 1.0], [0.0, 0.0, -1.0]);
//! let hit = tree.closest_hit(&ray).expect("it points at the triangle");
//! assert_eq!((hit.t, hit.u, hit.v, hit.primitive.0), (1.0, 0.25, 0.5, 0));
//!
//! // Slices of rays take one call; `par_closest_hits` shares them out among threads.
//! let rays = [ray, Ray::new([2.0, 2.0, 1.0], [0.0, 0.0, -1.0])];
//! let mut hits = [None; 2];
//! tree.closest_hits(&rays, &mut hits);
//! assert_eq!(hits, [Some(hit), None]);
//! # Ok::<(), canted_lbvh::GeometryError>(())
//! ```
//!
//! # When should I use this?
//! When rays meet many triangles that do not stand along x, y and z: trusses, scaffolds, cables, hair, machines and
//! buildings turned on their plot. A box along the axes around a diagonal strut is mostly empty; one that leans with it
//! is not, so a ray tests a fraction of the triangles. Every node is of the kind predicted cheapest, so a mesh that
//! gains nothing gets boxes along the axes.
//!
//! Those are as good, and leaning boxes bring **nothing**, on scans, terrain and architecture in its own axes; there
//! this is one more eight-wide tree. Where each ray counts for little and the mesh changes in every frame,
//! `canted-lbvh` with `canted-tlas` builds sooner. For many placed copies of a mesh, stand these trees under
//! `canted-tlas`. Spheres, curves and shapes of your own go into a [`PrimitiveTree`]; a
//! [`BoxTree`] tells only which boxes a ray enters.
//!
//! # How it works
//! ```text
//! triangles -> mesh frame -> binary tree (canted-sah)      binary: dominant directions; two builders, the cheaper tree
//!           -> frames                                      frames: bottom-up, a frame a subtree, few candidates each
//!           -> collapse                                    dynamic programming over node kinds, by predicted cost
//!           -> emit                                        nodes of 256 to 512 bytes, blocks of triangles
//! rays      -> path (once a slice) -> traverse -> answers  scalar, avx2, avx512 or neon; one walk for every question
//! moved vertices -> refit          tree <-> file
//! ```
//!
//! A node has eight children and one of three kinds ([`NodeKind`]): boxes along the axes of a frame of the whole mesh,
//! boxes in one frame of the node's own, or a frame for each child. [`WideBvh::predicted`] and [`WideBvh::sizes`] tell what
//! was chosen and what it was predicted to save, `canted stats` says it in a sentence. Sources: Woop et al. 2014 for
//! nodes with a frame for each child, which they give to curves; Ylitie et al. 2017 for the collapse by dynamic
//! programming, here over kinds of nodes too; Wald et al. 2020 for frames carried up a binary tree.
//!
//! | you want | you call |
//! | --- | --- |
//! | the first hit, or whether there is one | [`WideBvh::closest_hit`], [`WideBvh::occluded`] |
//! | every hit; every crossing of a surface, once | [`WideBvh::all_hits`], [`WideBvh::crossings`] |
//! | only hits that a function accepts | [`WideBvh::closest_hit_where`], [`WideBvh::occluded_where`] |
//! | slices, on one thread or on all | [`WideBvh::closest_hits`], [`WideBvh::par_closest_hits`], and their like |
//! | new vertices for the same triangles | [`WideBvh::refit`], which tells when to build anew |
//! | what rays visit, by kind | [`WideBvh::visits`] |
//! | a tree as bytes | [`WideBvh::to_bytes`], [`WideBvh::from_bytes`] |
//!
//! # What is promised
//! * **No lost hit.** The answers are those of the triangle test `K` tried on every triangle: same `t`, `u`, `v`, same
//!   primitive. Pads come from an error bound of the arithmetic and grow with far origins; the proof stands at the
//!   head of `traverse.rs`. Coordinates may reach 2^62 in magnitude. With [`Watertight`](canted_trace::Watertight)
//!   a closed mesh leaks nowhere.
//! * **Ties** go to the lowest primitive, so answers do not depend on the tree, its builder or its preset.
//! * **Determinism.** The same input gives the same tree and the same hits, bit for bit, on any number of threads and
//!   every [`SimdPath`]; the scalar one is the twin that others are tested against.
//! * **Bad input is told.** Vertices that are missing or not finite are errors by index; bytes that no tree of ours
//!   holds are refused, whoever wrote them. A ray that is no ray misses. Stacks cannot overflow.
//!
//! # What it costs
//! A node takes 256 (box), 320 (shared) or 512 bytes (lean), four triangles 160. Building is dearer than for boxes along
//! the axes: [`Preset::Fast`] collapses a radix tree, [`Preset::Balanced`] looks for a frame of the mesh and optimises
//! the tree, [`Preset::Quality`] builds two and refines frames. At most 2^27 triangles fit where leaves are full
//! ([`MAX_TRIANGLES`]), 2^25 blocks of four. The crate needs `glam` and `bytemuck`, and `rayon` with the feature `parallel`, which is on unless
//! you say `default-features = false`; no result depends on it.
#![deny(unsafe_code)]

mod answers;
mod binary;
mod box_tree;
mod build;
mod collapse;
mod config;
mod costs;
mod crossings;
mod emit;
mod file;
mod frames;
mod layout;
mod measure;
mod par;
mod primitive;
mod primitive_tree;
mod queries;
mod refit;
mod simd;
mod slices;
mod traced;
mod traverse;
mod triangles;
mod visits;
mod wide;
mod words;

pub use box_tree::BoxTree;
pub use config::{Config, Preset};
pub use costs::Costs;
pub use file::LoadError;
pub use layout::{MAX_PRIMITIVES, MAX_TRIANGLES, NodeKind};
pub use primitive::{Primitive, PrimitiveHit};
pub use primitive_tree::{PrimitiveError, PrimitiveTree};
pub use refit::{Flaw, Refit, RefitError};
pub use simd::SimdPath;
pub use traverse::LaneKernel;
pub use visits::TraversalCounts;
pub use wide::{PredictedCost, Sizes, TriangleBvh, WideBvh};
pub use words::RawBvh;
