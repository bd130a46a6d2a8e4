use canted_lbvh::{Child, ChildKind, NodeId, Tree, Volumes};

use super::child::ChildRef;

/// The order of pairs in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairOrder {
    /// In the order of node numbers: the fastest to lay out.
    Numbered,
    /// Depth first, the child of larger area next to its parent, so most rays read memory forwards.
    /// `benches/TRIED.md` has its gain for rays and its cost for the build.
    DepthFirst,
}

/// The position of each inner node's pair.
pub(super) struct Order {
    /// The reference to each node. Empty if every pair is axis-aligned and in the position of its node's number.
    pub(super) refs: Vec<ChildRef>,
    /// Nodes in the order of their axis-aligned pairs.
    pub(super) aabb_ids: Vec<u32>,
    /// Nodes in the order of their oriented pairs.
    pub(super) slab_ids: Vec<u32>,
}

impl Order {
    pub(super) fn new(tree: &Tree, volumes: &Volumes, pair_order: PairOrder) -> Self {
        match pair_order {
            PairOrder::Numbered => Self::numbered(tree, volumes),
            PairOrder::DepthFirst => Self::depth_first(tree, volumes),
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes")]
    fn numbered(tree: &Tree, volumes: &Volumes) -> Self {
        let mut order = Self { refs: vec![], aabb_ids: vec![], slab_ids: vec![] };
        let ids = || (0..tree.nodes.len() as u32).map(NodeId);
        if ids().any(|id| volumes.children_oriented(id)) {
            order.refs = vec![ChildRef(0); tree.nodes.len()];
            ids().for_each(|id| order.append(id, volumes));
        }
        order
    }

    fn depth_first(tree: &Tree, volumes: &Volumes) -> Self {
        let mut order = Self { refs: vec![ChildRef(0); tree.nodes.len()], aabb_ids: vec![], slab_ids: vec![] };
        let area = |child: Child| match child.kind() {
            ChildKind::Leaf(_) => -1.0,
            ChildKind::Inner(id) => volumes.aabbs[id.index()].area(),
        };
        let mut stack = vec![tree.root()];
        while let Some(Some(child)) = stack.pop() {
            let ChildKind::Inner(id) = child.kind() else { continue };
            order.append(id, volumes);
            let node = &tree.nodes[id.index()];
            let (first, second) =
                if area(node.left) < area(node.right) { (node.right, node.left) } else { (node.left, node.right) };
            stack.extend([Some(second), Some(first)]);
        }
        order
    }

    /// Appends the pair of a node to the pairs of its kind.
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes")]
    fn append(&mut self, id: NodeId, volumes: &Volumes) {
        let (ids, make): (_, fn(u32) -> ChildRef) = if volumes.children_oriented(id) {
            (&mut self.slab_ids, ChildRef::slabs)
        } else {
            (&mut self.aabb_ids, ChildRef::aabbs)
        };
        self.refs[id.index()] = make(ids.len() as u32);
        ids.push(id.0);
    }
}
