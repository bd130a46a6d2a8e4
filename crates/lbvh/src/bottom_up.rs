use std::collections::BTreeMap;

use crate::{Child, ChildKind, Node, NodeId, Tree, par};

/// Computes a value for every node from those of its children; returns the values by node.
///
/// `leaf` computes the value of a leaf from its position, `join` that of a node; `unset` initializes memory. The subtrees
/// of all tasks run in parallel, then the nodes above them. The same bits for any number of threads.
pub fn bottom_up<S: Copy + Send + Sync>(
    tree: &Tree,
    unset: S,
    leaf: impl Fn(u32) -> S + Sync,
    join: impl Fn(NodeId, &Node, &S, &S) -> S + Sync,
) -> Vec<S> {
    let mut values = par::filled(tree.leaves.len(), unset);
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
    let tops = tree.tasks.last().map_or(0, |task| task.nodes.end);
    let jobs: Vec<_> = tree
        .tasks
        .iter()
        .zip(tree.slices(&mut values))
        .map(|(task, own)| (&tree.bottom_up[task.nodes.clone()], own, task.leaves.start))
        .collect();
    par::for_jobs(jobs, |(ids, own, base)| visit(ids, own, base));
    visit(&tree.bottom_up[tops..], &mut values, 0);
    values.truncate(tree.nodes.len());
    values
}

/// As [`bottom_up`], but stores `result` of each value only: large values are freed with their task.
pub(crate) fn bottom_up_into<S: Copy + Send + Sync, R: Copy + Send>(
    tree: &Tree,
    (unset, unset_result): (S, R),
    leaf: impl Fn(u32) -> S + Sync,
    join: impl Fn(&S, &S) -> S + Sync,
    result: impl Fn(NodeId, &S) -> R + Sync,
) -> Vec<R> {
    let mut results = vec![unset_result; tree.leaves.len()];
    let mut roots: Vec<Option<(NodeId, S)>> = vec![None; tree.tasks.len()];
    let tops = tree.tasks.last().map_or(0, |task| task.nodes.end);
    let jobs: Vec<_> = tree
        .tasks
        .iter()
        .zip(tree.slices(&mut results))
        .zip(&mut roots)
        .map(|((task, own), root)| (&tree.bottom_up[task.nodes.clone()], own, task.leaves.start, root))
        .collect();
    par::for_jobs(jobs, |(ids, own, base, root)| {
        let mut values = vec![unset; own.len()];
        for &id in ids {
            let node = &tree.nodes[id.index()];
            let of = |child: Child| match child.kind() {
                ChildKind::Leaf(position) => leaf(position),
                ChildKind::Inner(id) => values[(id.0 - base) as usize],
            };
            let value = join(&of(node.left), &of(node.right));
            values[(id.0 - base) as usize] = value;
            own[(id.0 - base) as usize] = result(id, &value);
            *root = Some((id, value));
        }
    });
    // The last node of a task is its root; a task of one leaf has none.
    let mut values: BTreeMap<NodeId, S> = roots.into_iter().flatten().collect();
    for &id in &tree.bottom_up[tops..] {
        let node = &tree.nodes[id.index()];
        let of = |child: Child| match child.kind() {
            ChildKind::Leaf(position) => leaf(position),
            ChildKind::Inner(id) => values[&id],
        };
        let value = join(&of(node.left), &of(node.right));
        values.insert(id, value);
        results[id.index()] = result(id, &value);
    }
    results.truncate(tree.nodes.len());
    results
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain over more leaves than one task holds: every node above the tasks has a single leaf as a child.
    #[test]
    fn single_leaves_above_the_tasks_are_handled() {
        let n = 6_000u32;
        for leaf_first in [true, false] {
            let chain: Vec<[Child; 2]> = (0..n)
                .map(|i| {
                    let rest = if i + 1 < n { Child::inner(NodeId(i + 1)) } else { Child::leaf(n) };
                    if leaf_first { [Child::leaf(i), rest] } else { [rest, Child::leaf(i)] }
                })
                .collect();
            let tree = Tree::from_children(&chain).expect("a chain is a tree");
            assert!(tree.tasks.iter().map(|task| task.leaves.len()).sum::<usize>() < tree.leaves.len());
            // Each value is the range of leaves below.
            let join = |a: &(u32, u32), b: &(u32, u32)| (a.0.min(b.0), a.1.max(b.1));
            let ranges = bottom_up(&tree, (0, 0), |i| (i, i), |_, _, a, b| join(a, b));
            let into = bottom_up_into(&tree, ((0, 0), (0, 0)), |i| (i, i), join, |_, range| *range);
            let want: Vec<(u32, u32)> = tree.nodes.iter().map(|node| (node.first, node.last)).collect();
            assert_eq!(ranges, want, "{leaf_first}");
            assert_eq!(into, want, "{leaf_first}");
        }
    }
}
