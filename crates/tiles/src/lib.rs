//! Meshes that are larger than memory: a folder of tiles that answers as one BVH.
//!
//! ```
//! use canted_obb::Affine;
//! use canted_tiles::{OpenOptions, TiledBvh, TileWriter, WriteOptions};
//! use canted_trace::{Intersect, Ray};
//!
//! # let folder = std::env::temp_dir().join(format!("canted-tiles-example-{}", std::process::id()));
//! let options = WriteOptions { tile_triangles: 1, ..WriteOptions::default() };
//! let mut writer = TileWriter::create(&folder, options)?;
//! writer.push(&[[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])?;
//! writer.push(&[[[5.0, 0.0, 2.0], [6.0, 0.0, 2.0], [5.0, 1.0, 2.0]]])?;
//! writer.finish(&mut |_| ())?;
//!
//! let bvh = TiledBvh::open(&folder, OpenOptions::default())?;
//! let hit = bvh.closest_hit(&Ray::new([5.2, 0.2, 0.0], [0.0, 0.0, 1.0])).expect("the ray hits the second triangle");
//! assert_eq!((hit.t, hit.primitive.0, bvh.n_tiles()), (2.0, 1, 2));
//! # std::fs::remove_dir_all(&folder).unwrap();
//! # Ok::<(), canted_tiles::TileError>(())
//! ```
//!
//! # A store
//! ```text
//! DIR/manifest.json     meshes, placements, tiles: bounds, lengths, checksums; a checksum of itself
//! DIR/000000.bvh        a tile: triangles with their BVH, as TriangleBvh::to_bytes writes it
//! DIR/000000.numbers    the numbers of these triangles in their mesh, ascending, 32-bit words with the least byte first
//! ```
//!
//! Triangles are assigned to tiles by their centroids; none is cut or doubled. The bounds of a tile are those of its triangles.
//!
//! # Writing
//! ```text
//! push -> spool on disk -> parts by sampled medians, until a part fits into memory -> tiles by medians -> BVH -> file
//! ```
//! [`TileWriter`] reads triangles once, in order, and holds a bounded part of them. A store appears under its name when it is complete; until
//! then it is in `DIR.partial`, where a writer that was killed leaves finished tiles for the next one with the same input and options.
//!
//! # Answers
//! [`TiledBvh`] maps tiles when rays need them, and forgets those that were least recently used beyond a memory limit. A hit does not depend
//! on the BVH, so the least `t`, then the lowest number of all tiles is that of one BVH over everything, bit for bit. A ray visits tiles by
//! where it enters their boxes, padded as `canted_tlas` pads those of instances, and stops where no later tile can have a closer hit. Slices of rays wait at
//! the tiles that they need next, so that a tile is read few times (Pharr et al. 1997).
//!
//! # Limits
//! 2^32 - 1 triangles in a mesh. The memory limit is that of tiles that are held; at least one is, whatever the limit, and reading a tile for the
//! first time takes up to three times its size for a moment.
//!
//! Files of a store that is open must not be written. A tile is compared with its checksum when it is first mapped, and what tells whether
//! its files were written since, before each batch of rays there. What is written or truncated while rays read it is not found:
//! see [`TriangleBvh::map`](canted_wide::TriangleBvh::map).
#![forbid(unsafe_code)]

mod broad;
mod bvh;
mod cache;
mod error;
mod manifest;
mod placed;
mod points;
mod rays;
mod schedule;
mod write;

pub use bvh::{OpenOptions, TiledBvh, is_store};
pub use cache::TileCounts;
pub use error::{TileError, TileErrorKind};
pub use write::{TileWriter, WriteOptions, Written};
