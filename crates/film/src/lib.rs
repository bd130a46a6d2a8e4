//! Pictures and the sums of samples behind them: film, AOVs, parts, checkpoints, files, comparison.
//!
//! ```text
//! samples -> Sums -> Tile -> Film -> Picture -> PNG, EXR
//!                    Tile -> Checkpoint        Picture, Picture -> Comparison, Flip
//! ```
//!
//! Use it to store what a renderer computes: it depends on no BVH, no scene and no integrator. Sums are `f64` and added
//! in a fixed order, so that a picture has the same bits for any number of threads, any tile size and any split of its
//! samples into [parts](Part). Files are written to a temporary name and renamed.
//!
//! ```
//! use canted_film::{Picture, compare};
//!
//! let reference = Picture::filled(4, 4, [0.5; 3]);
//! let mut picture = reference.clone();
//! picture.pixels[0] = [1.0; 3];
//! let difference = compare(&picture, &reference)?;
//! assert_eq!(difference.max_difference, 0.5);
//! # Ok::<(), canted_film::CompareError>(())
//! ```
#![forbid(unsafe_code)]

mod aov;
mod atomic_file;
mod checkpoint;
mod compare;
pub mod denoise;
mod film;
mod film_file;
mod filter;
mod flip;
mod hash;
mod heatmap;
mod lanes;
mod picture;
mod picture_file;
pub mod srgb;
mod sums;
mod tiling;

pub use aov::{Aov, AovValues, Aovs};
pub use atomic_file::{AtomicFile, Discarded, FileError, discard_unfinished};
pub use checkpoint::Checkpoint;
pub use compare::{CompareError, Comparison, REL_MSE_FLOOR, compare};
pub use film::{Film, FilmBuilder, Partial};
pub use film_file::{Record, read_part, write_film, write_film_as};
pub use filter::{Filter, FilterSampler};
pub use flip::{Flip, PIXELS_PER_DEGREE, flip, flip_hdr};
pub use hash::Hash;
pub use heatmap::false_color;
pub use picture::{Picture, ToneMap};
pub use picture_file::{Format, encode, is_own_png, read_picture, write_exr, write_picture, write_png};
pub use sums::{Block, Components, Dyadic, Guide, JoinError, Part, Pixel};
pub use tiling::{CELL, Sums, Tile, Tiling};
