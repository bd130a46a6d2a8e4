use crate::{Child, ChildKind, Node, NodeId, Tree, par};

/// Calls `join` on every node, children first, and returns what it made, by node.
///
/// `leaf` makes the value of a leaf from its position. Each task's subtree writes its own slice, so tasks run on all
/// threads; the few nodes above them follow.
pub(crate) fn bottom_up<S: Copy + Send + Sync>(
    tree: &Tree,
    unset: S,
    leaf: impl Fn(u32) -> S + Sync,
    join: impl Fn(NodeId, &Node, &S, &S) -> S + Sync,
) -> Vec<S> {
    let mut values = vec![unset; tree.leaves.len()];
    let of = |child: Child, values: &[S], base: u32| match child.kind() {
        ChildKind::Leaf(position) => leaf(position),
        ChildKind::Inner(id) => values[(id.0 - base) as usize],
    };
    let visit = |ids: &[NodeId], values: &mut [S], base: u32| {
        for &id in ids {
            let node = &tree.nodes[id.index()];
            let (left, right) = (of(node.left, values, base), of(node.right, values, base));
            values[(id.0 - base) as usize] = join(id, node, &left, &right);
        }
    };
    let mut jobs = Vec::with_capacity(tree.tasks.len());
    let mut rest = &mut values[..];
    let mut tops = 0;
    for task in &tree.tasks {
        let (own, after) = rest.split_at_mut((task.leaves.end - task.leaves.start) as usize);
        rest = after;
        tops = task.nodes.end;
        jobs.push((&tree.bottom_up[task.nodes.clone()], own, task.leaves.start));
    }
    par::for_jobs(jobs, |(ids, own, base)| visit(ids, own, base));
    visit(&tree.bottom_up[tops..], &mut values, 0);
    values.truncate(tree.nodes.len());
    values
}
