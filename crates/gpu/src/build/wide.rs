//! Collapse of binary trees into eight-wide nodes.
//!
//! ```text
//! Built -> levels of wide nodes, from the roots -> order in memory -> nodes
//!       -> triangles in the order of leaves -----------------------> triangles
//! ```
//!
//! A wide node is opened by area: the child with the largest box is replaced by its two children until there are eight. The order
//! in memory follows the binary tree, so equal input gives equal words. A node is oriented where the boxes of its children, if
//! they have oriented ones, lower the predicted cost. Each tree has memory for the largest possible number of wide nodes, so a new
//! collapse does not move other trees.

use bytemuck::{Pod, Zeroable};
use canted_shaders::{Number, choice, wgsl};

use super::BuildEncoder;
use super::built::Built;
use super::encoder::{PassSize, Slice};
use super::primitives::{Range, count};
use super::sort::prefix_sums;
use crate::buffer::Slot;
use crate::{Buffer, Gpu, GpuError, NamedBinding, Variant};

/// Most triangles of a leaf: those that a ray tests at once.
pub const MAX_LEAF: u32 = 4;

/// Quads of a node, aligned and oriented, of the unit of node addresses, and of a triangle.
const ALIGNED_QUADS: u32 = 6;
const ORIENTED_QUADS: u32 = 16;
const ADDRESS_QUADS: u32 = 2;
const TRIANGLE_QUADS: usize = 3;

/// Eight-wide BVHs in device memory: those over triangles, then that over instances.
pub struct WideBvhs {
    /// Nodes, in quads of words.
    pub nodes: Buffer<[u32; 4]>,
    /// Triangles in the order of leaves, three quads each: a vertex in each, and the number in the last word of the first.
    pub triangles: Buffer<[u32; 4]>,
    /// The levels that were collapsed: over triangles, and over instances if there are any.
    pub levels: Vec<WideLevel>,
    /// Whether nodes over triangles may be oriented.
    pub is_oriented: bool,
    pub(crate) collapse: Collapse,
}

/// A level of wide trees.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WideLevel {
    /// The root's word of each tree.
    pub roots: Vec<u32>,
    /// First quad of the level in [`WideBvhs::nodes`], from which words count.
    pub first_quad: u32,
}

/// Which binary nodes are wide ones, for each level: what it takes to write nodes again after the binary trees have changed.
pub(crate) struct Collapse {
    levels: Vec<CollapsedLevel>,
}

/// A level of a scene's BVHs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Which {
    /// Over triangles.
    Bottom,
    /// Over instances.
    Top,
}

/// What changed in binary trees.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Change {
    /// Boxes.
    Boxes,
    /// Topology, leaves and boxes.
    Trees,
}

impl WideBvhs {
    /// Collapses the trees over triangles in `bottom`, and the tree over boxes of instances in `top`. Nodes over triangles are
    /// aligned, or oriented where `bottom` has oriented boxes; those over instances are aligned. Nothing is read back.
    ///
    /// # Errors
    /// Trees over boxes as `bottom`, more than 2^26 triangles, a limit of the device, or device lost.
    pub fn new(build: &mut BuildEncoder<'_>, bottom: &Built, top: Option<&Built>) -> Result<Self, GpuError> {
        let gpu = build.gpu();
        if bottom.primitives.corners().is_none() {
            return Err(GpuError::Input { message: "the first level is not over triangles".to_owned() });
        }
        let n = bottom.primitives.len();
        if n > 1 << 26 {
            return Err(GpuError::Unsupported { what: format!("a wide BVH over {n} triangles, more than 2^26") });
        }
        let mut n_quads = 0;
        let parts = [Some(bottom), top].into_iter().flatten().map(|built| {
            let first_quad = n_quads;
            let capacity = Capacity::of(built);
            n_quads += capacity.n_units() * capacity.unit_quads();
            (built, capacity, first_quad)
        });
        let parts: Vec<_> = parts.collect();
        let nodes = gpu.zeroed("wide nodes", n_quads as usize)?;
        let triangles = gpu.zeroed("triangles of leaves", TRIANGLE_QUADS * n as usize)?;
        let mut collapse = Collapse { levels: vec![] };
        let mut levels = vec![];
        for (number, (built, capacity, first_quad)) in parts.into_iter().enumerate() {
            let roots = capacity.roots(built.primitives.ranges());
            let mut level = CollapsedLevel::new(gpu, built, capacity, first_quad)?;
            level.find(build, built, all(built))?;
            levels.push(WideLevel { roots, first_quad });
            collapse.levels.push(level);
            collapse.put(build, built, number, (&nodes, &triangles), (all(built), Change::Trees))?;
        }
        Ok(Self { nodes, triangles, levels, is_oriented: bottom.obbs.is_some(), collapse })
    }

    /// Reads back the depth of each level when it was first collapsed: the greatest number of nodes from a root to a leaf; 0 without nodes.
    ///
    /// # Errors
    /// The device is lost.
    pub async fn depths(&self, gpu: &Gpu) -> Result<Vec<u32>, GpuError> {
        Ok(self.collapse.depths_beside(gpu, None).await?.0)
    }
}

impl Collapse {
    /// As [`WideBvhs::depths`], of trees that were clustered from `bottom`, or others.
    ///
    /// # Errors
    /// As for [`Built::depth`].
    pub(crate) async fn depths(&self, gpu: &Gpu, bottom: &Built) -> Result<Vec<u32>, GpuError> {
        let (depths, of_binary) = self.depths_beside(gpu, Some(&bottom.trees.depth)).await?;
        bottom.check_depth(of_binary)?;
        Ok(depths)
    }

    /// The depth of each level and another one, in one read.
    async fn depths_beside(&self, gpu: &Gpu, other: Option<&Buffer<u32>>) -> Result<(Vec<u32>, u32), GpuError> {
        let of_levels = self.levels.iter().flat_map(|level| &level.passes).map(|pass| pass.slot(PassSize::DEPTH, 1));
        let slots: Vec<Slot<'_>> = of_levels.chain(other.map(|depth| depth.slot(0, 1))).collect();
        let mut words = gpu.read_slots(&slots).await?.into_iter();
        let of_level = |level: &CollapsedLevel| words.by_ref().take(level.passes.len()).max().unwrap_or(0);
        let depths = self.levels.iter().map(of_level).collect();
        Ok((depths, words.next().unwrap_or(0)))
    }

    /// Writes nodes and triangles of trees of a level again, after their binary trees have changed. Reads nothing back.
    pub(crate) fn put_again(
        &self,
        build: &mut BuildEncoder<'_>,
        (which, built): (Which, &Built),
        words: (&Buffer<[u32; 4]>, &Buffer<[u32; 4]>),
        (trees, change): ([u32; 2], Change),
    ) -> Result<(), GpuError> {
        let level = if which == Which::Top { 1 } else { 0 };
        if change == Change::Trees {
            self.levels[level].find_again(build, built, trees)?;
        }
        self.put(build, built, level, words, (trees, change))
    }

    /// Writes nodes and triangles.
    fn put(
        &self,
        build: &mut BuildEncoder<'_>,
        built: &Built,
        level: usize,
        (nodes, triangles): (&Buffer<[u32; 4]>, &Buffer<[u32; 4]>),
        (trees, change): ([u32; 2], Change),
    ) -> Result<(), GpuError> {
        self.levels[level].put(build, built, nodes, (trees, change))?;
        if built.primitives.corners().is_some() { put_triangles(build, built, triangles, trees) } else { Ok(()) }
    }
}

/// All trees of a level.
fn all(built: &Built) -> [u32; 2] {
    [0, super::count(built.primitives.ranges().len())]
}

fn put_triangles(
    build: &mut BuildEncoder<'_>,
    built: &Built,
    triangles: &Buffer<[u32; 4]>,
    trees: [u32; 2],
) -> Result<(), GpuError> {
    let gpu = build.gpu();
    let bound = built.primitives.bound(&[("leaves", &built.leaves), ("wide_triangles", triangles)]);
    build.stage("wide triangles", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::wide::TRIANGLES, &Variant::none())?;
        dispatches.range(&kernel, &bound, built.primitives.of_trees(trees))
    })
}

/// Children of a node.
const WIDTH: u32 = 8;

/// Invocations of a work-group that finds wide nodes, and of those of the last pass.
const GROUP: u32 = 64;
const LAST_GROUP: u32 = 256;

/// Most wide nodes of a level with which a work-group goes on, except in the last pass: those of the first four levels.
const MOST_OF_LEVEL: u32 = WIDTH.pow(SURE_LEVELS - 1);
const SURE_LEVELS: u32 = 4;

/// Most nodes of an invocation. Each takes about 44 turns of loops, and some drivers end loops of 65,535.
const NODES_EACH: u32 = 1000;

/// Passes of trees of which a work-group could find all nodes, but should not: one from the roots, one from many nodes below, and one for
/// what is left of trees that are not balanced.
const FEW_PASSES: u32 = 3;

/// Passes over trees of which none has more than `most` wide nodes, or `most_levels` levels. Few trees need the last ones, which then have
/// no work-groups.
fn n_passes(most: u32, most_levels: u32) -> u32 {
    match most {
        0 => 0,
        _ if most <= LAST_GROUP => 1,
        _ if most <= LAST_GROUP * NODES_EACH => FEW_PASSES,
        // Each but the last finds `SURE_LEVELS` levels of what the one before left, and the last one no more than that.
        _ => most_levels.div_ceil(SURE_LEVELS).max(FEW_PASSES),
    }
}

/// `Limits` of `build/wide/levels`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Limits {
    most: u32,
}

/// `Level` of `shared/build/wide_target`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct TargetLevel {
    first_quad: u32,
    is_top: u32,
}

/// The wide nodes of a level.
struct CollapsedLevel {
    capacity: Capacity,
    first_units: Buffer<u32>,
    /// The level's first quad among those of all levels.
    first_quad: u32,
    /// The kind of the wide node of each slot, except for roots, and its word.
    kinds: Buffer<u32>,
    words: Buffer<u32>,
    /// The slot of each wide node, by its unit, plus one.
    slots: Buffer<u32>,
    /// The children of each wide node, by its unit.
    children: Buffer<[u32; WIDTH as usize]>,
    /// The number of wide nodes before each slot. Kept, because several trees may be recorded into one encoder.
    prefixes: Buffer<u32>,
    /// What the passes of the first search found, with the depth.
    passes: Vec<Buffer<PassSize>>,
}

impl CollapsedLevel {
    /// A level that is not collapsed yet.
    fn new(gpu: &Gpu, built: &Built, capacity: Capacity, first_quad: u32) -> Result<Self, GpuError> {
        let n = built.primitives.len() as usize;
        Ok(Self {
            first_units: gpu.buffer("first units of trees", &capacity.first_units)?,
            kinds: gpu.zeroed("kinds of wide nodes", n)?,
            words: gpu.zeroed("words of wide nodes", n)?,
            slots: gpu.zeroed("slots of wide nodes", capacity.n_units() as usize)?,
            children: gpu.zeroed("children of wide nodes", capacity.n_units() as usize)?,
            prefixes: gpu.zeroed("wide nodes before each", n)?,
            passes: vec![],
            first_quad,
            capacity,
        })
    }

    /// Finds the wide nodes of trees.
    fn find(&mut self, build: &mut BuildEncoder<'_>, built: &Built, trees: [u32; 2]) -> Result<(), GpuError> {
        self.passes = self.search(build, built, trees)?;
        self.place(build, built, trees)
    }

    /// Finds the wide nodes of trees that have changed.
    fn find_again(&self, build: &mut BuildEncoder<'_>, built: &Built, trees: [u32; 2]) -> Result<(), GpuError> {
        let [first, end] = built.primitives.of_trees(trees);
        let units = self.capacity.units(trees);
        build.stage("collapse", |dispatches| {
            dispatches.work.clear_range(&self.kinds, first, end - first);
            dispatches.work.clear_range(&self.slots, units[0], units[1] - units[0]);
            Ok(())
        })?;
        self.search(build, built, trees)?;
        self.place(build, built, trees)
    }

    /// Finds the wide nodes of trees, in passes whose sizes the device knows. Returns what each pass leaves to the next.
    fn search(
        &self,
        build: &mut BuildEncoder<'_>,
        built: &Built,
        [first, end]: [u32; 2],
    ) -> Result<Vec<Buffer<PassSize>>, GpuError> {
        let gpu = build.gpu();
        let ranges = &built.primitives.ranges()[first as usize..end as usize];
        let with_nodes = ranges.iter().filter(|range| range.count > self.capacity.max_leaf);
        let roots: Vec<[u32; 2]> = with_nodes.map(|range| [range.first, 0]).collect();
        let most_of_tree = ranges.iter().map(|&range| self.capacity.most(&[range])).max().unwrap_or(0);
        // No tree has more levels than leaves.
        let most_leaves = ranges.iter().map(|range| range.count).max().unwrap_or(0);
        let n_passes = n_passes(most_of_tree, built.trees.max_height.min(most_leaves));
        let n_queued = if n_passes > 1 { self.capacity.most(ranges) as usize } else { 0 };
        let queue = || gpu.zeroed::<[u32; 2]>("wide nodes of a pass", n_queued);
        let (n_roots, mut queue_in, mut queue_out) = (count(roots.len()), gpu.buffer("roots", &roots)?, queue()?);
        let found = gpu.zeroed::<u32>("wide nodes of subtrees", built.primitives.len() as usize)?;
        let all = gpu.uniform("slice", &Slice::ALL)?;
        let mut passes: Vec<Buffer<PassSize>> = vec![PassSize::buffer(gpu, n_roots)?];
        build.stage("collapse", |dispatches| {
            for pass in 0..n_passes {
                let is_last = pass + 1 == n_passes;
                let (most, group) = if is_last { (u32::MAX, LAST_GROUP) } else { (MOST_OF_LEVEL, GROUP) };
                let limits = gpu.uniform("limits of a pass", &Limits { most })?;
                let (pass_in, pass_out) = (&passes[passes.len() - 1], PassSize::buffer(gpu, 0)?);
                let bound: [NamedBinding<'_>; 10] = [
                    ("slice", &all),
                    ("nodes", &built.trees.nodes),
                    ("aabbs", &built.aabbs),
                    ("wide_limits", &limits),
                    ("queue_in", &queue_in),
                    ("queue_out", &queue_out),
                    ("pass_in", pass_in),
                    ("pass_out", &pass_out),
                    ("kinds", &self.kinds),
                    ("found", &found),
                ];
                let chosen =
                    Variant::none().number(Number::MaxLeaf, self.capacity.max_leaf).number(Number::Group, group);
                let kernel = gpu.kernel(wgsl::build::wide::LEVELS, &chosen)?;
                if pass == 0 {
                    dispatches.tiles(&kernel, &bound[1..], [0, n_roots])?;
                } else {
                    dispatches.work.dispatch_indirect(&kernel, &bound, pass_in, 0)?;
                }
                passes.push(pass_out);
                if pass == 0 && !is_last {
                    queue_in = queue()?;
                }
                std::mem::swap(&mut queue_in, &mut queue_out);
            }
            Ok(())
        })?;
        Ok(passes)
    }

    /// Gives the wide nodes of trees their kinds and places in memory.
    fn place(&self, build: &mut BuildEncoder<'_>, built: &Built, trees: [u32; 2]) -> Result<(), GpuError> {
        let gpu = build.gpu();
        let range = built.primitives.of_trees(trees);
        let bound = built.primitives.bound(&[
            ("kinds", &self.kinds),
            ("prefixes", &self.prefixes),
            ("first_units", &self.first_units),
            ("wide_words", &self.words),
            ("wide_slots", &self.slots),
            ("nodes", &built.trees.nodes),
            ("aabbs", &built.aabbs),
            ("leaves", &built.leaves),
        ]);
        build.stage("collapse", |dispatches| {
            let chosen = Variant::none().number(Number::MaxLeaf, self.capacity.max_leaf);
            // While all are aligned, which is 1.
            prefix_sums(dispatches, &self.kinds, &self.prefixes, range)?;
            if let Some(obbs) = built.obbs.as_ref().filter(|_| self.capacity.is_oriented) {
                let bound = [&bound[..], &[("obbs", obbs)]].concat();
                dispatches.range(&*gpu.kernel(wgsl::build::wide::KINDS, &chosen)?, &bound, range)?;
            }
            let chosen = chosen.number(Number::UnitQuads, self.capacity.unit_quads());
            dispatches.range(&*gpu.kernel(wgsl::build::wide::SLOTS, &chosen)?, &bound, range)
        })
    }

    /// Writes the nodes of trees, whose children are found anew if the trees changed.
    fn put(
        &self,
        build: &mut BuildEncoder<'_>,
        built: &Built,
        nodes: &Buffer<[u32; 4]>,
        (trees, change): ([u32; 2], Change),
    ) -> Result<(), GpuError> {
        let gpu = build.gpu();
        let is_top = u32::from(built.primitives.corners().is_none());
        let level = TargetLevel { first_quad: self.first_quad, is_top };
        let level = gpu.uniform("level of wide nodes", &level)?;
        let mut bound = built.primitives.bound(&[
            ("nodes", &built.trees.nodes),
            ("aabbs", &built.aabbs),
            ("leaves", &built.leaves),
            ("wide_words", &self.words),
            ("wide_slots", &self.slots),
            ("wide_children", &self.children),
            ("target_level", &level),
            ("wide_nodes", nodes),
        ]);
        let units = self.capacity.units(trees);
        build.stage("wide nodes", |dispatches| {
            let sized = |chosen: Variant| {
                chosen
                    .number(Number::MaxLeaf, self.capacity.max_leaf)
                    .number(Number::UnitQuads, self.capacity.unit_quads())
            };
            let children = match change {
                Change::Boxes => choice::Children::Kept,
                Change::Trees => choice::Children::Found,
            };
            let chosen = sized(built.primitives.part().with(children));
            dispatches.range(&*gpu.kernel(wgsl::build::wide::NODES, &chosen)?, &bound, units)?;
            let Some(obbs) = built.obbs.as_ref().filter(|_| self.capacity.is_oriented) else { return Ok(()) };
            bound.push(("obbs", obbs));
            let chosen = sized(Variant::none().with(choice::Children::Kept));
            dispatches.range(&*gpu.kernel(wgsl::build::wide::ORIENTED, &chosen)?, &bound, units)
        })
    }
}

/// As in `shared/bvh.wgsl`: a word that refers to nothing, the bit of leaves.
const EMPTY: u32 = 0x7fff_ffff;
const LEAF: u32 = 0x8000_0000;

/// Memory for the wide nodes of each tree of a level, and what is known of them before the collapse.
struct Capacity {
    /// Most primitives of a leaf.
    max_leaf: u32,
    is_oriented: bool,
    /// The first unit of each tree, and the end.
    first_units: Vec<u32>,
}

impl Capacity {
    fn of(built: &Built) -> Self {
        let (max_leaf, is_oriented) = match built.primitives.corners() {
            Some(_) => (MAX_LEAF, built.obbs.is_some()),
            None => (1, false),
        };
        let mut end = 0;
        let mut first_units = vec![0];
        for range in built.primitives.ranges() {
            end += 1 + most_nodes(range.count, max_leaf);
            first_units.push(end);
        }
        Self { max_leaf, is_oriented, first_units }
    }

    /// Quads of a unit of memory, in which any node of the level fits.
    fn unit_quads(&self) -> u32 {
        if self.is_oriented { ORIENTED_QUADS } else { ALIGNED_QUADS }
    }

    fn n_units(&self) -> u32 {
        self.first_units[self.first_units.len() - 1]
    }

    /// The units of a range of trees.
    fn units(&self, [first, end]: [u32; 2]) -> [u32; 2] {
        [self.first_units[first as usize], self.first_units[end as usize]]
    }

    /// Most wide nodes of a level of trees with these ranges.
    fn most(&self, ranges: &[Range]) -> u32 {
        ranges.iter().map(|range| most_nodes(range.count, self.max_leaf)).sum()
    }

    /// The root's word of each tree.
    fn roots(&self, ranges: &[Range]) -> Vec<u32> {
        let root = |(range, &first_unit): (&Range, &u32)| match range.count {
            0 => EMPTY,
            // As in `shared/build.wgsl`.
            n if n <= self.max_leaf => LEAF | (n - 1) << 26 | range.first,
            _ => self.unit_quads() / ADDRESS_QUADS * first_unit,
        };
        ranges.iter().zip(&self.first_units).map(root).collect()
    }
}

/// Most wide nodes over `n` primitives.
///
/// A node that is not full has leaves only and more than `max_leaf` primitives of its own. With `E` of those and `F` full ones over
/// `n` primitives, 7 F is less than the number of other nodes and leaves: `7 F < E + n - (max_leaf + 1) E`, and `E <= n / (max_leaf +
/// 1)`.
fn most_nodes(n: u32, max_leaf: u32) -> u32 {
    if n <= max_leaf {
        return 0;
    }
    let n = u64::from(n);
    let most_not_full = n / u64::from(max_leaf + 1);
    let more = u64::from((WIDTH - 1).saturating_sub(max_leaf)) * most_not_full;
    count(usize::try_from((n + more).div_ceil(u64::from(WIDTH - 1))).unwrap_or(usize::MAX))
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;

    use super::*;

    /// Wide nodes over a tree of `n` primitives whose shape and areas are random, opened as `shared/build.wgsl` does. A subtree is its
    /// number of primitives.
    fn collapsed(n: u32, max_leaf: u32, random: &mut SplitMix64, is_chain: bool) -> u32 {
        let mut open = vec![n];
        let mut n_nodes = 0;
        while let Some(n) = open.pop().filter(|&n| n > max_leaf) {
            n_nodes += 1;
            let mut children = vec![n];
            while children.len() < WIDTH as usize {
                let inner: Vec<usize> = (0..children.len()).filter(|&i| children[i] > max_leaf).collect();
                if inner.is_empty() {
                    break;
                }
                let n = children.swap_remove(inner[random.below(inner.len())]);
                let left = if is_chain { 1 } else { 1 + u32::try_from(random.below(n as usize - 1)).unwrap() };
                children.extend([left, n - left]);
            }
            open.extend(children.into_iter().filter(|&n| n > max_leaf));
        }
        n_nodes
    }

    #[test]
    fn no_collapse_exceeds_the_capacity() {
        let mut random = SplitMix64::new(11);
        let mut fullest = 0.0_f64;
        for round in 0..4000_u32 {
            let n = [round % 60, round % 977, 5 * (round % 13)][round as usize % 3];
            for max_leaf in [1, MAX_LEAF] {
                let n_nodes = collapsed(n, max_leaf, &mut random, round % 5 == 0);
                assert!(n_nodes <= most_nodes(n, max_leaf), "{n} primitives, leaves of {max_leaf}: {n_nodes} nodes");
                if n > 100 {
                    fullest = fullest.max(f64::from(n_nodes) / f64::from(most_nodes(n, max_leaf)));
                }
            }
        }
        // Half as much would not be enough.
        assert!(fullest > 0.5, "{fullest}");
    }
}
