use canted_lbvh::{Tree, radix};
use canted_obb::{Aabb, PrimId};

use crate::{PlocConfig, ReinsertConfig, TopDownConfig, curve::along_curve, par, ploc, reinsert, top_down};

/// How a binary tree is made of boxes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Builder {
    /// The radix tree over the middles of the boxes: cheapest to build, dearest to trace.
    Lbvh,
    /// The radix tree with subtrees reinserted.
    Reinserted(ReinsertConfig),
    /// Neighbours along the curve joined by area, then, if asked for, subtrees reinserted. Best where large and small
    /// primitives mix.
    Ploc(PlocConfig, Option<ReinsertConfig>),
    /// From the root down, then, if asked for, subtrees reinserted. Best on scans and terrain.
    TopDown(TopDownConfig, Option<ReinsertConfig>),
}

impl Builder {
    /// For trees that are traced once or twice.
    pub const FAST: Self = Self::Ploc(PlocConfig::NEAR, None);

    /// Most of the gain for a fraction of the time.
    pub const BALANCED: Self = Self::Ploc(PlocConfig::NEAR, Some(ReinsertConfig::BALANCED));

    /// Least area, whatever it takes.
    pub const QUALITY: Self = Self::Ploc(PlocConfig::WIDE, Some(ReinsertConfig::QUALITY));
}

impl Default for Builder {
    fn default() -> Self {
        Self::BALANCED
    }
}

/// Boxes put in leaf order by one job.
const CHUNK: usize = 1 << 14;

/// Builds a tree, one primitive a leaf.
///
/// Reads: a box for each primitive (finite), in any frame; the box around all, which places the curve. Writes: a tree
/// over the boxes' positions. Holds: the same bits for any number of threads.
///
/// Where primitives are much longer than they are apart, [`crate::spatial`] may do better; it needs their corners.
#[must_use]
pub fn build(boxes: &[Aabb], bounds: &Aabb, builder: &Builder) -> Tree {
    match builder {
        Builder::Lbvh => radix(along_curve(boxes, bounds)),
        Builder::Reinserted(config) => improved(radix(along_curve(boxes, bounds)), boxes, Some(config)),
        Builder::Ploc(config, improvement) => {
            let sorted = along_curve(boxes, bounds);
            let in_order = leaf_boxes(boxes, &sorted.leaves);
            improved(ploc(sorted, &in_order, config), boxes, improvement.as_ref())
        }
        Builder::TopDown(config, improvement) => improved(top_down(boxes, config), boxes, improvement.as_ref()),
    }
}

fn improved(tree: Tree, boxes: &[Aabb], config: Option<&ReinsertConfig>) -> Tree {
    match config {
        Some(config) => reinsert(&tree, &leaf_boxes(boxes, &tree.leaves), config),
        None => tree,
    }
}

/// The boxes in the order of leaves.
fn leaf_boxes(boxes: &[Aabb], leaves: &[PrimId]) -> Vec<Aabb> {
    par::map_chunks(leaves, CHUNK, |_, chunk| chunk.iter().map(|leaf| boxes[leaf.index()]).collect::<Vec<_>>()).concat()
}
