//! Collapse of binary trees into eight-wide nodes and triangle blocks.
//!
//! ```text
//! Built -> levels of wide nodes, from the roots -> order in memory -> nodes
//!       -> leaves of several triangles ----------------------------> blocks
//! ```
//!
//! A wide node is opened by area: the child with the largest box is replaced by its two children until there are eight. The order
//! in memory follows the binary tree, so equal input gives equal words. A node is oriented where the boxes of its children, if
//! they have oriented ones, lower the predicted cost.

use bytemuck::{Pod, Zeroable};

use super::prefix::prefix_sums;
use super::{Built, Range, Run, count};
use crate::{Buffer, Gpu, GpuError, NamedBinding, Specialisation, wait::block_on};

/// Most triangles of a leaf: those that a ray tests at once.
pub const MAX_LEAF: u32 = 4;

/// Children of a node.
const WIDTH: u32 = 8;

/// Quads of a unit of memory, which is an aligned node or half an oriented one, and of four triangles.
const UNIT_QUADS: u32 = 16;
const HALF_QUADS: u32 = 10;

/// Levels between two looks at whether there is another.
const LEVELS_AT_ONCE: u32 = 8;

/// Most levels that are counted; deeper trees are rejected.
const MAX_LEVELS: u32 = 128;

/// As in `shared/node.wgsl`: a word that refers to nothing, the bit of leaves.
const EMPTY: u32 = 0x7fff_ffff;
const LEAF: u32 = 0x8000_0000;

/// Eight-wide BVHs in device memory, in the layout of [`RawBvh`](canted_wide::RawBvh): those over triangles, then that over
/// instances.
pub struct WideTrees {
    /// Nodes, in quads of words.
    pub nodes: Buffer<[u32; 4]>,
    /// Triangles, in blocks of ten quads.
    pub blocks: Buffer<[u32; 4]>,
    /// The levels that were collapsed: over triangles, and over instances if there are any.
    pub levels: Vec<WideLevel>,
    /// Whether nodes over triangles may be oriented.
    pub is_oriented: bool,
}

/// A level of wide trees.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WideLevel {
    /// The root's word of each tree.
    pub roots: Vec<u32>,
    /// First quad of the level in [`WideTrees::nodes`], from which words count.
    pub first_quad: u32,
    /// Greatest number of nodes from a root to a leaf; 0 without nodes.
    pub depth: u32,
}

/// `Level` of `build/wide_levels`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct QueueLevel {
    level: u32,
    n_first: u32,
}

/// `Level` of `build/wide_nodes`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct TargetLevel {
    first_unit: u32,
    is_top: u32,
}

impl WideTrees {
    /// Collapses the trees over triangles in `bottom`, and the tree over boxes of instances in `top`. Nodes over triangles are
    /// aligned, or oriented where `bottom` has oriented boxes; those over instances are aligned. Between dispatches only the
    /// number of nodes of each level is read back, to know the depth.
    ///
    /// # Errors
    /// Trees over boxes as `bottom`, more than 2^26 triangles, a BVH of more than 128 levels, a limit of the device, or device lost.
    pub fn new(run: &mut Run<'_>, bottom: &Built, top: Option<&Built>) -> Result<Self, GpuError> {
        block_on(Self::new_async(run, bottom, top))
    }

    /// [`WideTrees::new`] for browsers.
    ///
    /// # Errors
    /// As for [`WideTrees::new`].
    pub async fn new_async(run: &mut Run<'_>, bottom: &Built, top: Option<&Built>) -> Result<Self, GpuError> {
        let gpu = run.gpu();
        if run.is_recorded() {
            let what = "a recorded build of wide BVHs, which reads the number of nodes back".to_owned();
            return Err(GpuError::Unsupported { what });
        }
        if bottom.items.corners().is_none() {
            return Err(GpuError::Invalid { message: "the first level is not over triangles".to_owned() });
        }
        let n = bottom.items.len();
        if n > 1 << 26 {
            return Err(GpuError::Unsupported { what: format!("a wide BVH over {n} triangles, more than 2^26") });
        }
        let mut n_units = 0;
        let parts = [Some(bottom), top].into_iter().flatten().map(|built| {
            let first = n_units;
            let kinds = Kinds::of(built);
            n_units += kinds.n_units(built.items.ranges());
            (built, kinds, first)
        });
        let parts: Vec<_> = parts.collect();
        let nodes = gpu.zeroed("wide nodes", n_units as usize * UNIT_QUADS as usize)?;
        let blocks = gpu.zeroed("triangle blocks", (n as usize).div_ceil(2) * HALF_QUADS as usize)?;
        let mut levels = vec![];
        for &(built, kinds, first_unit) in &parts {
            let order = Order::new(run, built, kinds).await?;
            order.put(run, built, first_unit, &nodes)?;
            let ranges = built.items.ranges().iter().zip(0..);
            levels.push(WideLevel {
                roots: ranges.map(|(range, tree)| root(*range, tree, kinds.max_leaf)).collect(),
                first_quad: UNIT_QUADS * first_unit,
                depth: order.depth,
            });
        }
        put_blocks(run, bottom, &blocks)?;
        Ok(Self { nodes, blocks, levels, is_oriented: bottom.obbs.is_some() })
    }
}

/// What a level may have.
#[derive(Clone, Copy, Debug)]
struct Kinds {
    /// Most items of a leaf.
    max_leaf: u32,
    is_oriented: bool,
}

impl Kinds {
    fn of(built: &Built) -> Self {
        match built.items.corners() {
            Some(_) => Self { max_leaf: MAX_LEAF, is_oriented: built.obbs.is_some() },
            None => Self { max_leaf: 1, is_oriented: false },
        }
    }

    /// Units of memory that suffice.
    fn n_units(self, ranges: &[Range]) -> u32 {
        let size = if self.is_oriented { 2 } else { 1 };
        count(ranges.len()) + size * capacity(ranges, self.max_leaf)
    }
}

/// Most wide nodes over trees with these ranges.
///
/// A node that is not full has leaves only and more than `max_leaf` items of its own. With `E` of those and `F` full ones over
/// `n` items, 7 F is less than the number of other nodes and leaves: `7 F < E + n - (max_leaf + 1) E`, and `E <= n / (max_leaf +
/// 1)`.
fn capacity(ranges: &[Range], max_leaf: u32) -> u32 {
    let n = ranges.iter().map(|range| u64::from(range.count)).sum::<u64>();
    let most_not_full = n / u64::from(max_leaf + 1);
    let more = u64::from((WIDTH - 1).saturating_sub(max_leaf)) * most_not_full;
    count(usize::try_from((n + more).div_ceil(u64::from(WIDTH - 1))).unwrap_or(usize::MAX))
}

/// The root's word of tree `tree`.
fn root(range: Range, tree: u32, max_leaf: u32) -> u32 {
    match range.count {
        0 => EMPTY,
        n if n <= max_leaf => {
            // As in `shared/build/leaf.wgsl`.
            let part = if n <= 2 { range.first } else { range.first + (range.first & 1) };
            LEAF | (n - 1) << 26 | part
        }
        _ => 4 * tree,
    }
}

/// Which binary nodes become wide ones, and their order in memory.
struct Order {
    kinds: Kinds,
    n_units: u32,
    /// Units of memory of the wide node of each slot, except for roots, and before it.
    units: Buffer<u32>,
    prefixes: Buffer<u32>,
    /// The slot of each wide node but roots, by its first unit, plus one.
    slots: Buffer<u32>,
    depth: u32,
}

impl Order {
    async fn new(run: &mut Run<'_>, built: &Built, kinds: Kinds) -> Result<Self, GpuError> {
        let gpu = run.gpu();
        let n = built.items.len() as usize;
        let n_units = kinds.n_units(built.items.ranges());
        let units = gpu.zeroed("sizes of wide nodes", n)?;
        let depth = find(run, built, kinds, &units).await?;
        let prefixes = gpu.zeroed("wide nodes before each", n)?;
        let slots = gpu.zeroed("slots of wide nodes", n_units as usize)?;
        run.stage("collapse", |dispatches| {
            prefix_sums(dispatches, &units, &prefixes, count(n))?;
            let bound: [NamedBinding<'_>; 3] = [("units", &units), ("prefixes", &prefixes), ("wide_slots", &slots)];
            let kernel = gpu.kernel("build/wide_slots", &Specialisation::none())?;
            dispatches.items(&kernel, &bound, count(n))
        })?;
        Ok(Self { kinds, n_units, units, prefixes, slots, depth })
    }

    /// Writes the nodes from `first_unit` on.
    fn put(&self, run: &mut Run<'_>, built: &Built, first_unit: u32, nodes: &Buffer<[u32; 4]>) -> Result<(), GpuError> {
        let gpu = run.gpu();
        let is_top = u32::from(built.items.corners().is_none());
        let level = gpu.uniform("level of wide nodes", &TargetLevel { first_unit, is_top })?;
        let mut bound = built.items.bound(&[
            ("nodes", &built.trees.nodes),
            ("aabbs", &built.aabbs),
            ("leaves", &built.leaves),
            ("units", &self.units),
            ("prefixes", &self.prefixes),
            ("wide_slots", &self.slots),
            ("target_level", &level),
            ("wide_nodes", nodes),
        ]);
        run.stage("wide nodes", |dispatches| {
            let max_leaf = Specialisation::none().number("MAX_LEAF", self.kinds.max_leaf);
            let chosen = built.items.part().number("MAX_LEAF", self.kinds.max_leaf);
            dispatches.items(&*gpu.kernel("build/wide_nodes", &chosen)?, &bound, self.n_units)?;
            let Some(obbs) = built.obbs.as_ref().filter(|_| self.kinds.is_oriented) else { return Ok(()) };
            bound.push(("obbs", obbs));
            dispatches.items(&*gpu.kernel("build/wide_oriented", &max_leaf)?, &bound, self.n_units)
        })
    }
}

/// Marks the binary nodes that become wide ones, level by level, and counts the levels.
async fn find(run: &mut Run<'_>, built: &Built, kinds: Kinds, units: &Buffer<u32>) -> Result<u32, GpuError> {
    let gpu = run.gpu();
    let Kinds { max_leaf, is_oriented } = kinds;
    let most = capacity(built.items.ranges(), max_leaf);
    let with_nodes = built.items.ranges().iter().filter(|range| range.count > max_leaf);
    let first: Vec<u32> = with_nodes.map(|range| range.first).collect();
    let n_first = count(first.len());
    if n_first == 0 {
        return Ok(0);
    }
    let first = gpu.buffer("roots", &first)?;
    let queues: [Buffer<u32>; 2] =
        [gpu.zeroed("wide nodes of a level", most as usize)?, gpu.zeroed("wide nodes of a level", most as usize)?];
    let counts = gpu.zeroed::<u32>("wide nodes of levels", MAX_LEVELS as usize + 1)?;
    let kind = if is_oriented { "shared/build/wide_kind/oriented" } else { "shared/build/wide_kind/aligned" };
    let chosen = Specialisation::none().number("MAX_LEAF", max_leaf).part("wide_kind", kind);
    let kernel = gpu.kernel("build/wide_levels", &chosen)?;
    let (mut level, mut n_of_level) = (0, n_first);
    while level < MAX_LEVELS {
        run.stage("collapse", |dispatches| {
            for _ in 0..LEVELS_AT_ONCE {
                let uniform = gpu.uniform("level", &QueueLevel { level, n_first })?;
                let [even, odd] = &queues;
                let (queue_in, queue_out) = if level % 2 == 0 { (even, odd) } else { (odd, even) };
                let mut bound = built.items.bound(&[
                    ("nodes", &built.trees.nodes),
                    ("aabbs", &built.aabbs),
                    ("wide_level", &uniform),
                    ("queue_in", if level == 0 { &first } else { queue_in }),
                    ("queue_out", queue_out),
                    ("counts", &counts),
                    ("units", units),
                    ("leaves", &built.leaves),
                ]);
                bound.extend(built.obbs.as_ref().map(|obbs| -> NamedBinding<'_> { ("obbs", obbs) }));
                dispatches.items(&kernel, &bound, n_of_level)?;
                n_of_level = n_of_level.saturating_mul(WIDTH).min(most);
                level += 1;
            }
            Ok(())
        })?;
        if let Some(depth) = depth(gpu, &counts, level).await? {
            return Ok(depth);
        }
    }
    let what = format!("a BVH of more than {MAX_LEVELS} levels");
    Err(GpuError::Unsupported { what })
}

/// The number of levels; `None` if there may be more than `level`.
async fn depth(gpu: &Gpu, counts: &Buffer<u32>, level: u32) -> Result<Option<u32>, GpuError> {
    let counts = gpu.read_first_async(counts, level as usize + 1).await?;
    Ok(counts[1..].iter().position(|&n| n == 0).map(|last| count(last) + 1))
}

fn put_blocks(run: &mut Run<'_>, built: &Built, blocks: &Buffer<[u32; 4]>) -> Result<(), GpuError> {
    let gpu = run.gpu();
    let bound = built.items.bound(&[
        ("nodes", &built.trees.nodes),
        ("parents", &built.trees.parents),
        ("leaves", &built.leaves),
        ("wide_blocks", blocks),
    ]);
    run.stage("wide blocks", |dispatches| {
        let kernel = gpu.kernel("build/wide_blocks", &Specialisation::none().number("MAX_LEAF", MAX_LEAF))?;
        dispatches.items(&kernel, &bound, built.items.len())
    })
}
