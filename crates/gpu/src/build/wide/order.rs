//! Which binary nodes become wide ones, and their order in memory.

use bytemuck::{Pod, Zeroable};

use super::super::prefix::prefix_sums;
use super::super::{Built, Run, count};
use super::room::Room;
use super::{UNIT_QUADS, all};
use crate::{Buffer, Gpu, GpuError, NamedBinding, Specialisation};

/// Levels per read-back.
const LEVELS_AT_ONCE: u32 = 8;

/// Most levels that are counted; deeper trees are rejected.
const MAX_LEVELS: u32 = 128;

/// Most children of the wide nodes of a level.
const WIDTH: u32 = 8;

/// Most invocations per level. The first `N_NEAR` levels may contain most nodes of a tree; few trees have deeper levels.
const NEAR_INVOCATIONS: u32 = 1 << 16;
const FAR_INVOCATIONS: u32 = 1 << 12;
const N_NEAR: u32 = 12;

/// Most nodes of an invocation. Each takes about 44 turns of loops, and some drivers end loops of 65,535.
const NODES_EACH: u32 = 1000;

/// `Level` of `build/wide_levels`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct QueueLevel {
    level: u32,
    n_first: u32,
    n_invocations: u32,
}

/// `Level` of `shared/build/wide_target`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct TargetLevel {
    first_unit: u32,
    is_top: u32,
}

/// The wide nodes of a level.
pub(super) struct Order {
    room: Room,
    first_units: Buffer<u32>,
    /// The level's first unit among those of all levels.
    first_unit: u32,
    /// Units of memory of the wide node of each slot, except for roots, and its word.
    units: Buffer<u32>,
    words: Buffer<u32>,
    /// The slot of each wide node, by its first unit, plus one.
    slots: Buffer<u32>,
    /// The children of each wide node, by its first unit.
    children: Buffer<[u32; WIDTH as usize]>,
    /// Units of memory of the wide nodes before each slot. Kept, because several trees may be recorded into one encoder.
    prefixes: Buffer<u32>,
}

impl Order {
    /// The order of a level that is not collapsed yet.
    pub(super) fn new(gpu: &Gpu, built: &Built, room: Room, first_unit: u32) -> Result<Self, GpuError> {
        let n = built.items.len() as usize;
        Ok(Self {
            first_units: gpu.buffer("first units of trees", &room.first_units)?,
            units: gpu.zeroed("sizes of wide nodes", n)?,
            words: gpu.zeroed("words of wide nodes", n)?,
            slots: gpu.zeroed("slots of wide nodes", room.n_units() as usize)?,
            children: gpu.zeroed("children of wide nodes", room.n_units() as usize)?,
            prefixes: gpu.zeroed("wide nodes before each", n)?,
            first_unit,
            room,
        })
    }

    /// Finds the wide nodes of all trees, and their depth, which is read back.
    pub(super) async fn count_and_find(&self, run: &mut Run<'_>, built: &Built) -> Result<u32, GpuError> {
        let trees = all(built);
        let mut search = Search::new(self, run.gpu(), built, trees)?;
        let mut depth = (search.n_first == 0).then_some(0);
        while depth.is_none() {
            if search.level >= MAX_LEVELS {
                let what = format!("a BVH of more than {MAX_LEVELS} levels");
                return Err(GpuError::Unsupported { what });
            }
            search.levels(run, LEVELS_AT_ONCE)?;
            depth = search.depth(run.gpu()).await?;
        }
        self.place(run, built, trees)?;
        Ok(depth.unwrap_or(0))
    }

    /// Finds the wide nodes of trees that have changed. The number of levels is not read back: there are as many as the binary trees
    /// may have.
    pub(super) fn find_again(&self, run: &mut Run<'_>, built: &Built, trees: [u32; 2]) -> Result<(), GpuError> {
        let [first, end] = built.items.of_trees(trees);
        let units = self.room.units(trees);
        run.stage("collapse", |dispatches| {
            dispatches.work.clear_range(&self.units, first, end - first);
            dispatches.work.clear_range(&self.slots, units[0], units[1] - units[0]);
            Ok(())
        })?;
        let mut search = Search::new(self, run.gpu(), built, trees)?;
        if search.n_first > 0 {
            // No tree has more levels than leaves.
            let ranges = &built.items.ranges()[trees[0] as usize..trees[1] as usize];
            let most = ranges.iter().map(|range| range.count).max().unwrap_or(0);
            search.levels(run, built.trees.max_height.min(most).min(MAX_LEVELS))?;
        }
        self.place(run, built, trees)
    }

    /// Gives the wide nodes of trees their kinds, places in memory and children.
    fn place(&self, run: &mut Run<'_>, built: &Built, trees: [u32; 2]) -> Result<(), GpuError> {
        let gpu = run.gpu();
        let range = built.items.of_trees(trees);
        let bound = built.items.bound(&[
            ("units", &self.units),
            ("prefixes", &self.prefixes),
            ("first_units", &self.first_units),
            ("wide_words", &self.words),
            ("wide_slots", &self.slots),
            ("nodes", &built.trees.nodes),
            ("aabbs", &built.aabbs),
            ("wide_children", &self.children),
        ]);
        run.stage("collapse", |dispatches| {
            let chosen = Specialisation::none().number("MAX_LEAF", self.room.max_leaf);
            if let Some(obbs) = built.obbs.as_ref().filter(|_| self.room.is_oriented) {
                let more: [NamedBinding<'_>; 2] = [("leaves", &built.leaves), ("obbs", obbs)];
                let bound = [&bound[..], &more].concat();
                dispatches.range(&*gpu.kernel("build/wide_kinds", &chosen)?, &bound, range)?;
            }
            prefix_sums(dispatches, &self.units, &self.prefixes, range)?;
            dispatches.range(&*gpu.kernel("build/wide_slots", &chosen)?, &bound, range)?;
            dispatches.range(&*gpu.kernel("build/wide_children", &chosen)?, &bound, self.room.units(trees))
        })
    }

    /// Writes the nodes of trees.
    pub(super) fn put(
        &self,
        run: &mut Run<'_>,
        built: &Built,
        nodes: &Buffer<[u32; 4]>,
        trees: [u32; 2],
    ) -> Result<(), GpuError> {
        const { assert!(UNIT_QUADS == 16, "the kernels write units of 64 words") };
        let gpu = run.gpu();
        let is_top = u32::from(built.items.corners().is_none());
        let level = TargetLevel { first_unit: self.first_unit, is_top };
        let level = gpu.uniform("level of wide nodes", &level)?;
        let mut bound = built.items.bound(&[
            ("nodes", &built.trees.nodes),
            ("aabbs", &built.aabbs),
            ("leaves", &built.leaves),
            ("wide_words", &self.words),
            ("wide_slots", &self.slots),
            ("wide_children", &self.children),
            ("target_level", &level),
            ("wide_nodes", nodes),
        ]);
        let units = self.room.units(trees);
        run.stage("wide nodes", |dispatches| {
            let max_leaf = Specialisation::none().number("MAX_LEAF", self.room.max_leaf);
            let chosen = built.items.part().number("MAX_LEAF", self.room.max_leaf);
            dispatches.range(&*gpu.kernel("build/wide_nodes", &chosen)?, &bound, units)?;
            let Some(obbs) = built.obbs.as_ref().filter(|_| self.room.is_oriented) else { return Ok(()) };
            bound.push(("obbs", obbs));
            dispatches.range(&*gpu.kernel("build/wide_oriented", &max_leaf)?, &bound, units)
        })
    }
}

/// The search for the wide nodes of trees, level by level from their roots.
struct Search<'a> {
    order: &'a Order,
    built: &'a Built,
    level: u32,
    n_first: u32,
    first: Buffer<u32>,
    queues: [Buffer<u32>; 2],
    /// Wide nodes of each level.
    counts: Buffer<u32>,
    /// Most wide nodes of this level, and of any.
    n_of_level: u32,
    most: u32,
}

impl<'a> Search<'a> {
    fn new(order: &'a Order, gpu: &Gpu, built: &'a Built, [first, end]: [u32; 2]) -> Result<Self, GpuError> {
        let ranges = &built.items.ranges()[first as usize..end as usize];
        let most = order.room.most(ranges);
        let with_nodes = ranges.iter().filter(|range| range.count > order.room.max_leaf);
        let roots: Vec<u32> = with_nodes.map(|range| range.first).collect();
        let queue = || gpu.zeroed("wide nodes of a level", most as usize);
        Ok(Self {
            order,
            built,
            level: 0,
            n_first: count(roots.len()),
            first: gpu.buffer("roots", &roots)?,
            queues: [queue()?, queue()?],
            counts: gpu.zeroed("wide nodes of levels", MAX_LEVELS as usize + 1)?,
            n_of_level: count(roots.len()),
            most,
        })
    }

    /// Searches so many levels.
    fn levels(&mut self, run: &mut Run<'_>, n_levels: u32) -> Result<(), GpuError> {
        let gpu = run.gpu();
        let chosen = Specialisation::none().number("MAX_LEAF", self.order.room.max_leaf);
        let kernel = gpu.kernel("build/wide_levels", &chosen)?;
        run.stage("collapse", |dispatches| {
            for _ in 0..n_levels {
                let level = self.level;
                let most = if level < N_NEAR { NEAR_INVOCATIONS } else { FAR_INVOCATIONS };
                let n_invocations = self.n_of_level.min(most.max(self.n_of_level.div_ceil(NODES_EACH)));
                let uniform = gpu.uniform("level", &QueueLevel { level, n_first: self.n_first, n_invocations })?;
                let [even, odd] = &self.queues;
                let (queue_in, queue_out) = if level.is_multiple_of(2) { (even, odd) } else { (odd, even) };
                let bound: [NamedBinding<'_>; 7] = [
                    ("nodes", &self.built.trees.nodes),
                    ("aabbs", &self.built.aabbs),
                    ("wide_level", &uniform),
                    ("queue_in", if level == 0 { &self.first } else { queue_in }),
                    ("queue_out", queue_out),
                    ("counts", &self.counts),
                    ("units", &self.order.units),
                ];
                dispatches.items(&kernel, &bound, n_invocations)?;
                self.n_of_level = self.n_of_level.saturating_mul(WIDTH).min(self.most);
                self.level += 1;
            }
            Ok(())
        })
    }

    /// The number of levels; `None` if there may be more than were searched.
    async fn depth(&self, gpu: &Gpu) -> Result<Option<u32>, GpuError> {
        let counts = gpu.read_first_async(&self.counts, self.level as usize + 1).await?;
        Ok(counts[1..].iter().position(|&n| n == 0).map(|last| count(last) + 1))
    }
}
