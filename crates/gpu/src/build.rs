//! BVH construction on the device, with the same stages as on the CPU.
//!
//! ```text
//! vertices of all meshes -> Items -> domain -> codes -> sort -> tree -> volumes       bottom levels
//! root boxes, instances  -> Items -> the same stages                                  top level
//! both                                                   -> wide nodes, triangle blocks
//! ```
//!
//! All trees of a level share the same dispatches. Their items are stored one tree after another, and the index of the tree is
//! the most significant word of the sort key.

mod adopt;
mod dop;
mod items;
mod mesh_buffers;
mod passes;
mod place;
mod ploc;
mod prefix;
mod run;
mod schedule;
mod sort;
mod stages;
mod two_levels;
mod unbounded;
mod volumes;
mod wide;

pub use items::{Items, Range};
pub(crate) use mesh_buffers::{Faults, fault};
pub use mesh_buffers::{IndexBuffer, MeshBuffers};
pub use passes::Passes;
pub use place::{DeviceInstance, InstanceBuffer, NOT_PLACED};
pub(crate) use place::{MeshBoxes, N_INSTANCE_FAULTS, Scales, instance_fault};
pub use run::{Run, StageTime};
pub use sort::Sorter;
pub(crate) use stages::depth_bound;
pub use stages::{Codes, Grid, Node, Sorted, Trees, codes, domain, sort, tree};
pub use two_levels::TwoLevels;
pub use volumes::{aabbs, obbs, obbs_async};
pub(crate) use wide::{Change, Collapse, Which};
pub use wide::{MAX_LEAF, WideBvhs, WideLevel};

use canted_lbvh::{Bits, Strategy};
use canted_obb::{Aabb, Obb};

use self::ploc::ploc;
use crate::{Buffer, GpuError, wait::block_on};

/// Volume strategies that the device supports: all of the CPU's, the axis-aligned one first.
pub const STRATEGIES: [Strategy; 6] = Strategy::ALL;

/// Build settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct BuildConfig {
    /// Length of the Morton codes.
    pub bits: Bits,
    /// How the boxes of inner nodes are computed. Default: [`Strategy::Aabb`]. Use [`Strategy::Combined`] for thin, diagonal geometry.
    pub strategy: Strategy,
}

/// How the topology of a tree is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Topology {
    /// The radix tree over the Morton codes: the quickest build, which can be recorded.
    #[default]
    Radix,
    /// Locally-ordered clustering, as by `ploc` of `canted_sah`: less traversal cost.
    Ploc,
}

/// How wide BVHs are built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct WideConfig {
    /// Length of the Morton codes.
    pub bits: Bits,
    /// The topology of the binary trees over triangles.
    pub topology: Topology,
    /// The boxes of oriented nodes, which are chosen where they lower the predicted cost. Default: [`Strategy::Aabb`], no oriented nodes. Use
    /// [`Strategy::Combined`] for thin, diagonal geometry.
    pub strategy: Strategy,
}

/// The trees of a level in device memory.
pub struct Built {
    /// The items of the trees.
    pub items: Items,
    /// The item of each leaf.
    pub leaves: Buffer<u32>,
    /// Inner nodes and topology.
    pub trees: Trees,
    /// Axis-aligned box of each inner node, by slot.
    pub aabbs: Buffer<Aabb>,
    /// Volume of each inner node, by slot; the axis-aligned box if an oriented one has no less area. `None` for
    /// [`Strategy::Aabb`].
    pub obbs: Option<Buffer<Obb>>,
}

impl Built {
    /// Builds the trees over `items`, all with the same dispatches.
    ///
    /// # Errors
    /// Out of memory, device lost, or an unsupported strategy.
    pub fn new(run: &mut Run<'_>, items: Items, config: BuildConfig) -> Result<Self, GpuError> {
        Self::with_topology(run, items, config, Topology::Radix)
    }

    /// [`Built::new`] for browsers.
    ///
    /// # Errors
    /// As for [`Built::new`].
    pub async fn new_async(run: &mut Run<'_>, items: Items, config: BuildConfig) -> Result<Self, GpuError> {
        Self::with_topology_async(run, items, config, Topology::Radix).await
    }

    /// The same as [`Built::new`] with another topology.
    ///
    /// # Errors
    /// As for [`Built::new`].
    pub fn with_topology(
        run: &mut Run<'_>,
        items: Items,
        config: BuildConfig,
        topology: Topology,
    ) -> Result<Self, GpuError> {
        block_on(Self::with_topology_async(run, items, config, topology))
    }

    /// [`Built::with_topology`] for browsers.
    ///
    /// # Errors
    /// As for [`Built::new`].
    pub async fn with_topology_async(
        run: &mut Run<'_>,
        items: Items,
        config: BuildConfig,
        topology: Topology,
    ) -> Result<Self, GpuError> {
        let (leaves, trees, aabbs, obbs) = over(run, &items, config, topology).await?;
        Ok(Self { items, leaves, trees, aabbs, obbs })
    }

    /// Builds the trees again over the same items, whose vertices have moved.
    pub(crate) fn rebuild(&mut self, run: &mut Run<'_>, config: BuildConfig) -> Result<(), GpuError> {
        // What is recorded reads nothing back.
        (self.leaves, self.trees, self.aabbs, self.obbs) = block_on(over(run, &self.items, config, Topology::Radix))?;
        Ok(())
    }

    /// Computes oriented boxes again, if there are any, after the axis-aligned ones.
    pub(crate) fn refit_obbs(&mut self, run: &mut Run<'_>, config: BuildConfig) -> Result<(), GpuError> {
        let Self { items, leaves, trees, aabbs, obbs: old } = self;
        if config.strategy != Strategy::Aabb {
            *old = Some(obbs(run, items, leaves, trees, aabbs, config.strategy)?);
        }
        Ok(())
    }
}

/// All that is built over items: leaves, trees, axis-aligned and oriented boxes.
type Over = (Buffer<u32>, Trees, Buffer<Aabb>, Option<Buffer<Obb>>);

async fn over(run: &mut Run<'_>, items: &Items, config: BuildConfig, topology: Topology) -> Result<Over, GpuError> {
    let domains = domain(run, items, config.bits)?;
    let codes = codes(run, items, &domains, config.bits)?;
    let Sorted { codes, leaves } = sort(run, items, &codes)?;
    let (leaves, trees) = match topology {
        Topology::Radix => (leaves, tree(run, items, &codes)?),
        Topology::Ploc => ploc(run, items, &leaves).await?,
    };
    let aabbs = aabbs(run, items, &leaves, &trees)?;
    let obbs = match config.strategy {
        Strategy::Aabb => None,
        strategy => Some(obbs_async(run, items, &leaves, &trees, &aabbs, strategy).await?),
    };
    Ok((leaves, trees, aabbs, obbs))
}

/// Computes the axis-aligned boxes of the inner nodes over the items from `range[0]` to before `range[1]`, whole trees, again.
pub(crate) fn refit_aabbs(run: &mut Run<'_>, built: &Built, [first, end]: [u32; 2]) -> Result<(), GpuError> {
    let gpu = run.gpu();
    let Built { items, leaves, trees, aabbs, .. } = built;
    let bound = items.bound(&[("parents", &trees.parents), ("leaves", leaves), ("ends", aabbs)]);
    run.stage("aabb", |dispatches| {
        dispatches.work.clear_range(aabbs, first, end - first);
        let kernel = gpu.kernel("build/aabbs", &items.part())?;
        dispatches.range(&kernel, &bound, [first, end])
    })
}

/// A count as `u32`.
#[expect(clippy::cast_possible_truncation, reason = "bindings hold fewer than 2^32 values")]
pub(crate) fn count(n: usize) -> u32 {
    n as u32
}
