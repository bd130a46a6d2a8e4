//! The stages up to the topology. Their integers equal the CPU's.

use bytemuck::{Pod, Zeroable};
use canted_lbvh::Bits;

use super::{Items, Run, Sorter, count};
use crate::{Buffer, Gpu, GpuError, NamedBinding, Specialisation};

/// The grid of a tree, as [`canted_lbvh::Domain`].
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Grid {
    /// Minimum coordinates, times the number of points summed per item.
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

/// Items sorted by Morton code, tree by tree.
pub struct Sorted {
    /// Codes, in ascending order within a tree.
    pub codes: Codes,
    /// The item of each leaf.
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
    /// Maximum depth over all trees, in nodes including the leaf; 0 without items.
    pub depth: Buffer<u32>,
    /// Bound of the depth that follows from the number of items and the bits of their codes.
    pub max_height: u32,
}

impl Trees {
    /// Trees over `n` items, still without nodes.
    pub(super) fn empty(gpu: &Gpu, n: usize, max_height: u32) -> Result<Self, GpuError> {
        Ok(Self {
            max_height,
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
fn coded(chosen: Specialisation, bits: Bits) -> Specialisation {
    chosen.part(
        "code",
        match bits {
            Bits::B30 => "shared/code/narrow",
            Bits::B63 => "shared/code/wide",
        },
    )
}

/// Computes the grid of each tree.
///
/// # Errors
/// Out of memory, or device lost.
pub fn domain(run: &mut Run<'_>, items: &Items, bits: Bits) -> Result<Buffer<Grid>, GpuError> {
    /// Items per work-group, as in `build/bounds.wgsl`.
    const TILE: u32 = 512;
    let gpu = run.gpu();
    let n_trees = items.ranges().len();
    let bounds = gpu.zeroed::<u32>("bounds of trees", 6 * n_trees)?;
    let domains = gpu.zeroed("domains", n_trees)?;
    let bound = items.bound(&[("bounds", &bounds), ("domains", &domains)]);
    run.stage("domain", |dispatches| {
        let kernel = gpu.kernel("build/bounds", &items.part())?;
        dispatches.tiles(&kernel, &bound, [0, items.len().div_ceil(TILE)])?;
        let kernel = gpu.kernel("build/domain", &coded(items.part(), bits))?;
        dispatches.items(&kernel, &bound, count(n_trees))
    })?;
    Ok(domains)
}

/// Computes one code per item, in input order.
///
/// # Errors
/// As for [`domain`].
pub fn codes(run: &mut Run<'_>, items: &Items, domains: &Buffer<Grid>, bits: Bits) -> Result<Codes, GpuError> {
    let gpu = run.gpu();
    let codes = Codes::empty(gpu, items.len() as usize, bits)?;
    let mut bound = items.bound(&codes.bound("codes_low", "codes_high"));
    bound.push(("domains", domains));
    run.stage("codes", |dispatches| {
        let kernel = gpu.kernel("build/codes", &coded(items.part(), bits))?;
        dispatches.items(&kernel, &bound, items.len())
    })?;
    Ok(codes)
}

/// Sorts the items stably by tree and code.
///
/// # Errors
/// As for [`domain`].
pub fn sort(run: &mut Run<'_>, items: &Items, codes: &Codes) -> Result<Sorted, GpuError> {
    let gpu = run.gpu();
    let sorter = Sorter::new(gpu)?;
    let trees = if items.tree_bits() > 0 { Some(trees_of(run, items)?) } else { None };
    let mut words = match &codes.high {
        None => vec![(&codes.low, 30)],
        Some(high) => vec![(&codes.low, 32), (high, 31)],
    };
    words.extend(trees.as_ref().map(|trees| (trees, items.tree_bits())));
    let leaves = sorter.sort(run, &words)?;
    let sorted = Codes {
        low: sorter.gather(run, &codes.low, &leaves)?,
        high: codes.high.as_ref().map(|high| sorter.gather(run, high, &leaves)).transpose()?,
    };
    Ok(Sorted { codes: sorted, leaves })
}

/// The tree of each item.
fn trees_of(run: &mut Run<'_>, items: &Items) -> Result<Buffer<u32>, GpuError> {
    let gpu = run.gpu();
    let trees = gpu.zeroed("trees of items", items.len() as usize)?;
    let bound = items.bound(&[("tree_indices", &trees)]);
    run.stage("sort", |dispatches| {
        let kernel = gpu.kernel("build/tree_indices", &Specialisation::none())?;
        dispatches.items(&kernel, &bound, items.len())
    })?;
    Ok(trees)
}

/// Builds the radix tree over the sorted items of each tree.
///
/// # Errors
/// As for [`domain`].
pub fn tree(run: &mut Run<'_>, items: &Items, sorted: &Codes) -> Result<Trees, GpuError> {
    let gpu = run.gpu();
    let n = items.len() as usize;
    let most = items.ranges().iter().map(|range| range.count).max().unwrap_or(0);
    let trees = Trees::empty(gpu, n, depth_bound(most, sorted.bits()))?;
    let mut bound = items.bound(&sorted.bound("sorted_low", "sorted_high"));
    let made: [NamedBinding<'_>; 2] = [("nodes", &trees.nodes), ("parents", &trees.parents)];
    bound.extend(made);
    run.stage("tree", |dispatches| {
        let kernel = gpu.kernel("build/tree", &coded(Specialisation::none(), sorted.bits()))?;
        dispatches.items(&kernel, &bound, items.len())
    })?;
    depths(run, items, &trees)?;
    Ok(trees)
}

/// Fills in the heights of nodes and the depth, from the parents.
pub(super) fn depths(run: &mut Run<'_>, items: &Items, trees: &Trees) -> Result<(), GpuError> {
    let gpu = run.gpu();
    let bound: [NamedBinding<'_>; 3] =
        [("parents", &trees.parents), ("heights", &trees.heights), ("depth", &trees.depth)];
    run.stage("tree", |dispatches| {
        let kernel = gpu.kernel("build/heights", &Specialisation::none())?;
        dispatches.items(&kernel, &bound, items.len())
    })
}
