//! The trees of a level: built, built again, refitted, and one of them replaced.

use bytemuck::{Pod, Zeroable};
use canted_lbvh::Strategy;
use canted_obb::{Aabb, Obb};
use canted_shaders::wgsl;

use super::ploc::{MAX_HEIGHT, ploc};
use super::primitives::Leaf;
use super::stages::{Grids, Sorted, Trees, bounds, codes_and_counts, sort_counted, topology};
use super::volumes::{aabbs_and_depths, obbs};
use super::{BuildConfig, BuildEncoder, Primitives, Range, Topology, WideConfig};
use crate::{Buffer, Gpu, GpuError, NamedBinding, Variant};

/// The trees of a level in device memory.
pub struct Built {
    /// What the trees are over.
    pub primitives: Primitives,
    /// The primitive of each leaf.
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
    /// Builds the trees over `primitives`, all with the same dispatches.
    ///
    /// # Errors
    /// Out of memory, device lost, or an unsupported strategy.
    pub fn new(
        build: &mut BuildEncoder<'_>,
        primitives: Primitives,
        config: impl Into<WideConfig>,
    ) -> Result<Self, GpuError> {
        let (leaves, trees, aabbs, obbs) = over(build, &primitives, config.into())?;
        Ok(Self { primitives, leaves, trees, aabbs, obbs })
    }

    /// Builds the trees again over the same primitives, whose vertices have moved.
    pub(crate) fn rebuild(&mut self, build: &mut BuildEncoder<'_>, config: BuildConfig) -> Result<(), GpuError> {
        (self.leaves, self.trees, self.aabbs, self.obbs) = over(build, &self.primitives, config.into())?;
        Ok(())
    }

    /// Computes oriented boxes again, if there are any, after the axis-aligned ones.
    pub(crate) fn refit_obbs(&mut self, build: &mut BuildEncoder<'_>, config: BuildConfig) -> Result<(), GpuError> {
        let Self { primitives, leaves, trees, aabbs, obbs: old } = self;
        if config.strategy != Strategy::Aabb {
            *old = Some(obbs(build, primitives, leaves, trees, aabbs, config.strategy)?);
        }
        Ok(())
    }
}

/// All that is built over primitives: leaves, trees, axis-aligned and oriented boxes.
type Over = (Buffer<u32>, Trees, Buffer<Aabb>, Option<Buffer<Obb>>);

fn over(build: &mut BuildEncoder<'_>, primitives: &Primitives, config: WideConfig) -> Result<Over, GpuError> {
    let bounds = bounds(build, primitives)?;
    let (codes, beside) = codes_and_counts(build, primitives, Grids::Of(&bounds), config.bits)?;
    let Sorted { codes, leaves } = sort_counted(build, primitives, &codes, beside)?;
    let (leaves, trees) = match config.topology {
        Topology::Radix => (leaves, topology(build, primitives, &codes)?),
        Topology::Ploc => ploc(build, primitives, &leaves)?,
    };
    let aabbs = aabbs_and_depths(build, primitives, &leaves, &trees)?;
    let obbs = match config.strategy {
        Strategy::Aabb => None,
        strategy => Some(obbs(build, primitives, &leaves, &trees, &aabbs, strategy)?),
    };
    Ok((leaves, trees, aabbs, obbs))
}

/// Computes the axis-aligned boxes of the inner nodes over the primitives from `range[0]` to before `range[1]`, whole trees, again.
pub(crate) fn refit_aabbs(build: &mut BuildEncoder<'_>, built: &Built, [first, end]: [u32; 2]) -> Result<(), GpuError> {
    let gpu = build.gpu();
    let Built { primitives, leaves, trees, aabbs, .. } = built;
    let bound = primitives.bound(&[("parents", &trees.parents), ("leaves", leaves), ("ends", aabbs)]);
    build.stage("aabb", |dispatches| {
        dispatches.work.clear_range(aabbs, first, end - first);
        let kernel = gpu.kernel(wgsl::build::volumes::AABBS, &primitives.part())?;
        dispatches.range(&kernel, &bound, [first, end])
    })
}

/// `Place` of `build/topology/adopt`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Place {
    first: u32,
}

impl Built {
    /// Builds tree `number` again over its primitives, whose vertices have moved. The other trees stay.
    pub(crate) fn rebuild_tree(
        &mut self,
        build: &mut BuildEncoder<'_>,
        number: usize,
        config: BuildConfig,
    ) -> Result<(), GpuError> {
        let gpu = build.gpu();
        let Range { first, count } = self.primitives.ranges()[number];
        if count == 0 {
            return Ok(());
        }
        let primitives = Primitives::unknown_triangles(gpu, vec![Range { first: 0, count }])?;
        let (Some(all), Some(own)) = (self.primitives.corners(), primitives.corners()) else { return Ok(()) };
        build.stage("corners", |dispatches| {
            dispatches.work.copy_range((&**all, first), (&**own, 0), count);
            Ok(())
        })?;
        let own = Self::new(build, primitives, config)?;
        self.adopt(build, &own, first)
    }

    /// Replaces the tree over the primitives from `first` on by one over as many primitives of its own.
    fn adopt(&self, build: &mut BuildEncoder<'_>, own: &Self, first: u32) -> Result<(), GpuError> {
        let gpu = build.gpu();
        let n = own.primitives.len();
        let place = gpu.uniform("place of a tree", &Place { first })?;
        let bound: [NamedBinding<'_>; 7] = [
            ("place", &place),
            ("own_nodes", &own.trees.nodes),
            ("own_parents", &own.trees.parents),
            ("own_leaves", &own.leaves),
            ("nodes", &self.trees.nodes),
            ("parents", &self.trees.parents),
            ("leaves", &self.leaves),
        ];
        build.stage("adopt", |dispatches| {
            let kernel = gpu.kernel(wgsl::build::topology::ADOPT, &Variant::none())?;
            dispatches.items(&kernel, &bound, n)?;
            let work = &mut dispatches.work;
            work.copy_range((&own.trees.heights, 0), (&self.trees.heights, first), n);
            work.copy_range((&own.aabbs, 0), (&self.aabbs, first), n);
            if let (Some(own), Some(all)) = (&own.obbs, &self.obbs) {
                work.copy_range((own, 0), (all, first), n);
            }
            Ok(())
        })
    }
}

impl Built {
    /// Reads back the greatest depth of the trees, in nodes including the leaf; 0 without primitives.
    ///
    /// # Errors
    /// Clustered trees of more than 127 levels, as degenerate input may give, whose boxes are not all computed; the device is lost.
    pub async fn depth(&self, gpu: &Gpu) -> Result<u32, GpuError> {
        let depth = gpu.read(&self.trees.depth).await?[0];
        self.check_depth(depth)?;
        Ok(depth)
    }

    /// Rejects clustered trees of a depth that is too large. That of other trees is bounded.
    pub(crate) fn check_depth(&self, depth: u32) -> Result<(), GpuError> {
        if self.trees.is_clustered && depth > MAX_HEIGHT {
            let what = format!("a clustered tree of {depth} levels, more than {MAX_HEIGHT}");
            return Err(GpuError::Unsupported { what });
        }
        Ok(())
    }

    /// Root box of each tree, in its own space; `None` for an empty tree.
    ///
    /// # Errors
    /// The device is lost.
    pub async fn roots(&self, gpu: &Gpu) -> Result<Vec<Option<Obb>>, GpuError> {
        let nodes = match &self.obbs {
            Some(obbs) => gpu.read_at(obbs, &self.firsts(|n| n > 1)).await?,
            None => gpu.read_at(&self.aabbs, &self.firsts(|n| n > 1)).await?.iter().map(Obb::from_aabb).collect(),
        };
        let single = self.firsts(|n| n == 1);
        let leaves = match &self.primitives.leaf {
            Leaf::Triangle { .. } => self.leaf_aabbs(gpu, &single).await?.iter().map(Obb::from_aabb).collect(),
            Leaf::Box { boxes, .. } => gpu.read_at(boxes, &single).await?,
        };
        Ok(self.of_roots(nodes, leaves))
    }

    /// Axis-aligned box of each tree, in its own space; empty for an empty tree.
    pub(crate) async fn root_aabbs(&self, gpu: &Gpu) -> Result<Vec<Aabb>, GpuError> {
        let nodes = gpu.read_at(&self.aabbs, &self.firsts(|n| n > 1)).await?;
        let leaves = self.leaf_aabbs(gpu, &self.firsts(|n| n == 1)).await?;
        Ok(self.of_roots(nodes, leaves).into_iter().map(|root| root.unwrap_or(Aabb::EMPTY)).collect())
    }

    async fn leaf_aabbs(&self, gpu: &Gpu, primitives: &[u32]) -> Result<Vec<Aabb>, GpuError> {
        match &self.primitives.leaf {
            Leaf::Triangle { corners } => {
                Ok(gpu.read_at(corners, primitives).await?.into_iter().map(Aabb::from_points).collect())
            }
            Leaf::Box { aabbs, .. } => gpu.read_at(aabbs, primitives).await,
        }
    }

    /// The first primitive of each tree with such a number of primitives. It is the slot of the root, too.
    fn firsts(&self, wanted: fn(u32) -> bool) -> Vec<u32> {
        self.primitives.ranges().iter().filter(|range| wanted(range.count)).map(|range| range.first).collect()
    }

    /// One value for each tree: from `nodes` for trees with several primitives, from `leaves` for trees with one.
    fn of_roots<T>(&self, nodes: Vec<T>, leaves: Vec<T>) -> Vec<Option<T>> {
        let (mut nodes, mut leaves) = (nodes.into_iter(), leaves.into_iter());
        let of_tree = |count: u32| match count {
            0 => None,
            1 => leaves.next(),
            _ => nodes.next(),
        };
        self.primitives.ranges().iter().map(|range| range.count).map(of_tree).collect()
    }
}
