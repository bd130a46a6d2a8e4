//! Which BVHs a device builds, and their nodes over a program's buffers, which are written again when the buffers change.

use canted_lbvh::{Bits, Strategy};

use super::binary::{Pairs, header};
use super::layout::{BvhHeader, HitError};
use super::nodes::EMPTY;
use super::scene::{MAX_STACK, Nodes};
use super::wide::WideNodes;
use crate::build::{BuildConfig, Built, Change, Items, Range, Run, Topology, Which, WideBvhs, WideConfig, depth_bound};
use crate::{Gpu, GpuError};

/// Which BVHs a device builds: for a [`BufferScene`](crate::BufferScene), an [`InstancedScene`](crate::InstancedScene) or the scene of a file.
///
/// A [`BuildConfig`] or a [`WideConfig`] converts into this type.
///
/// | choose | where |
/// |---|---|
/// | wide BVHs | a frame traces more than some 10,000 to 30,000 rays |
/// | binary BVHs | fewer rays than that |
/// | [`Strategy::Aabb`], the default | most scenes |
/// | [`Strategy::Combined`] | cables, trusses, hair: thin, diagonal geometry |
///
/// Measured on a software driver: with wide BVHs rays take 0.5 to 0.8 of the time, a rebuild of the bunny takes 71 instead of 43 ms, and a refit 13 instead
/// of 11 ms. With oriented boxes rays through a truss are three to five times as fast, and rays through a building up to a fifth slower.
///
/// `bits` is a request: meshes get codes of 30 bits where 63 could make a ray's stack exceed 128 levels, as with a million triangles in a mesh
/// and ten thousand instances. The top level always has codes of 30 bits.
///
/// The limit `max_storage_buffer_binding_size` bounds a scene. The default of wgpu is 128 MiB; request the limit of the adapter for more.
///
/// | BVHs | most triangles in 128 MiB |
/// |---|---|
/// | wide, axis-aligned | 1.7 million |
/// | wide with oriented nodes | 1.1 million |
/// | binary, axis-aligned | 2.1 million |
/// | binary, oriented | 1.0 million |
///
/// Wide BVHs hold at most 2^26 triangles. The used part of each of the program's vertex and index buffers must fit the limit, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceBvh {
    /// Binary BVHs, over a radix tree.
    Binary(BuildConfig),
    /// Eight-wide BVHs. [`WideConfig::topology`] is that of the first build. Recorded rebuilds use the radix tree, so [`Topology::Ploc`] serves only
    /// meshes that are refitted or do not change.
    Wide(WideConfig),
}

/// Stacks have a multiple of so many entries, because a stack of another size is another kernel.
const DEPTH_STEP: u32 = 8;

/// The top level has short codes: its cells are still a thousandth of the scene, and the stack of a ray is shallower.
const TOP_BITS: Bits = Bits::B30;

impl Default for DeviceBvh {
    fn default() -> Self {
        Self::Binary(BuildConfig::default())
    }
}

impl From<BuildConfig> for DeviceBvh {
    fn from(config: BuildConfig) -> Self {
        Self::Binary(config)
    }
}

impl From<WideConfig> for DeviceBvh {
    fn from(config: WideConfig) -> Self {
        Self::Wide(config)
    }
}

impl DeviceBvh {
    /// With shorter codes, if the stack of a ray would be too deep otherwise, for so many triangles in a mesh and so many instances.
    pub(super) fn shallow(mut self, n_triangles: u32, n_instances: u32) -> Self {
        if self.depth(n_triangles, n_instances) > MAX_STACK {
            match &mut self {
                Self::Binary(BuildConfig { bits, .. }) | Self::Wide(WideConfig { bits, .. }) => *bits = Bits::B30,
            }
        }
        self
    }

    /// Greatest depth of any build over so many triangles in a mesh and so many instances.
    fn depth(self, n_triangles: u32, n_instances: u32) -> u32 {
        depth_bound(n_triangles, self.bottom().bits) + depth_bound(n_instances, TOP_BITS)
    }

    /// Builds the binary trees of the bottom level.
    pub(super) async fn build(self, run: &mut Run<'_>, items: Items) -> Result<Built, GpuError> {
        let topology = match self {
            Self::Binary(_) => Topology::Radix,
            Self::Wide(config) => config.topology,
        };
        Built::with_topology_async(run, items, self.bottom(), topology).await
    }

    /// Builds the tree of the top level over boxes that are not placed yet.
    pub(super) async fn build_top(self, run: &mut Run<'_>, gpu: &Gpu, n_instances: u32) -> Result<Built, GpuError> {
        Built::new_async(run, Items::unplaced(gpu, n_instances)?, self.top()).await
    }

    /// How the trees of the bottom level are built.
    pub(super) fn bottom(self) -> BuildConfig {
        match self {
            Self::Binary(config) => config,
            Self::Wide(WideConfig { bits, strategy, .. }) => BuildConfig { bits, strategy },
        }
    }

    /// How the tree of the top level is built. Wide nodes over instances are aligned.
    pub(super) fn top(self) -> BuildConfig {
        let strategy = match self {
            Self::Binary(config) => config.strategy,
            Self::Wide(_) => Strategy::Aabb,
        };
        BuildConfig { bits: TOP_BITS, strategy }
    }
}

/// Nodes and headers of new BVHs, still without bounds in the headers.
pub(super) struct NewNodes {
    pub(super) nodes: Nodes,
    pub(super) headers: Vec<BvhHeader>,
    /// Greatest depth of this build and of any that is recorded later.
    pub(super) depth: u32,
}

impl NewNodes {
    /// Nodes over the trees in `bottom`, and over the tree in `top`. There is a header for the top level, for each tree over triangles
    /// and, with a top level, for an empty BVH.
    pub(super) async fn new(
        run: &mut Run<'_>,
        bvh: DeviceBvh,
        bottom: &Built,
        top: Option<&Built>,
    ) -> Result<Self, GpuError> {
        let ranges = bottom.items.ranges();
        let most = ranges.iter().map(|range| range.count).max().unwrap_or(0);
        let n_top = top.map_or(0, |top| top.items.len());
        let bound = bvh.depth(most, n_top);
        let none = HitError::of_triangles(0.0);
        let (nodes, of_top, of_bottom, depth) = match bvh {
            DeviceBvh::Binary(_) => {
                let pairs = Pairs::new(run, bottom, top)?;
                let of = |range: Range, first: u32| header(range, first, 0.0, none, false);
                let of_top = top.map(|top| of(Range { first: 0, count: top.items.len() }, bottom.items.len()));
                let of_bottom: Vec<_> = ranges.iter().map(|&range| of(range, 0)).collect();
                (Nodes::Binary(pairs), of_top, of_bottom, bound)
            }
            DeviceBvh::Wide(_) => {
                let bvhs = WideBvhs::new_async(run, bottom, top).await?;
                let of = |level: usize| {
                    let level = &bvhs.levels[level];
                    level.roots.iter().map(|&root| BvhHeader::wide(root, level.first_quad, 0.0, none))
                };
                let of_top = top.and_then(|_| of(1).next());
                let of_bottom: Vec<_> = of(0).collect();
                let depth = bound.max(bvhs.levels[0].depth + depth_bound(n_top, TOP_BITS));
                (Nodes::Wide(WideNodes::rewritten(bvhs)), of_top, of_bottom, depth)
            }
        };
        let empty = top.map(|_| BvhHeader::binary(EMPTY, 0, 0.0, none));
        let headers = of_top.into_iter().chain(of_bottom).chain(empty).collect();
        let stepped = depth.next_multiple_of(DEPTH_STEP);
        let depth = if stepped <= MAX_STACK { stepped } else { depth };
        Ok(Self { nodes, headers, depth })
    }
}

impl Nodes {
    /// Writes the nodes of a range of trees of a level again, which have changed.
    pub(super) fn put_again(
        &self,
        run: &mut Run<'_>,
        (which, built): (Which, &Built),
        trees: [u32; 2],
        change: Change,
    ) -> Result<(), GpuError> {
        match self {
            Self::Binary(pairs) => pairs.put(run, which, built, built.items.of_trees(trees)),
            Self::Wide(wide) => wide.put_again(run, (which, built), trees, change),
        }
    }

    /// Whether boxes of the top level are oriented.
    pub(super) fn top_is_oriented(&self) -> bool {
        match self {
            Self::Binary(pairs) => pairs.is_oriented(),
            Self::Wide(_) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_short_only_where_the_stack_would_be_too_deep() {
        for bvh in [DeviceBvh::default(), WideConfig::default().into()] {
            assert_eq!(bvh.shallow(1 << 20, 1000), bvh);
            let shallow = bvh.shallow(1 << 20, 10_000);
            assert_eq!(shallow.bottom().bits, Bits::B30);
            assert!(bvh.depth(1 << 20, 10_000) > MAX_STACK && shallow.depth(1 << 20, 10_000) <= MAX_STACK);
            // The most triangles and instances that are supported.
            assert!(bvh.shallow(1 << 26, 1 << 26).depth(1 << 26, 1 << 26) <= MAX_STACK);
        }
        // Few items bound the depth, too.
        assert_eq!(DeviceBvh::default().depth(5, 1), 6);
    }
}
