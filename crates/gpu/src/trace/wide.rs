//! Wide BVHs: built by the CPU and uploaded, or built on the device.

use bytemuck::Pod;
use canted_tlas::Instance;
use canted_wide::{LaneKernel, RawBvh, TriangleBvh};

use super::coordinates::check_coordinates;
use super::layout::{BvhHeader, HitError, Quad, Start};
use super::level::{Instances, Level};
use super::nodes::{LINE_QUADS, is_aligned};
use super::scene::{Nodes, TracedScene, check_depth};
use super::top_level::{MeshBounds, TopLevel};
use crate::build::{Built, Change, Collapse, Run, Which, WideBvhs};
use crate::{Buffer, Gpu, GpuError, NamedBinding, Specialisation, wait::block_on};

/// Nodes and triangle blocks of wide BVHs.
pub(super) struct WideNodes {
    nodes: Buffer<Quad>,
    halves: Buffer<Quad>,
    /// Whether all nodes are aligned.
    is_aligned: bool,
    /// What it takes to write them again, where the device does.
    collapse: Option<Collapse>,
}

impl TracedScene {
    /// Uploads one BVH over the triangles of all instances, in world space. `first_triangles` are the indices of the first
    /// triangle of each instance, in order.
    ///
    /// # Errors
    /// Coordinates above [`MAX_COORDINATE`](crate::MAX_COORDINATE), a limit of the device, or device lost.
    pub fn single_level<K: LaneKernel>(
        gpu: &Gpu,
        bvh: &TriangleBvh<K>,
        first_triangles: &[u32],
    ) -> Result<Self, GpuError> {
        block_on(Self::single_level_async(gpu, bvh, first_triangles))
    }

    /// [`TracedScene::single_level`] for browsers.
    ///
    /// # Errors
    /// As for [`TracedScene::single_level`].
    pub async fn single_level_async<K: LaneKernel>(
        gpu: &Gpu,
        bvh: &TriangleBvh<K>,
        first_triangles: &[u32],
    ) -> Result<Self, GpuError> {
        let words = bvh.raw();
        check_coordinates(|| "the scene".to_owned(), words.reach.into())?;
        let error = HitError::of_triangles(words.reach);
        let depth = words.depth;
        uploaded(gpu, &[(words, error)], Level::flat(gpu, first_triangles)?, depth).await
    }

    /// Uploads one BVH per mesh, and builds and uploads a BVH over the instances.
    ///
    /// # Errors
    /// As for [`TracedScene::single_level`], including coordinates in world space; an instance without a BVH; or a transform
    /// that is too close to singular at any time, see
    /// [`MotionPolynomials::norm_of_inverse`](crate::MotionPolynomials::norm_of_inverse).
    pub fn two_level<K: LaneKernel>(
        gpu: &Gpu,
        meshes: &[&TriangleBvh<K>],
        instances: &[Instance],
    ) -> Result<Self, GpuError> {
        block_on(Self::two_level_async(gpu, meshes, instances))
    }

    /// [`TracedScene::two_level`] for browsers.
    ///
    /// # Errors
    /// As for [`TracedScene::two_level`].
    pub async fn two_level_async<K: LaneKernel>(
        gpu: &Gpu,
        meshes: &[&TriangleBvh<K>],
        instances: &[Instance],
    ) -> Result<Self, GpuError> {
        let words: Vec<RawBvh<'_>> = meshes.iter().map(|mesh| mesh.raw()).collect();
        let bounds: Vec<MeshBounds> = meshes
            .iter()
            .zip(&words)
            .map(|(mesh, words)| MeshBounds { reach: words.reach, aabb: mesh.aabb() })
            .collect();
        let outer = TopLevel::new(&bounds, instances)?;
        let outer_words = outer.bvh.raw();
        let level = Level::Two(Instances::new(gpu, &outer.packing, &outer.order(&outer_words))?);
        let deepest = words.iter().map(|words| words.depth).max().unwrap_or(0);
        let depth = outer_words.depth + deepest;
        let of_meshes = words.into_iter().map(|words| {
            let error = HitError::of_triangles(words.reach);
            (words, error)
        });
        let bvhs: Vec<_> = std::iter::once((outer_words, outer.packing.error)).chain(of_meshes).collect();
        uploaded(gpu, &bvhs, level, depth).await
    }
}

async fn uploaded(
    gpu: &Gpu,
    bvhs: &[(RawBvh<'_>, HitError)],
    level: Level,
    depth: u32,
) -> Result<TracedScene, GpuError> {
    check_depth(depth)?;
    let nodes: Vec<&[u32]> = bvhs.iter().map(|(words, _)| &*words.nodes).collect();
    let blocks: Vec<&[u32]> = bvhs.iter().map(|(words, _)| words.blocks).collect();
    let mut start = Start::default();
    let headers = bvhs.iter().map(|(words, error)| {
        let header = BvhHeader::new(words, start, *error);
        start = start.after(room(gpu, &words.nodes), room(gpu, words.blocks));
        header
    });
    let headers: Vec<BvhHeader> = headers.collect();
    let wide = WideNodes {
        nodes: joined(gpu, "nodes", &nodes)?,
        halves: joined(gpu, "triangle blocks", &blocks)?,
        is_aligned: bvhs.iter().all(|(words, _)| is_aligned(quads(&words.nodes), words.root)),
        collapse: None,
    };
    TracedScene::over(gpu, Nodes::Wide(wide), &headers, level, depth).await
}

impl WideNodes {
    /// Those that the device built.
    pub(super) fn built(bvhs: WideBvhs) -> Self {
        Self { collapse: None, ..Self::rewritten(bvhs) }
    }

    /// Those that the device built and writes again.
    pub(super) fn rewritten(bvhs: WideBvhs) -> Self {
        let WideBvhs { nodes, blocks, is_oriented, collapse, .. } = bvhs;
        Self { nodes, halves: blocks, is_aligned: !is_oriented, collapse: Some(collapse) }
    }

    /// Whether the device writes them again.
    pub(super) fn is_rewritten(&self) -> bool {
        self.collapse.is_some()
    }

    /// Writes those of a range of trees of a level again.
    ///
    /// # Errors
    /// They are not [`Self::rewritten`], or the device is lost.
    pub(super) fn put_again(
        &self,
        run: &mut Run<'_>,
        level: (Which, &Built),
        trees: [u32; 2],
        change: Change,
    ) -> Result<(), GpuError> {
        let Some(collapse) = &self.collapse else {
            return Err(GpuError::Unsupported { what: "an update of wide BVHs that were built once".to_owned() });
        };
        collapse.put_again(run, level, (&self.nodes, &self.halves), (trees, change))
    }

    pub(super) fn bindings(&self) -> Vec<NamedBinding<'_>> {
        vec![("nodes", &self.nodes), ("triangle_blocks", &self.halves)]
    }

    pub(super) fn specialise(&self, chosen: Specialisation) -> Specialisation {
        let kinds = if self.is_aligned { "shared/node_kinds/aligned" } else { "shared/node_kinds/any" };
        chosen.part("node_kinds", kinds).part("traverse", "shared/traverse/stack")
    }

    pub(super) fn n_bytes(&self) -> u64 {
        self.nodes.n_bytes() + self.halves.n_bytes()
    }
}

impl Start {
    /// Start of the BVH after one with so many quads of nodes and of blocks.
    #[expect(clippy::cast_possible_truncation, reason = "a buffer of more than 2^32 quads is rejected by its size")]
    fn after(self, nodes: usize, blocks: usize) -> Self {
        Self { node: self.node.wrapping_add(nodes as u32), block: self.block.wrapping_add(blocks as u32) }
    }
}

/// Quads that a BVH with these words gets: in a sequence of frames some more than it has, so that those after it stay in their places
/// while it changes.
fn room(gpu: &Gpu, words: &[u32]) -> usize {
    let n = quads(words).len();
    if gpu.keeps_buffers() { n.next_multiple_of((n.next_power_of_two() / 8).max(LINE_QUADS)) } else { n }
}

/// The words of all BVHs, each in its room.
fn joined(gpu: &Gpu, what: &str, parts: &[&[u32]]) -> Result<Buffer<Quad>, GpuError> {
    if let ([one], false) = (parts, gpu.keeps_buffers()) {
        return gpu.buffer(what, quads(one));
    }
    let mut all: Vec<Quad> = Vec::with_capacity(parts.iter().map(|part| room(gpu, part)).sum());
    for part in parts {
        let end = all.len() + room(gpu, part);
        all.extend_from_slice(quads(part));
        all.resize(end, Quad::default());
    }
    gpu.read_only(what, &all)
}

/// Words in groups of four. Lines and blocks contain whole quads.
fn quads<T: Pod>(words: &[T]) -> &[Quad] {
    bytemuck::cast_slice(words)
}
