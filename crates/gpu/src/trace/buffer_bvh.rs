//! Which BVHs are built over a program's buffers, and their nodes, which are written again when the buffers change.

use canted_lbvh::{Bits, Strategy};

use super::binary::{Pairs, header};
use super::layout::{BvhHeader, HitError};
use super::nodes::EMPTY;
use super::scene::{MAX_STACK, Nodes};
use super::wide::WideNodes;
use crate::build::{
    BuildConfig, Built, Change, Collapse, Items, Range, Run, Topology, WideConfig, WideTrees, depth_bound,
};
use crate::{Gpu, GpuError};

/// The BVHs over a program's buffers: [`BufferScene`](crate::BufferScene), [`InstancedScene`](crate::InstancedScene).
///
/// Tracing wide BVHs takes 0.5 to 0.8 of the time of binary ones on a software driver. Updating binary ones takes less. Either configuration
/// converts into this type. Codes of meshes have the configured length, or 30 bits if a ray's stack would otherwise exceed 128 levels, as for a
/// mesh of a million triangles and ten thousand instances. Codes of the top level always have 30 bits.
///
/// With the default limit of wgpu for a storage binding, 128 MiB, a scene holds about 1.7 million triangles in wide BVHs, 1.1 million with
/// oriented nodes; 2.1 million in binary BVHs, 1.0 million with oriented boxes. Request the limit of the adapter for more. Wide BVHs hold at most
/// 2^26 triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BufferBvh {
    /// Binary BVHs, over a radix tree.
    Binary(BuildConfig),
    /// Eight-wide BVHs. The topology is that of the first build; recorded builds use the radix tree.
    Wide(WideConfig),
}

/// Stacks have a multiple of so many entries, because a stack of another size is another kernel.
const DEPTH_STEP: u32 = 8;

/// The top level has short codes: its cells are still a thousandth of the scene, and the stack of a ray is shallower.
const TOP_BITS: Bits = Bits::B30;

impl Default for BufferBvh {
    fn default() -> Self {
        Self::Binary(BuildConfig::default())
    }
}

impl From<BuildConfig> for BufferBvh {
    fn from(config: BuildConfig) -> Self {
        Self::Binary(config)
    }
}

impl From<WideConfig> for BufferBvh {
    fn from(config: WideConfig) -> Self {
        Self::Wide(config)
    }
}

impl BufferBvh {
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

/// Nodes and headers of new BVHs, still without bounds in the headers, and how to write the nodes again.
pub(super) struct NewNodes {
    pub(super) nodes: Nodes,
    pub(super) headers: Vec<BvhHeader>,
    /// Greatest depth of this build and of any that is recorded later.
    pub(super) depth: u32,
    pub(super) writer: NodeWriter,
}

/// Writes nodes of changed trees.
pub(super) struct NodeWriter {
    collapse: Option<Collapse>,
    /// First node of the top level in binary BVHs.
    first_top_node: u32,
}

/// A level, by its position.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Which {
    /// Over triangles.
    Bottom,
    /// Over instances.
    Top,
}

impl NewNodes {
    /// Nodes over the trees in `bottom`, and over the tree in `top`. There is a header for the top level, for each tree over triangles
    /// and, with a top level, for an empty BVH.
    pub(super) async fn new(
        run: &mut Run<'_>,
        bvh: BufferBvh,
        bottom: &Built,
        top: Option<&Built>,
    ) -> Result<Self, GpuError> {
        let ranges = bottom.items.ranges();
        let most = ranges.iter().map(|range| range.count).max().unwrap_or(0);
        let n_top = top.map_or(0, |top| top.items.len());
        let bound = bvh.depth(most, n_top);
        let none = HitError::of_triangles(0.0);
        let first_top_node = bottom.items.len();
        let (nodes, of_top, of_bottom, depth, collapse) = match bvh {
            BufferBvh::Binary(_) => {
                let pairs = Pairs::new(run, bottom, top)?;
                let of = |range: Range, first: u32| header(range, first, 0.0, none, false);
                let of_top = top.map(|top| of(Range { first: 0, count: top.items.len() }, first_top_node));
                let of_bottom: Vec<_> = ranges.iter().map(|&range| of(range, 0)).collect();
                (Nodes::Binary(pairs), of_top, of_bottom, bound, None)
            }
            BufferBvh::Wide(_) => {
                let trees = WideTrees::new_async(run, bottom, top).await?;
                let of = |level: usize| {
                    let level = &trees.levels[level];
                    level.roots.iter().map(|&root| BvhHeader::wide(root, level.first_quad, 0.0, none))
                };
                let of_top = top.and_then(|_| of(1).next());
                let of_bottom: Vec<_> = of(0).collect();
                let depth = bound.max(trees.levels[0].depth + depth_bound(n_top, TOP_BITS));
                let (nodes, collapse) = WideNodes::rewritten(trees);
                (Nodes::Wide(nodes), of_top, of_bottom, depth, Some(collapse))
            }
        };
        let empty = top.map(|_| BvhHeader::binary(EMPTY, 0, 0.0, none));
        let headers = of_top.into_iter().chain(of_bottom).chain(empty).collect();
        let stepped = depth.next_multiple_of(DEPTH_STEP);
        let depth = if stepped <= MAX_STACK { stepped } else { depth };
        Ok(Self { nodes, headers, depth, writer: NodeWriter { collapse, first_top_node } })
    }
}

impl NodeWriter {
    /// Writes the nodes of a range of trees of a level into `nodes`.
    pub(super) fn put(
        &self,
        run: &mut Run<'_>,
        nodes: &Nodes,
        (which, built): (Which, &Built),
        trees: [u32; 2],
        change: Change,
    ) -> Result<(), GpuError> {
        match (nodes, &self.collapse) {
            (Nodes::Binary(pairs), _) => {
                let first_node = if which == Which::Top { self.first_top_node } else { 0 };
                pairs.put_again(run, built, first_node, built.items.of_trees(trees))
            }
            (Nodes::Wide(wide), Some(collapse)) => {
                let level = if which == Which::Top { 1 } else { 0 };
                collapse.put_again(run, built, level, wide.words(), (trees, change))
            }
            (Nodes::Wide(_), None) => Ok(()),
        }
    }

    /// Whether boxes of the top level are oriented.
    pub(super) fn top_is_oriented(nodes: &Nodes) -> bool {
        match nodes {
            Nodes::Binary(pairs) => pairs.is_oriented(),
            Nodes::Wide(_) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_short_only_where_the_stack_would_be_too_deep() {
        for bvh in [BufferBvh::default(), WideConfig::default().into()] {
            assert_eq!(bvh.shallow(1 << 20, 1000), bvh);
            let shallow = bvh.shallow(1 << 20, 10_000);
            assert_eq!(shallow.bottom().bits, Bits::B30);
            assert!(bvh.depth(1 << 20, 10_000) > MAX_STACK && shallow.depth(1 << 20, 10_000) <= MAX_STACK);
            // The most triangles and instances that are supported.
            assert!(bvh.shallow(1 << 26, 1 << 26).depth(1 << 26, 1 << 26) <= MAX_STACK);
        }
        // Few items bound the depth, too.
        assert_eq!(BufferBvh::default().depth(5, 1), 6);
    }
}
