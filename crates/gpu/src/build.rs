//! Trees built on the device, station by station as on the CPU.
//!
//! ```text
//! corners of all meshes -> Items -> domain -> codes -> sort -> tree -> volumes       bottom levels
//! roots, instances      -> Items -> the same stations                                top level, alone where instances move
//! ```
//!
//! All trees of a level go through the same dispatches: their items lie one tree after another, and the tree is the most
//! significant word of the key that items are sorted by.

mod dop;
mod items;
mod passes;
mod run;
mod sort;
mod stages;
mod two_levels;
mod volumes;

pub use items::{Items, Range};
pub use passes::Passes;
pub use run::{Run, StageTime};
pub use sort::Sorter;
pub use stages::{Codes, Grid, Node, Sorted, Trees, codes, domain, sort, tree};
pub use two_levels::TwoLevels;
pub use volumes::{aabbs, obbs};

use canted_lbvh::{Bits, Strategy};
use canted_obb::{Aabb, Obb};

use crate::{Buffer, GpuError};

/// What volumes a device has kernels for, the axis-aligned ones first. The unbounded principal axes are left to the CPU: their boxes
/// are measured by every point below each node, which took a device more than a minute (Sabino 2020, 4.3).
pub const STRATEGIES: [Strategy; 5] =
    [Strategy::Aabb, Strategy::PcaBounded, Strategy::Quaternion, Strategy::Combined, Strategy::Dop];

/// How trees are built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct BuildConfig {
    /// Length of the Morton codes.
    pub bits: Bits,
    /// Where leaning boxes come from.
    pub strategy: Strategy,
}

/// Trees of a level in the device's memory.
pub struct Built {
    /// What they are over.
    pub items: Items,
    /// The item of each leaf.
    pub leaves: Buffer<u32>,
    /// Inner nodes and what joins them.
    pub trees: Trees,
    /// Axis-aligned box of each inner node, by slot.
    pub aabbs: Buffer<Aabb>,
    /// Volume of each inner node, by slot: along the axes of the space where a leaning box has no less area. `None` under
    /// [`Strategy::Aabb`].
    pub obbs: Option<Buffer<Obb>>,
}

impl Built {
    /// Builds the trees over `items`, all of them in one set of dispatches.
    ///
    /// # Errors
    /// A device that lacks the memory, or is lost; a strategy that it has no kernel for.
    pub fn new(run: &mut Run<'_>, items: Items, config: BuildConfig) -> Result<Self, GpuError> {
        let domains = domain(run, &items, config.bits)?;
        let codes = codes(run, &items, &domains, config.bits)?;
        let Sorted { codes, leaves } = sort(run, &items, &codes)?;
        let trees = tree(run, &items, &codes)?;
        let aabbs = aabbs(run, &items, &leaves, &trees)?;
        let obbs = match config.strategy {
            Strategy::Aabb => None,
            leaning => Some(obbs(run, &items, &leaves, &trees, &aabbs, leaning)?),
        };
        Ok(Self { items, leaves, trees, aabbs, obbs })
    }
}

/// A count as kernels have it.
#[expect(clippy::cast_possible_truncation, reason = "bindings hold fewer than 2^32 values")]
fn count(n: usize) -> u32 {
    n as u32
}
