//! Trees built on the device, station by station as on the CPU.
//!
//! ```text
//! corners of all meshes -> Items -> domain -> codes -> sort -> tree -> volumes
//! ```
//!
//! All trees of a level go through the same dispatches: their items lie one tree after another, and the tree is the most
//! significant word of the key that items are sorted by.

mod items;
mod run;
mod sort;
mod stations;

pub use items::{Items, Range};
pub use run::{Run, StationTime};
pub use sort::Sorter;
pub use stations::{Codes, Grid, Node, Sorted, Trees, codes, domain, sort, tree};

/// A count as kernels have it.
#[expect(clippy::cast_possible_truncation, reason = "bindings hold fewer than 2^32 values")]
fn count(n: usize) -> u32 {
    n as u32
}
