//! The entry point for all builders over boxes, and their configurations.

use canted_lbvh::{MAX_DEPTH, Sorted, Tree, radix};
use canted_obb::{Aabb, PrimId};

use crate::{PlocConfig, curve::along_curve, par, ploc, reference::Bounds, reinsert, top_down};

/// How far [`crate::reinsert`] improves a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReinsertConfig {
    /// Maximum number of iterations.
    pub iterations: u32,
    /// Fraction of all nodes and leaves, those of largest area first, that the first iteration tries to move; iteration
    /// `i` tries `1 / (2i + 1)` of it. At most 1.
    pub fraction: f32,
    /// The first iteration that reduces the sum of areas by less than this fraction is the last.
    pub min_gain: f32,
}

impl ReinsertConfig {
    /// For trees that are traced once or twice.
    pub const FAST: Self = Self { iterations: 4, fraction: 0.05, min_gain: 1e-3 };

    /// Most of the gain.
    pub const BALANCED: Self = Self { iterations: 12, fraction: 0.1, min_gain: 1e-3 };

    /// Nearly all of the gain; `benches/TRIED.md` lists what larger settings add.
    pub const QUALITY: Self = Self { iterations: 8, fraction: 0.5, min_gain: 1e-3 };
}

impl Default for ReinsertConfig {
    fn default() -> Self {
        Self::BALANCED
    }
}

/// Where [`crate::top_down()`] splits the primitives of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// At the midpoint between the outermost box centers. Deep where primitives cluster.
    Midpoint,
    /// At the median of the box centers: the shallowest tree.
    Median,
    /// Between any two box centers, at least SAH cost: the slowest to build.
    Sweep,
    /// Between bins, at least SAH cost.
    Binned {
        /// Bins per axis, 2 to 64.
        bins: u32,
        /// Up to this many primitives, at most 32, all splits are tried as in [`Split::Sweep`].
        sweep_threshold: u32,
    },
}

/// The axes on which splits are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// The axis with the largest extent of box centers.
    Longest,
    /// One axis after the other by depth, skipping axes on which all centers are equal.
    Cyclic,
    /// All three; the split of least SAH cost wins.
    All,
}

impl Axes {
    /// The axes tried on a node at `depth`.
    pub(crate) fn at(self, depth: u32, centers: impl Fn() -> Bounds) -> &'static [usize] {
        const EACH: [usize; 3] = [0, 1, 2];
        let axis = match self {
            Self::All => return &EACH,
            Self::Longest => centers().longest(),
            Self::Cyclic => {
                let extent = centers().extent().to_array();
                (0..3).map(|k| (depth as usize + k) % 3).find(|&axis| extent[axis] > 0.0).unwrap_or(0)
            }
        };
        &EACH[axis..=axis]
    }
}

/// How a tree is built from the root down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopDownConfig {
    /// Where nodes are split.
    pub split: Split,
    /// On which axes.
    pub axes: Axes,
    /// Maximum number of nodes from the root to a leaf, the leaf included. Nodes that would exceed it are halved by
    /// count, so a limit below `1 + ceil(log2 n)` is raised to that.
    pub max_depth: u32,
}

impl TopDownConfig {
    /// 32 bins on all axes.
    pub const BINNED: Self =
        Self { split: Split::Binned { bins: 32, sweep_threshold: 16 }, axes: Axes::All, max_depth: MAX_DEPTH };

    /// Every split on all axes.
    pub const SWEEP: Self = Self { split: Split::Sweep, ..Self::BINNED };

    /// Leaves above which the children of a node are built in parallel.
    pub(crate) const FORK: usize = 1 << 12;

    /// Whether only halving by count keeps `n` leaves below a node at `depth` within the limit.
    pub(crate) fn must_halve(&self, n: usize, depth: u32) -> bool {
        let levels = usize::BITS - (n - 1).leading_zeros();
        depth + levels >= self.max_depth
    }
}

impl Default for TopDownConfig {
    fn default() -> Self {
        Self::BINNED
    }
}

/// A builder of a binary tree over boxes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Builder {
    /// Radix tree over the box centers: the fastest to build, the slowest to trace.
    ///
    /// PLOC instead where a few distant primitives make the codes of many others equal: a radix tree would split these by
    /// their positions in the order, not in space.
    Lbvh,
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
        Builder::Lbvh => lbvh(boxes, bounds),
        Builder::Reinserted(config) => improved(lbvh(boxes, bounds), boxes, Some(config)),
        Builder::Ploc(config, improvement) => {
            let (sorted, _) = along_curve(boxes, bounds);
            improved(over_sorted(sorted, boxes, config), boxes, improvement.as_ref())
        }
        Builder::TopDown(config, improvement) => improved(top_down(boxes, config), boxes, improvement.as_ref()),
    }
}

fn lbvh(boxes: &[Aabb], bounds: &Aabb) -> Tree {
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
