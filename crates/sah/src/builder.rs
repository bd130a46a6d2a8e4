//! The entry point for all builders over boxes.

use canted_lbvh::{Sorted, Tree, radix, stages::stage};
use canted_obb::{Aabb, PrimId};

use crate::{
    PlocConfig, ReinsertConfig, TopDownConfig, curve::along_curve, hybrid::hybrid, par, ploc, reinsert, top_down,
};

/// A builder of a binary tree over boxes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Builder {
    /// Radix tree over the box centers: the fastest to build, the slowest to trace.
    ///
    /// PLOC instead where a few distant primitives make the codes of many others equal: a radix tree would split these by
    /// their positions in the order, not in space.
    Lbvh,
    /// [`Builder::Lbvh`] below a top-down SAH tree over its subtrees of at most 64 primitives.
    Hybrid,
    /// [`Builder::Lbvh`] with reinsertion.
    Reinserted(ReinsertConfig),
    /// PLOC, optionally with reinsertion. Best for mixed large and small primitives.
    Ploc(PlocConfig, Option<ReinsertConfig>),
    /// Top-down SAH, optionally with reinsertion. Best for scans and terrain.
    TopDown(TopDownConfig, Option<ReinsertConfig>),
}

impl Builder {
    /// For trees that are traced once or twice.
    pub const FAST: Self = Self::Ploc(PlocConfig::NEAR, None);

    /// Most of the gain for a fraction of the time.
    pub const BALANCED: Self = Self::Ploc(PlocConfig::NEAR, Some(ReinsertConfig::BALANCED));

    /// The least cost, regardless of build time.
    pub const QUALITY: Self = Self::Ploc(PlocConfig::WIDE, Some(ReinsertConfig::QUALITY));
}

impl Default for Builder {
    fn default() -> Self {
        Self::BALANCED
    }
}

/// Boxes per job.
const CHUNK: usize = 1 << 14;

/// Builds a tree with one primitive per leaf.
///
/// Reads: a finite box for each primitive, in any frame; the bounds of all, for Morton codes. Writes: a tree over the
/// indices of the boxes. Holds: the same bits for any number of threads.
///
/// For primitives much longer than the distance between them, [`crate::spatial()`] may be better; it needs triangles.
#[must_use]
pub fn build(boxes: &[Aabb], bounds: &Aabb, builder: &Builder) -> Tree {
    match builder {
        Builder::Lbvh => radix_tree(boxes, bounds),
        Builder::Hybrid => hybrid(radix_tree(boxes, bounds), boxes),
        Builder::Reinserted(config) => improved(radix_tree(boxes, bounds), boxes, Some(config)),
        Builder::Ploc(config, improvement) => {
            let (sorted, _) = stage("sorting along a curve", || along_curve(boxes, bounds));
            let tree = stage("merging", || over_sorted(sorted, boxes, config));
            improved(tree, boxes, improvement.as_ref())
        }
        Builder::TopDown(config, improvement) => {
            improved(stage("splitting", || top_down(boxes, config)), boxes, improvement.as_ref())
        }
    }
}

fn radix_tree(boxes: &[Aabb], bounds: &Aabb) -> Tree {
    let (sorted, is_coarse) = along_curve(boxes, bounds);
    if is_coarse { over_sorted(sorted, boxes, &PlocConfig::NEAR) } else { radix(sorted) }
}

fn over_sorted(sorted: Sorted, boxes: &[Aabb], config: &PlocConfig) -> Tree {
    let in_order = leaf_boxes(boxes, &sorted.leaves);
    ploc(sorted, &in_order, config)
}

fn improved(tree: Tree, boxes: &[Aabb], config: Option<&ReinsertConfig>) -> Tree {
    match config {
        Some(config) => reinsert(&tree, &leaf_boxes(boxes, &tree.leaves), config),
        None => tree,
    }
}

/// The boxes in leaf order.
fn leaf_boxes(boxes: &[Aabb], leaves: &[PrimId]) -> Vec<Aabb> {
    par::map(leaves, CHUNK, |leaf| boxes[leaf.index()])
}
