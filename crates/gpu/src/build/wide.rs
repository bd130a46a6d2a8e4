//! Collapse of binary trees into eight-wide nodes and triangle blocks.
//!
//! ```text
//! Built -> levels of wide nodes, from the roots -> order in memory -> nodes
//!       -> leaves of several triangles ----------------------------> blocks
//! ```
//!
//! A wide node is opened by area: the child with the largest box is replaced by its two children until there are eight. The order
//! in memory follows the binary tree, so equal input gives equal words. A node is oriented where the boxes of its children, if
//! they have oriented ones, lower the predicted cost. Each tree has memory for the largest possible number of wide nodes, so a new
//! collapse does not move other trees.

mod order;
mod room;

use self::order::Order;
use self::room::Room;
use super::{Built, Run};
use crate::{Buffer, GpuError, Specialisation, wait::block_on};

/// Most triangles of a leaf: those that a ray tests at once.
pub const MAX_LEAF: u32 = 4;

/// Quads of a unit of memory, which is an aligned node or half an oriented one, and of four triangles.
const UNIT_QUADS: u32 = 16;
const HALF_QUADS: u32 = 10;

/// Eight-wide BVHs in device memory, in the layout of [`RawBvh`](canted_wide::RawBvh): those over triangles, then that over
/// instances.
pub struct WideBvhs {
    /// Nodes, in quads of words.
    pub nodes: Buffer<[u32; 4]>,
    /// Triangles, in blocks of ten quads.
    pub blocks: Buffer<[u32; 4]>,
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
    /// Greatest number of nodes from a root to a leaf; 0 without nodes.
    pub depth: u32,
}

/// Which binary nodes are wide ones, for each level: what it takes to write nodes again after the binary trees have changed.
pub(crate) struct Collapse {
    levels: Vec<Order>,
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
    /// aligned, or oriented where `bottom` has oriented boxes; those over instances are aligned. Between dispatches only the
    /// number of nodes of each level is read back, to know the depth.
    ///
    /// # Errors
    /// A recorded run, trees over boxes as `bottom`, more than 2^26 triangles, a BVH of more than 128 levels, a limit of the device, or device lost.
    pub fn new(run: &mut Run<'_>, bottom: &Built, top: Option<&Built>) -> Result<Self, GpuError> {
        block_on(Self::new_async(run, bottom, top))
    }

    /// [`WideBvhs::new`] for browsers.
    ///
    /// # Errors
    /// As for [`WideBvhs::new`].
    pub async fn new_async(run: &mut Run<'_>, bottom: &Built, top: Option<&Built>) -> Result<Self, GpuError> {
        let gpu = run.gpu();
        if run.is_recorded() {
            let what = "a recorded collapse into wide BVHs whose depth is read back".to_owned();
            return Err(GpuError::Unsupported { what });
        }
        if bottom.items.corners().is_none() {
            return Err(GpuError::Input { message: "the first level is not over triangles".to_owned() });
        }
        let n = bottom.items.len();
        if n > 1 << 26 {
            return Err(GpuError::Unsupported { what: format!("a wide BVH over {n} triangles, more than 2^26") });
        }
        let mut n_units = 0;
        let parts = [Some(bottom), top].into_iter().flatten().map(|built| {
            let first = n_units;
            let room = Room::of(built);
            n_units += room.n_units();
            (built, room, first)
        });
        let parts: Vec<_> = parts.collect();
        let nodes = gpu.zeroed("wide nodes", n_units as usize * UNIT_QUADS as usize)?;
        let blocks = gpu.zeroed("triangle blocks", (n as usize).div_ceil(2) * HALF_QUADS as usize)?;
        let mut collapse = Collapse { levels: vec![] };
        let mut levels = vec![];
        for (number, (built, room, first_unit)) in parts.into_iter().enumerate() {
            let roots = room.roots(built.items.ranges());
            let order = Order::new(gpu, built, room, first_unit)?;
            let depth = order.count_and_find(run, built).await?;
            levels.push(WideLevel { roots, first_quad: UNIT_QUADS * first_unit, depth });
            collapse.levels.push(order);
            collapse.put(run, built, number, (&nodes, &blocks), all(built))?;
        }
        Ok(Self { nodes, blocks, levels, is_oriented: bottom.obbs.is_some(), collapse })
    }
}

impl Collapse {
    /// Writes nodes and blocks of trees of a level again, after their binary trees have changed. Reads nothing back.
    pub(crate) fn put_again(
        &self,
        run: &mut Run<'_>,
        (which, built): (Which, &Built),
        words: (&Buffer<[u32; 4]>, &Buffer<[u32; 4]>),
        (trees, change): ([u32; 2], Change),
    ) -> Result<(), GpuError> {
        let level = if which == Which::Top { 1 } else { 0 };
        if change == Change::Trees {
            self.levels[level].find_again(run, built, trees)?;
        }
        self.put(run, built, level, words, trees)
    }

    /// Writes nodes and blocks.
    fn put(
        &self,
        run: &mut Run<'_>,
        built: &Built,
        level: usize,
        (nodes, blocks): (&Buffer<[u32; 4]>, &Buffer<[u32; 4]>),
        trees: [u32; 2],
    ) -> Result<(), GpuError> {
        self.levels[level].put(run, built, nodes, trees)?;
        if built.items.corners().is_some() { put_blocks(run, built, blocks, trees) } else { Ok(()) }
    }
}

/// All trees of a level.
fn all(built: &Built) -> [u32; 2] {
    [0, super::count(built.items.ranges().len())]
}

fn put_blocks(run: &mut Run<'_>, built: &Built, blocks: &Buffer<[u32; 4]>, trees: [u32; 2]) -> Result<(), GpuError> {
    let gpu = run.gpu();
    let bound = built.items.bound(&[
        ("nodes", &built.trees.nodes),
        ("parents", &built.trees.parents),
        ("leaves", &built.leaves),
        ("wide_blocks", blocks),
    ]);
    run.stage("wide blocks", |dispatches| {
        let kernel = gpu.kernel("build/wide_blocks", &Specialisation::none().number("MAX_LEAF", MAX_LEAF))?;
        dispatches.range(&kernel, &bound, built.items.of_trees(trees))
    })
}
