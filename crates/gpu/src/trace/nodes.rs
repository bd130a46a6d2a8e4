//! The nodes of BVHs in device memory: wide ones that the CPU built, and binary and wide ones that the device builds, and may write again.
//!
//! ```text
//! UploadedBvh of each mesh -> upload          -> WideNodes
//! trees of build::Built  -> build/scene/pairs       -> Pairs
//!                        -> build::WideBvhs   -> WideNodes
//! ```

use canted_shaders::{choice, wgsl};
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use canted_lbvh::{Bits, Corners, Strategy};

use super::driver::DriverScene;
use super::layout::{BvhHeader, EMPTY, HitError, LEAF, Quad, Start};
use super::leaf_curves::{CurveKernels, CurveKinds};
use super::leaf_triangles::UploadedBvh;
use super::packed::are_aligned;
use crate::build::{
    BuildConfig, BuildEncoder, Built, Change, Collapse, Primitives, Range, Which, WideBvhs, WideConfig, WideLevel,
    depth_bound,
};
use crate::{Buffer, Gpu, GpuError, NamedBinding, Variant};

/// Maximum stack size. Wide BVHs have about ten levels, binary ones about thirty.
pub(super) const MAX_STACK: u32 = 128;

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
/// | wide, axis-aligned | 2.8 million |
/// | wide with oriented nodes | 2.3 million |
/// | binary, axis-aligned | 2.1 million |
/// | binary, oriented | 1.0 million |
///
/// Wide BVHs hold at most 2^26 triangles. The used part of each of the program's vertex and index buffers must fit the limit, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceBvh {
    /// Binary BVHs, over a radix tree.
    Binary(BuildConfig),
    /// Eight-wide BVHs. [`WideConfig::topology`] is that of the first build. Recorded rebuilds use the radix tree, so [`Topology::Ploc`](crate::build::Topology::Ploc) serves only
    /// meshes that are refitted or do not change.
    Wide(WideConfig),
}

/// Least entries of a stack.
const LEAST_STACK: u32 = 16;

/// Entries of a stack for BVHs of a depth: few sizes, because a stack of another size is another kernel, which a driver compiles.
pub(super) fn stack_size(depth: u32) -> u32 {
    depth.next_power_of_two().max(LEAST_STACK)
}

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
    pub(super) fn build(self, build: &mut BuildEncoder<'_>, primitives: Primitives) -> Result<Built, GpuError> {
        let config = match self {
            Self::Binary(config) => config.into(),
            Self::Wide(config) => config,
        };
        Built::new(build, primitives, config)
    }

    /// Builds the tree of the top level over boxes that are not placed yet.
    pub(super) fn build_top(self, build: &mut BuildEncoder<'_>, n_instances: u32) -> Result<Built, GpuError> {
        let unplaced = Primitives::unplaced(build.gpu(), n_instances)?;
        Built::new(build, unplaced, self.top())
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
    /// That of the top level, if there is one, and of each tree over triangles.
    pub(super) headers: Vec<BvhHeader>,
}

impl NewNodes {
    /// Nodes over the trees in `bottom`, and over the tree in `top`.
    pub(super) fn new(
        build: &mut BuildEncoder<'_>,
        bvh: DeviceBvh,
        bottom: &Built,
        top: Option<&Built>,
    ) -> Result<Self, GpuError> {
        if let DeviceBvh::Binary(_) = bvh {
            let pairs = Pairs::new(build, bottom, top)?;
            let of_top = top.map(|top| binary_header(top.primitives.ranges()[0], bottom.primitives.len()));
            let of_bottom = bottom.primitives.ranges().iter().map(|&range| binary_header(range, 0));
            let headers = of_top.into_iter().chain(of_bottom).collect();
            return Ok(Self { nodes: Nodes::Binary(pairs), headers });
        }
        let bvhs = WideBvhs::new(build, bottom, top)?;
        let of_level = |level: &WideLevel| {
            let first_quad = level.first_quad;
            level.roots.clone().into_iter().map(move |root| BvhHeader::wide(root, first_quad))
        };
        // The top level is the last one, and its header the first.
        let headers = bvhs.levels.iter().rev().flat_map(of_level).collect();
        Ok(Self { nodes: Nodes::Wide(WideNodes::built(bvhs)), headers })
    }

    /// Depth of these BVHs, which is read back.
    ///
    /// # Errors
    /// As for [`Built::depth`].
    pub(super) async fn depth(&self, gpu: &Gpu, bottom: &Built, top: Option<&Built>) -> Result<u32, GpuError> {
        if let Nodes::Wide(WideNodes { collapse: Some(collapse), .. }) = &self.nodes {
            return Ok(collapse.depths(gpu, bottom).await?.iter().sum());
        }
        let depths = [Some(bottom), top].into_iter().flatten().map(|built| built.trees.depth.slot(0, 1));
        let depths = gpu.read_slots(&depths.collect::<Vec<_>>()).await?;
        bottom.check_depth(depths[0])?;
        Ok(depths.iter().sum())
    }

    /// Greatest depth of these BVHs and of any that the device builds in their place. Read back is only that of clustered trees.
    ///
    /// # Errors
    /// As for [`Built::depth`].
    pub(super) async fn depth_bound(
        &self,
        gpu: &Gpu,
        bvh: DeviceBvh,
        bottom: &Built,
        top: Option<&Built>,
    ) -> Result<u32, GpuError> {
        let most = bottom.primitives.ranges().iter().map(|range| range.count).max().unwrap_or(0);
        let n_top = top.map_or(0, |top| top.primitives.len());
        let of_any = bvh.depth(most, n_top);
        match &self.nodes {
            // A clustered tree may be deeper than a radix tree.
            Nodes::Wide(WideNodes { collapse: Some(collapse), .. }) if bottom.trees.is_clustered => {
                Ok(of_any.max(collapse.depths(gpu, bottom).await?[0] + depth_bound(n_top, TOP_BITS)))
            }
            _ => Ok(of_any),
        }
    }
}

/// The header of a binary BVH whose level starts at `first_node`.
fn binary_header(range: Range, first_node: u32) -> BvhHeader {
    let root = match range.count {
        0 => EMPTY,
        1 => LEAF | range.first,
        _ => first_node + range.first,
    };
    BvhHeader::binary(root, range.first)
}

/// The nodes and triangles of all BVHs.
pub(super) enum Nodes {
    /// Eight-wide BVHs.
    Wide(WideNodes),
    /// Binary BVHs.
    Binary(Pairs),
    /// Structures of the driver.
    Driver(DriverScene),
}

impl Nodes {
    /// Writes the nodes of a range of trees of a level again, which have changed.
    pub(super) fn put_again(
        &self,
        build: &mut BuildEncoder<'_>,
        (which, built): (Which, &Built),
        trees: [u32; 2],
        change: Change,
    ) -> Result<(), GpuError> {
        match self {
            Self::Binary(pairs) => pairs.put(build, which, built, built.primitives.of_trees(trees)),
            Self::Wide(wide) => wide.put_again(build, (which, built), trees, change),
            // Not reached: scenes over buffers of a program have none.
            Self::Driver(_) => Err(GpuError::Unsupported { what: "an update of structures of the driver".to_owned() }),
        }
    }

    /// Writes the nodes only once.
    pub(super) fn without_updates(self) -> Self {
        match self {
            Self::Wide(wide) => Self::Wide(WideNodes { collapse: None, ..wide }),
            others => others,
        }
    }

    /// Whether the device never writes them again.
    pub(super) fn are_final(&self) -> bool {
        matches!(self, Self::Wide(WideNodes { collapse: None, .. }))
    }

    pub(super) fn bindings(&self) -> Vec<NamedBinding<'_>> {
        match self {
            Self::Wide(wide) => wide.bindings(),
            Self::Binary(pairs) => pairs.bindings(),
            Self::Driver(scene) => vec![("driver_scene", scene)],
        }
    }

    pub(super) fn specialize(&self, chosen: Variant) -> Variant {
        match self {
            Self::Wide(wide) => wide.specialize(chosen),
            Self::Binary(pairs) => pairs.specialize(chosen),
            // It has no choices: kernels that use `shared/traverse` are without a traversal.
            Self::Driver(_) => chosen,
        }
    }

    /// Which curves some BVHs are over.
    pub(super) fn curves(&self) -> CurveKinds {
        match self {
            Self::Wide(WideNodes { curves, .. }) => *curves,
            Self::Binary(_) | Self::Driver(_) => CurveKinds::default(),
        }
    }

    pub(super) fn n_bytes(&self) -> u64 {
        match self {
            Self::Wide(wide) => wide.n_bytes(),
            Self::Binary(pairs) => pairs.n_bytes(),
            Self::Driver(_) => 0,
        }
    }

    /// Whether boxes of the top level are oriented.
    pub(super) fn top_is_oriented(&self) -> bool {
        match self {
            Self::Binary(pairs) => pairs.is_oriented(),
            Self::Wide(_) | Self::Driver(_) => false,
        }
    }
}

/// Binary trees in the form that rays traverse: `build/scene/pairs`.
pub(super) struct Pairs {
    pub(super) pairs: Buffer<Quad>,
    /// Vertices of the triangles.
    pub(super) corners: Arc<Buffer<Corners>>,
    pub(super) is_oriented: bool,
    /// First node of the second level.
    first_top_node: u32,
}

/// `Level` of `build/scene/pairs`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct TargetLevel {
    first_node: u32,
}

impl Pairs {
    /// Converts trees, whose nodes are numbered one level after another. The first level is over triangles.
    fn new(build: &mut BuildEncoder<'_>, first: &Built, second: Option<&Built>) -> Result<Self, GpuError> {
        let gpu = build.gpu();
        let Some(corners) = first.primitives.corners() else {
            return Err(GpuError::Input { message: "the first level is not over triangles".to_owned() });
        };
        let is_oriented = first.obbs.is_some();
        let first_top_node = first.primitives.len();
        let n_nodes = first_top_node + second.map_or(0, |built| built.primitives.len());
        let quads = if is_oriented { 8 } else { 4 };
        let pairs = gpu.zeroed("binary nodes", n_nodes as usize * quads)?;
        let corners = corners.clone();
        let pairs = Self { pairs, corners, is_oriented, first_top_node };
        pairs.put(build, Which::Bottom, first, [0, first.primitives.len()])?;
        if let Some(second) = second {
            pairs.put(build, Which::Top, second, [0, second.primitives.len()])?;
        }
        Ok(pairs)
    }

    /// Converts a range of primitives of a level: whole trees.
    fn put(
        &self,
        build: &mut BuildEncoder<'_>,
        which: Which,
        built: &Built,
        primitives: [u32; 2],
    ) -> Result<(), GpuError> {
        let gpu = build.gpu();
        let first_node = if which == Which::Top { self.first_top_node } else { 0 };
        let level = gpu.uniform("level", &TargetLevel { first_node })?;
        let (part, volumes): (_, NamedBinding<'_>) = match &built.obbs {
            None => (choice::Pair::Aabb, ("aabbs", &built.aabbs)),
            Some(obbs) => (choice::Pair::Obb, ("obbs", obbs)),
        };
        let bound = built.primitives.bound(&[
            volumes,
            ("nodes", &built.trees.nodes),
            ("leaves", &built.leaves),
            ("pairs", &self.pairs),
            ("target_level", &level),
        ]);
        build.stage("pairs", |dispatches| {
            let kernel = gpu.kernel(wgsl::build::scene::PAIRS, &built.primitives.part().with(part))?;
            dispatches.range(&kernel, &bound, primitives)
        })
    }

    fn is_oriented(&self) -> bool {
        self.is_oriented
    }

    fn bindings(&self) -> Vec<NamedBinding<'_>> {
        vec![("nodes", &self.pairs), ("corners", &*self.corners)]
    }

    fn specialize(&self, chosen: Variant) -> Variant {
        let volume = if self.is_oriented { choice::Volume::Obb } else { choice::Volume::Aabb };
        chosen.with(choice::Traverse::Binary).with(volume)
    }

    fn n_bytes(&self) -> u64 {
        self.pairs.n_bytes() + self.corners.n_bytes()
    }
}

/// Nodes and triangles of wide BVHs.
pub(super) struct WideNodes {
    pub(super) nodes: Buffer<Quad>,
    /// Three quads for each triangle.
    pub(super) triangles: Buffer<Quad>,
    /// Whether all nodes are aligned.
    is_aligned: bool,
    /// Which curves some BVHs are over.
    pub(super) curves: CurveKinds,
    /// What it takes to write them again, where the device does.
    collapse: Option<Collapse>,
}

impl WideNodes {
    /// Uploads BVHs that the CPU built, some of which may be over curves; also returns their headers.
    pub(super) fn uploaded(
        gpu: &Gpu,
        bvhs: &[(UploadedBvh<'_>, HitError)],
        curves: CurveKinds,
    ) -> Result<(Self, Vec<BvhHeader>), GpuError> {
        let nodes: Vec<&[Quad]> = bvhs.iter().map(|(bvh, _)| quads(&bvh.words.nodes)).collect();
        let triangles: Vec<&[Quad]> = bvhs.iter().map(|(bvh, _)| bvh.triangles.as_flattened()).collect();
        let mut start = Start::default();
        let headers = bvhs.iter().zip(&nodes).zip(&triangles).map(|(((bvh, error), nodes), triangles)| {
            let header = BvhHeader::new(&bvh.words, start, *error);
            start = start.after(n_quads(gpu, nodes), n_quads(gpu, triangles));
            header
        });
        let headers: Vec<BvhHeader> = headers.collect();
        let wide = Self {
            nodes: joined(gpu, "nodes", &nodes)?,
            triangles: joined(gpu, "triangles of leaves", &triangles)?,
            is_aligned: bvhs.iter().all(|(bvh, _)| are_aligned(&bvh.words.nodes, bvh.words.root)),
            curves,
            collapse: None,
        };
        Ok((wide, headers))
    }

    /// Those that the device built, and can write again.
    fn built(bvhs: WideBvhs) -> Self {
        let WideBvhs { nodes, triangles, is_oriented, collapse, .. } = bvhs;
        Self { nodes, triangles, is_aligned: !is_oriented, curves: CurveKinds::default(), collapse: Some(collapse) }
    }

    /// Writes those of a range of trees of a level again.
    ///
    /// # Errors
    /// They are not [`Self::built`], or the device is lost.
    fn put_again(
        &self,
        build: &mut BuildEncoder<'_>,
        level: (Which, &Built),
        trees: [u32; 2],
        change: Change,
    ) -> Result<(), GpuError> {
        let Some(collapse) = &self.collapse else {
            return Err(GpuError::Unsupported { what: "an update of wide BVHs that were built once".to_owned() });
        };
        collapse.put_again(build, level, (&self.nodes, &self.triangles), (trees, change))
    }

    fn bindings(&self) -> Vec<NamedBinding<'_>> {
        vec![("nodes", &self.nodes), ("leaf_triangles", &self.triangles)]
    }

    fn specialize(&self, chosen: Variant) -> Variant {
        let kinds = if self.is_aligned { choice::NodeKinds::Aligned } else { choice::NodeKinds::Any };
        let traverse = match self.curves.kernels {
            CurveKernels::None => choice::Traverse::Wide,
            CurveKernels::Segments => choice::Traverse::Curves,
            CurveKernels::Kinds => choice::Traverse::Kinds,
            CurveKernels::Patches => choice::Traverse::Patches,
        };
        chosen.with(kinds).with(traverse)
    }

    fn n_bytes(&self) -> u64 {
        self.nodes.n_bytes() + self.triangles.n_bytes()
    }
}

impl Start {
    /// Start of the BVH after one with so many quads of nodes and of triangles.
    fn after(self, nodes: usize, triangles: usize) -> Self {
        Self { node: self.node.wrapping_add(nodes as u32), triangle: self.triangle.wrapping_add(triangles as u32) }
    }
}

/// Quads that any BVH has room for in a sequence of frames.
const LEAST_ROOM: usize = 4;

/// Quads that a BVH with these gets: in a sequence of frames some more than it has, so that those after it stay in their places
/// while it changes.
fn n_quads(gpu: &Gpu, quads: &[Quad]) -> usize {
    let n = quads.len();
    if gpu.keeps_buffers() { n.next_multiple_of((n.next_power_of_two() / 8).max(LEAST_ROOM)) } else { n }
}

/// The quads of all BVHs, each in its place.
fn joined(gpu: &Gpu, what: &str, parts: &[&[Quad]]) -> Result<Buffer<Quad>, GpuError> {
    if let ([one], false) = (parts, gpu.keeps_buffers()) {
        return gpu.buffer(what, one);
    }
    let mut all: Vec<Quad> = Vec::with_capacity(parts.iter().map(|part| n_quads(gpu, part)).sum());
    for part in parts {
        let end = all.len() + n_quads(gpu, part);
        all.extend_from_slice(part);
        all.resize(end, Quad::default());
    }
    gpu.read_only(what, &all)
}

/// Words in groups of four. Nodes have whole quads.
fn quads(words: &[u32]) -> &[Quad] {
    bytemuck::cast_slice(words)
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
        // Few primitives bound the depth, too.
        assert_eq!(DeviceBvh::default().depth(5, 1), 6);
    }
}
