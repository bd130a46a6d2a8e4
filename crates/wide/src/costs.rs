use crate::layout::{MAX_LEAF, NodeKind};

/// What a ray's visit costs, in visits of a box node: what the collapse weighs.
///
/// `canted-bench costs` measures them: on an AMD EPYC (Zen 5) with AVX-512 leaning nodes cost 1.4 to 2.0, leaves at least
/// 1.8, for they end in branches that are seldom foreseen, and another eight triangles in one next to nothing. Of such
/// constants the defaults traced fastest in whole runs; `benches/TRIED.md` has both tables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// A node with boxes along the mesh's axes.
    pub box_node: f32,
    /// A node with one frame for all children.
    pub shared_node: f32,
    /// A node with a frame for each child.
    pub lean_node: f32,
    /// A leaf, before its blocks.
    pub leaf: f32,
    /// A block of up to eight triangles.
    pub block: f32,
    /// Most triangles of a leaf, at most 32.
    pub max_leaf: usize,
}

impl Default for Costs {
    fn default() -> Self {
        Self { box_node: 1.0, shared_node: 1.25, lean_node: 1.7, leaf: 2.0, block: 0.2, max_leaf: 32 }
    }
}

impl Costs {
    /// The cost of a visit to a node of this kind.
    #[must_use]
    pub fn node(&self, kind: NodeKind) -> f32 {
        match kind {
            NodeKind::Box => self.box_node,
            NodeKind::Shared => self.shared_node,
            NodeKind::Lean => self.lean_node,
        }
    }

    /// The cost of a visit to a leaf of `n` primitives; infinite where no leaf holds so many.
    #[expect(clippy::cast_precision_loss, reason = "at most 32 primitives")]
    pub(crate) fn leaf_of(&self, n: usize) -> f32 {
        if n <= self.max_leaf.min(MAX_LEAF) { self.leaf + self.block * n.div_ceil(8) as f32 } else { f32::INFINITY }
    }
}
