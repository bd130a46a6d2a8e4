//! The stages up to the topology. Their integers equal the CPU's.

use bytemuck::{Pod, Zeroable};
use canted_lbvh::Bits;
use canted_shaders::{choice, wgsl};

use super::primitives::count;
use super::sort::{Counts, Sorter, tiled};
use super::{BuildEncoder, Primitives};
use crate::{Buffer, Gpu, GpuError, NamedBinding, Variant};

/// The grid of a tree, as [`canted_lbvh::Domain`].
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Grid {
    /// Minimum coordinates, times the number of points summed per primitive.
    pub offset: [f32; 3],
    /// Cells per unit of that sum.
    pub scale: f32,
}

/// Morton codes in one or two words.
pub struct Codes {
    /// Low words.
    pub low: Buffer<u32>,
    /// High words of 63-bit codes.
    pub high: Option<Buffer<u32>>,
}

/// Primitives sorted by Morton code, tree by tree.
pub struct Sorted {
    /// Codes, in ascending order within a tree.
    pub codes: Codes,
    /// The primitive of each leaf.
    pub leaves: Buffer<u32>,
}

/// An inner node. Indices count over all trees of the level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// Left child: a slot, or the position of a leaf with the highest bit set.
    pub left: u32,
    /// Right child.
    pub right: u32,
    /// First leaf below.
    pub first: u32,
    /// Last leaf below, inclusive.
    pub last: u32,
}

/// The trees of a level.
pub struct Trees {
    /// Inner nodes by slot; see [`super::Range`].
    pub nodes: Buffer<Node>,
    /// Parents of inner nodes by slot, followed by parents of leaves by position; `u32::MAX` for a root.
    pub parents: Buffer<u32>,
    /// Height of each inner node, in nodes including the leaf; 0 for an empty slot.
    pub heights: Buffer<u32>,
    /// Maximum depth over all trees, in nodes including the leaf; 0 without primitives.
    pub depth: Buffer<u32>,
    /// Bound of the depth that follows from the number of primitives and the bits of their codes. Clustered trees may exceed it; see
    /// [`Built::depth`](super::Built::depth).
    pub max_height: u32,
    /// Whether the topology is that of [`Topology::Ploc`](super::Topology::Ploc).
    pub(crate) is_clustered: bool,
}

impl Trees {
    /// Trees over `n` primitives, still without nodes.
    pub(super) fn empty(gpu: &Gpu, n: usize, max_height: u32, is_clustered: bool) -> Result<Self, GpuError> {
        Ok(Self {
            max_height,
            is_clustered,
            nodes: gpu.zeroed("nodes", n)?,
            parents: gpu.zeroed("parents", 2 * n)?,
            heights: gpu.zeroed("heights", n)?,
            depth: gpu.zeroed("depth", 1)?,
        })
    }
}

impl Codes {
    fn empty(gpu: &Gpu, n: usize, bits: Bits) -> Result<Self, GpuError> {
        let high = match bits {
            Bits::B30 => None,
            Bits::B63 => Some(gpu.zeroed("high words of codes", n)?),
        };
        Ok(Self { low: gpu.zeroed("codes", n)?, high })
    }

    fn bits(&self) -> Bits {
        if self.high.is_some() { Bits::B63 } else { Bits::B30 }
    }

    /// The words from least to most significant, each with its number of bits.
    fn words(&self) -> Vec<(&Buffer<u32>, u32)> {
        match &self.high {
            None => vec![(&self.low, 30)],
            Some(high) => vec![(&self.low, 32), (high, 31)],
        }
    }

    /// The same and the trees, if there are several.
    fn with_trees<'a>(
        &'a self,
        primitives: &Primitives,
        trees: Option<&'a Buffer<u32>>,
    ) -> Vec<(&'a Buffer<u32>, u32)> {
        self.words().into_iter().chain(trees.map(|trees| (trees, primitives.tree_bits()))).collect()
    }

    fn bound<'a>(&'a self, low: &'static str, high: &'static str) -> Vec<NamedBinding<'a>> {
        let mut bound: Vec<NamedBinding<'a>> = vec![(low, &self.low)];
        if let Some(words) = &self.high {
            bound.push((high, words));
        }
        bound
    }
}

/// Greatest number of nodes between the root and a leaf, both counted: a level for each bit of a code and of a position, and no
/// more than there are leaves.
pub(crate) fn depth_bound(n: u32, bits: Bits) -> u32 {
    let code = if bits == Bits::B30 { 30 } else { 63 };
    let of_positions = n.saturating_sub(1).checked_ilog2().map_or(0, |log| log + 1);
    n.min(code + of_positions + 1)
}

/// `chosen` with the part for codes of this length.
fn coded(chosen: Variant, bits: Bits) -> Variant {
    chosen.with(match bits {
        Bits::B30 => choice::Code::Narrow,
        Bits::B63 => choice::Code::Wide,
    })
}

/// Computes the grid of each tree.
///
/// # Errors
/// Out of memory, or device lost.
pub fn domain(build: &mut BuildEncoder<'_>, primitives: &Primitives, bits: Bits) -> Result<Buffer<Grid>, GpuError> {
    let gpu = build.gpu();
    let n_trees = primitives.ranges().len();
    let bounds = bounds(build, primitives)?;
    let domains = gpu.zeroed("domains", n_trees)?;
    let bound = primitives.bound(&[("bounds", &bounds), ("domains", &domains)]);
    build.stage("domain", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::morton::DOMAIN, &coded(primitives.part(), bits))?;
        dispatches.items(&kernel, &bound, count(n_trees))
    })?;
    Ok(domains)
}

/// Computes the bounding box of each tree, from which its grid follows.
pub(super) fn bounds(build: &mut BuildEncoder<'_>, primitives: &Primitives) -> Result<Buffer<u32>, GpuError> {
    /// Primitives per work-group, as in `build/morton/bounds`.
    const TILE: u32 = 512;
    let gpu = build.gpu();
    let bounds = gpu.zeroed::<u32>("bounds of trees", 6 * primitives.ranges().len())?;
    let bound = primitives.bound(&[("bounds", &bounds)]);
    build.stage("domain", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::morton::BOUNDS, &primitives.part())?;
        dispatches.tiles(&kernel, &bound, [0, primitives.len().div_ceil(TILE)])
    })?;
    Ok(bounds)
}

/// What the grids of codes come from: a stage of their own, or the bounding boxes of the trees.
#[derive(Clone, Copy)]
pub(super) enum Grids<'a> {
    Given(&'a Buffer<Grid>),
    Of(&'a Buffer<u32>),
}

/// Computes one code per primitive, in input order.
///
/// # Errors
/// As for [`domain`].
pub fn codes(
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    domains: &Buffer<Grid>,
    bits: Bits,
) -> Result<Codes, GpuError> {
    codes_and_counts(build, primitives, Grids::Given(domains), bits).map(|(codes, _)| codes)
}

/// What the sort of codes needs beside them.
pub(super) struct Beside {
    counts: Counts,
    /// The tree of each primitive, where there are several.
    trees: Option<Buffer<u32>>,
}

/// The same, and what one [`sort_counted`] needs.
pub(super) fn codes_and_counts(
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    grids: Grids<'_>,
    bits: Bits,
) -> Result<(Codes, Beside), GpuError> {
    let gpu = build.gpu();
    let codes = Codes::empty(gpu, primitives.len() as usize, bits)?;
    let of_words = codes.words().into_iter().map(|(_, bits)| bits);
    let counts = Counts::new(gpu, primitives.len(), of_words.chain(tree_word_bits(primitives)))?;
    let digit = gpu.uniform("digit", &counts.first())?;
    let n_trees_of = tree_word_bits(primitives).map_or(0, |_| primitives.len() as usize);
    let trees = gpu.zeroed("trees of primitives", n_trees_of)?;
    let mut bound = primitives.bound(&codes.bound("codes_low", "codes_high"));
    let (grids, chosen): (NamedBinding<'_>, _) = match grids {
        Grids::Given(domains) => (("domains", domains), choice::Grids::Given),
        Grids::Of(bounds) => (("bounds", bounds), choice::Grids::Found),
    };
    let more: [NamedBinding<'_>; 4] = [grids, ("tree_indices", &trees), ("digit", &digit), ("counts", &counts.counts)];
    bound.extend(more);
    build.stage("codes", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::morton::CODES, &coded(tiled(primitives.part().with(chosen)), bits))?;
        dispatches.items(&kernel, &bound, primitives.len())
    })?;
    let trees = tree_word_bits(primitives).map(|_| trees);
    Ok((codes, Beside { counts, trees }))
}

/// Bits of the word of a key that is the tree, where there are several.
fn tree_word_bits(primitives: &Primitives) -> Option<u32> {
    Some(primitives.tree_bits()).filter(|&bits| bits > 0)
}

/// Sorts the primitives stably by tree and code.
///
/// # Errors
/// As for [`domain`].
pub fn sort(build: &mut BuildEncoder<'_>, primitives: &Primitives, codes: &Codes) -> Result<Sorted, GpuError> {
    let sorter = Sorter::new(build.gpu());
    let trees = tree_word_bits(primitives).map(|_| trees_of(build, primitives)).transpose()?;
    let leaves = sorter.sort(build, &codes.with_trees(primitives, trees.as_ref()))?;
    let low = sorter.gather(build, &codes.low, &leaves)?;
    let high = codes.high.as_ref().map(|high| sorter.gather(build, high, &leaves)).transpose()?;
    Ok(Sorted { codes: Codes { low, high }, leaves })
}

/// The same with what [`codes_and_counts`] wrote beside the codes.
pub(super) fn sort_counted(
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    codes: &Codes,
    Beside { counts, trees }: Beside,
) -> Result<Sorted, GpuError> {
    let sorter = Sorter::new(build.gpu());
    let order = sorter.sort_counted(build, &codes.with_trees(primitives, trees.as_ref()), counts)?;
    let (leaves, last_word) = order.into_items_and_keys();
    // The most significant word of a code is sorted already, unless the tree is more significant.
    let (low, high) = match (&codes.high, trees) {
        (None, None) => (last_word, None),
        (Some(_), None) => (sorter.gather(build, &codes.low, &leaves)?, Some(last_word)),
        (None, Some(_)) => (sorter.gather(build, &codes.low, &leaves)?, None),
        (Some(high), Some(_)) => {
            let [low, high] = sorter.gather_two(build, [&codes.low, high], &leaves)?;
            (low, Some(high))
        }
    };
    Ok(Sorted { codes: Codes { low, high }, leaves })
}

/// The tree of each primitive.
fn trees_of(build: &mut BuildEncoder<'_>, primitives: &Primitives) -> Result<Buffer<u32>, GpuError> {
    let gpu = build.gpu();
    let trees = gpu.zeroed("trees of primitives", primitives.len() as usize)?;
    let bound = primitives.bound(&[("tree_indices", &trees)]);
    build.stage("sort", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::topology::TREE_INDICES, &Variant::none())?;
        dispatches.items(&kernel, &bound, primitives.len())
    })?;
    Ok(trees)
}

/// Builds the radix tree over the sorted primitives of each tree.
///
/// # Errors
/// As for [`domain`].
pub fn tree(build: &mut BuildEncoder<'_>, primitives: &Primitives, sorted: &Codes) -> Result<Trees, GpuError> {
    let trees = topology(build, primitives, sorted)?;
    depths(build, primitives, &trees)?;
    Ok(trees)
}

/// The same without heights and depth, which [`aabbs_and_depths`](super::volumes::aabbs_and_depths) fills in.
pub(super) fn topology(
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    sorted: &Codes,
) -> Result<Trees, GpuError> {
    let gpu = build.gpu();
    let n = primitives.len() as usize;
    let most = primitives.ranges().iter().map(|range| range.count).max().unwrap_or(0);
    let trees = Trees::empty(gpu, n, depth_bound(most, sorted.bits()), false)?;
    let mut bound = primitives.bound(&sorted.bound("sorted_low", "sorted_high"));
    let made: [NamedBinding<'_>; 2] = [("nodes", &trees.nodes), ("parents", &trees.parents)];
    bound.extend(made);
    build.stage("tree", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::topology::TREE, &coded(Variant::none(), sorted.bits()))?;
        dispatches.items(&kernel, &bound, primitives.len())
    })?;
    Ok(trees)
}

/// Fills in the heights of nodes and the depth, from the parents.
fn depths(build: &mut BuildEncoder<'_>, primitives: &Primitives, trees: &Trees) -> Result<(), GpuError> {
    let gpu = build.gpu();
    let bound: [NamedBinding<'_>; 3] =
        [("parents", &trees.parents), ("heights", &trees.heights), ("depth", &trees.depth)];
    build.stage("tree", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::topology::HEIGHTS, &Variant::none())?;
        dispatches.items(&kernel, &bound, primitives.len())
    })
}
