use canted_trace::TriangleTest;

use crate::node::MAX_DEPTH;

/// How a [`KdTree`](crate::KdTree) continues from one leaf to the next. Both ways visit the same leaves in the same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum KdTraversal {
    /// With a stack of the cells that the ray enters later.
    #[default]
    Stack,
    /// Without a stack: each leaf stores its cell and a link, a *rope*, across each of its six faces.
    Ropes,
}

/// Where a node of a [`KdTree`](crate::KdTree) is split.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum KdSplit {
    /// At the plane of least SAH cost, if that is less than testing all triangles.
    #[default]
    Sah,
    /// At the midpoint of the longest axis of its cell, while it has more than 5 triangles (Wald and Havran 2006, section 2): to compare with.
    Midpoint,
}

/// How [`KdTree::build`](crate::KdTree::build) builds. No value changes a hit.
///
/// A node over `n` triangles is split where that costs less than testing all of them. The cost of a split is
/// `traversal_cost + intersection_cost·(1 - bonus)·(A_l·n_l + A_u·n_u)/A` with the areas of both cells and of the node's,
/// and with `bonus` only if a cell is empty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KdTreeConfig {
    /// How rays are traced.
    pub traversal: KdTraversal,
    /// The triangle test.
    pub test: TriangleTest,
    /// Where nodes are split.
    pub split: KdSplit,
    /// Cost of one step through a node.
    pub traversal_cost: f64,
    /// Cost of one triangle test. At 0 nothing is split.
    pub intersection_cost: f64,
    /// Reduction of the cost of a split that cuts off an empty cell, from 0 to below 1.
    pub empty_bonus: f64,
    /// Maximum number of nodes above a leaf, up to [`KdTreeConfig::MAX_DEPTH`]. `None`: `8 + 1.3·log2(n)`, rounded down.
    pub max_depth: Option<u32>,
    /// Maximum number of references and empty leaves together, relative to the number of triangles, and 2^29 in all: more
    /// triangles than that are one leaf. At 1 or less no triangle is in two leaves.
    pub max_references: f64,
}

impl KdTreeConfig {
    /// Greatest depth.
    pub const MAX_DEPTH: u32 = MAX_DEPTH;

    /// Maximum number of nodes above a leaf, for `n` triangles.
    pub(crate) fn depth_limit(&self, n: usize) -> u32 {
        // Source of the default: Havran 2000; Wald, Havran 2006.
        let default = || (8.0 + 1.3 * (n.max(1) as f64).log2()) as u32;
        self.max_depth.unwrap_or_else(default).min(MAX_DEPTH)
    }

    /// Maximum number of references and empty leaves, for `n` triangles.
    pub(crate) fn reference_limit(&self, n: usize) -> usize {
        ((n as f64 * self.max_references.max(1.0)) as usize).min(MAX_LEAVES)
    }
}

/// With as many leaves, a node's number still fits in 30 bits.
const MAX_LEAVES: usize = 1 << 29;

impl Default for KdTreeConfig {
    /// Costs at which scans, buildings, plants and lattices of 100,000 triangles were traced fastest, or nearly so with fewer
    /// references. A step costs more than a triangle test because its branch is hard to predict.
    fn default() -> Self {
        Self {
            traversal: KdTraversal::Stack,
            test: TriangleTest::Watertight,
            split: KdSplit::Sah,
            traversal_cost: 2.5,
            intersection_cost: 1.0,
            empty_bonus: 0.2,
            max_depth: None,
            max_references: 16.0,
        }
    }
}
