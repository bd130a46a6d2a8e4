use canted_lbvh::{Child, ChildKind, Node, NodeId, Task, Tree};
use canted_obb::PrimId;

/// Maximum number of leaves of a task; larger trees have larger tasks.
const TASK_LEAVES: usize = 1 << 12;

/// The slices that a subtree owns while a tree is built from the root: disjoint, so subtrees are built in parallel.
pub(crate) struct Plot<'a> {
    id: NodeId,
    first: u32,
    nodes: &'a mut [Node],
    leaves: &'a mut [PrimId],
    /// Its nodes, children before parents.
    order: &'a mut [NodeId],
}

impl<'a> Plot<'a> {
    pub(crate) fn n_leaves(&self) -> usize {
        self.leaves.len()
    }

    /// A single leaf.
    pub(crate) fn leaf(self, primitive: PrimId) {
        self.leaves[0] = primitive;
    }

    /// Creates the node, with `n_left` leaves on the left; returns the slices of its children.
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 leaves")]
    pub(crate) fn split(self, n_left: usize) -> (Plot<'a>, Plot<'a>) {
        let n = self.leaves.len();
        let (first, last) = (self.first, self.first + n as u32 - 1);
        let (left_id, right_id) = (NodeId(first + n_left as u32 - 1), NodeId(first + n_left as u32));
        let child = |id: NodeId, is_leaf| if is_leaf { Child::leaf(id.0) } else { Child::inner(id) };
        let (left, right) = (child(left_id, n_left == 1), child(right_id, n_left + 1 == n));
        self.nodes[(self.id.0 - first) as usize] = Node { left, right, first, last };
        self.order[n - 2] = self.id;
        let (nodes, right_nodes) = self.nodes.split_at_mut(n_left);
        let (leaves, right_leaves) = self.leaves.split_at_mut(n_left);
        let (order, right_order) = self.order[..n - 2].split_at_mut(n_left - 1);
        (
            Plot { id: left_id, first, nodes, leaves, order },
            Plot { id: right_id, first: right_id.0, nodes: right_nodes, leaves: right_leaves, order: right_order },
        )
    }
}

/// A tree over `n` leaves whose nodes `build` creates; `build` returns the height in nodes, the leaf included.
///
/// Writes: a tree numbered as described at [`Node`].
pub(crate) fn assemble(n: usize, build: impl FnOnce(Plot<'_>) -> u32) -> Tree {
    let unset = Node { left: Child::leaf(0), right: Child::leaf(0), first: 0, last: 0 };
    let (mut nodes, mut leaves) = (vec![unset; n], vec![PrimId(0); n]);
    let mut order = vec![NodeId(0); n.saturating_sub(1)];
    let plot = Plot { id: NodeId::ROOT, first: 0, nodes: &mut nodes, leaves: &mut leaves, order: &mut order };
    let depth = if n == 0 { 0 } else { build(plot) };
    nodes.pop();
    let (bottom_up, tasks) = schedule(&nodes, &order);
    Tree { nodes, leaves, bottom_up, tasks, depth }
}

/// Moves the nodes above all tasks to the end of an order in which subtrees are contiguous.
fn schedule(nodes: &[Node], order: &[NodeId]) -> (Vec<NodeId>, Vec<Task>) {
    let limit = TASK_LEAVES.max((nodes.len() + 1) / 64);
    let (mut bottom_up, mut tasks, mut tops) = (Vec::with_capacity(order.len()), vec![], vec![]);
    // Nodes with the start of their subtree in `order`.
    let mut stack = if nodes.is_empty() { vec![] } else { vec![(NodeId::ROOT, 0)] };
    while let Some((id, start)) = stack.pop() {
        let node = &nodes[id.index()];
        let n = node.n_leaves() as usize;
        if n <= limit {
            let first = bottom_up.len();
            bottom_up.extend_from_slice(&order[start..start + n - 1]);
            tasks.push(Task { leaves: node.first..node.last + 1, nodes: first..bottom_up.len() });
            continue;
        }
        tops.push(id);
        let n_left = match node.left.kind() {
            ChildKind::Leaf(_) => 1,
            ChildKind::Inner(left) => nodes[left.index()].n_leaves() as usize,
        };
        for (child, start) in [(node.right, start + n_left - 1), (node.left, start)] {
            if let ChildKind::Inner(id) = child.kind() {
                stack.push((id, start));
            }
        }
    }
    bottom_up.extend(tops.iter().rev());
    (bottom_up, tasks)
}
