//! Numbers of nodes and leaves that rays visit; [`Costs`](crate::Costs) are fitted to them.

/// Visits by rays that search for their closest hit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalCounts {
    /// Nodes of each kind, in the order of [`NodeKind::ALL`](crate::NodeKind::ALL).
    pub nodes: [u64; 2],
    /// Leaves.
    pub leaves: u64,
    /// Blocks of up to eight primitives.
    pub blocks: u64,
}

impl TraversalCounts {
    /// Adds the visits of other rays.
    pub(crate) fn add(&mut self, other: &Self) {
        self.nodes.iter_mut().zip(other.nodes).for_each(|(sum, n)| *sum += n);
        self.leaves += other.leaves;
        self.blocks += other.blocks;
    }
}
