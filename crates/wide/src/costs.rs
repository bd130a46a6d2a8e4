use crate::layout::{MAX_LEAF, NodeKind};

/// What a ray's visit costs, in visits of a box node: what the collapse weighs.
///
/// `canted-bench costs` measures them: on an AMD EPYC (Zen 5) with AVX-512 leaning nodes cost 1.4 to 2.0, leaves at least
/// 1.8, for they end in branches that are seldom foreseen, and another eight triangles in one next to nothing. Of such
/// constants the defaults traced fastest in whole runs; `benches/TRIED.md` has both tables.
///
/// An infinite cost forbids a kind of node, unless no other is left. Costs below zero, or that are no numbers, count as infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// A node with boxes along the mesh's axes.
    pub aligned_node: f32,
    /// A node with a frame for each child.
    pub oriented_node: f32,
    /// A leaf, before its blocks.
    pub leaf: f32,
    /// A block of up to eight triangles.
    pub block: f32,
    /// Most triangles of a leaf, 1 to 32; what lies outside counts as the nearer end.
    pub max_leaf: usize,
}

impl Default for Costs {
    fn default() -> Self {
        Self { aligned_node: 1.0, oriented_node: 1.7, leaf: 2.0, block: 0.2, max_leaf: 32 }
    }
}

impl Costs {
    /// The cost of a visit to a node of this kind.
    #[must_use]
    pub fn node(&self, kind: NodeKind) -> f32 {
        match kind {
            NodeKind::Aligned => self.aligned_node,
            NodeKind::Oriented => self.oriented_node,
        }
    }

    /// These costs as builds weigh by them; `oriented` says whether there are oriented nodes.
    pub(crate) fn usable(&self, oriented: bool) -> Self {
        let [aligned_node, oriented_node, leaf, block] = [self.aligned_node, self.oriented_node, self.leaf, self.block]
            .map(|cost| if cost >= 0.0 { cost } else { f32::INFINITY });
        // Forbidden altogether, nodes would be filled as if all cost the same, with two children each.
        let is_left = aligned_node.is_finite() || oriented && oriented_node.is_finite();
        let aligned_node = if is_left { aligned_node } else { Self::default().aligned_node };
        Self { aligned_node, oriented_node, leaf, block, max_leaf: self.max_leaf.clamp(1, MAX_LEAF) }
    }

    /// The cost of a visit to a leaf of `n` primitives, if one holds so many.
    #[expect(clippy::cast_precision_loss, reason = "at most 32 primitives")]
    pub(crate) fn leaf_of(&self, n: usize) -> f32 {
        self.leaf + self.block * n.div_ceil(8) as f32
    }
}
