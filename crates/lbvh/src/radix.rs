use std::{collections::BTreeMap, ops::Range};

use crate::{Child, MAX_DEPTH, Node, NodeId, Sorted, Task, Tree, par};

/// Binary radix tree over sorted codes.
///
/// Reads: sorted codes. Writes: nodes, their bottom-up order, the depth.
/// Holds: each node splits its range at the highest differing bit of (code, position), so the depth is at most
/// code bits + ceil(log2 n) + 1, leaf included.
/// Source: Karras 2012 for the tree and its numbering; built from the leaves up after Apetrei 2014, each subtree in one
/// pass with a stack, which is faster than a search per node.
#[must_use]
pub fn radix(sorted: Sorted) -> Tree {
    let Sorted { codes, leaves } = sorted;
    let n = leaves.len();
    if n < 2 {
        return Tree::without_nodes(leaves);
    }
    let (tops, ranges) = divide(&codes);
    let mut nodes = vec![Node::UNSET; n];
    let mut bottom_up = vec![NodeId(0); n - 1];
    let mut heights = vec![0u32; ranges.len()];
    // Split the arrays into the slices of each task.
    let mut tasks = Vec::with_capacity(ranges.len());
    let mut jobs = Vec::with_capacity(ranges.len());
    let (mut nodes_left, mut order_left, mut done) = (&mut nodes[..], &mut bottom_up[..], 0);
    for (range, height) in ranges.iter().zip(&mut heights) {
        let n_leaves = (range.end - range.start) as usize;
        let (own_nodes, nodes_rest) = nodes_left.split_at_mut(n_leaves);
        let (own_order, order_rest) = order_left.split_at_mut(n_leaves - 1);
        (nodes_left, order_left) = (nodes_rest, order_rest);
        tasks.push(Task { leaves: range.clone(), nodes: done..done + n_leaves - 1 });
        done += n_leaves - 1;
        jobs.push((range.clone(), own_nodes, own_order, height));
    }
    par::for_jobs(jobs, |(range, nodes, order, height)| *height = build_task(&codes, range, nodes, order));
    // Build the nodes above the tasks, parents last.
    let mut heights: BTreeMap<_, _> =
        ranges.iter().zip(heights).map(|(range, height)| ((range.start, range.end - 1), height)).collect();
    let mut depth = heights.get(&(0, ranges[0].end - 1)).copied().unwrap_or(1);
    for (top, slot) in tops.iter().rev().zip(&mut bottom_up[done..]) {
        let &Top { id, first, split, last } = top;
        depth = 1 + heights[&(first, split)].max(heights[&(split + 1, last)]);
        heights.insert((first, last), depth);
        let left = Tree::subtree(first, split, true);
        nodes[id.index()] = Node { left, right: Tree::subtree(split + 1, last, false), first, last };
        *slot = id;
    }
    nodes.pop();
    Tree { nodes, leaves, bottom_up, tasks, depth }
}

/// A node above all tasks.
struct Top {
    id: NodeId,
    first: u32,
    split: u32,
    last: u32,
}

/// Splits from the root until subtrees are small; returns the nodes above, parents first, and the leaf ranges in order.
fn divide(codes: &[u64]) -> (Vec<Top>, Vec<Range<u32>>) {
    let limit = Tree::task_limit(codes.len());
    let (mut tops, mut ranges, mut stack) = (vec![], vec![], vec![(NodeId::ROOT, 0, codes.len() as u32 - 1)]);
    while let Some((id, first, last)) = stack.pop() {
        if last - first < limit {
            ranges.push(first..last + 1);
            continue;
        }
        let split = find_split(codes, first, last);
        tops.push(Top { id, first, split, last });
        stack.push((NodeId(split + 1), split + 1, last));
        stack.push((NodeId(split), first, split));
    }
    (tops, ranges)
}

/// Last leaf of the lower part of `first..=last`, after which the highest differing bit of (code, position) is 1.
fn find_split(codes: &[u64], first: u32, last: u32) -> u32 {
    let differ = codes[first as usize] ^ codes[last as usize];
    if differ == 0 {
        let bit = 31 - (first ^ last).leading_zeros();
        return (last >> bit << bit) - 1;
    }
    let bit = 63 - differ.leading_zeros();
    let n_lower = codes[first as usize..=last as usize].partition_point(|code| code >> bit & 1 == 0);
    first + n_lower as u32 - 1
}

/// Level of the split between leaves `i` and `i + 1`: the highest differing bit of (code, position). The two boundaries of
/// a subtree have different levels, both higher than those inside.
#[inline]
fn level(codes: &[u64], i: u32) -> u8 {
    let differ = codes[i as usize] ^ codes[i as usize + 1];
    if differ == 0 { (32 - (i ^ (i + 1)).leading_zeros()) as u8 } else { (96 - differ.leading_zeros()) as u8 }
}

/// Builds the subtree over `range`; returns its height in nodes, leaf included.
fn build_task(codes: &[u64], range: Range<u32>, nodes: &mut [Node], order: &mut [NodeId]) -> u32 {
    /// A finished subtree that waits for its right sibling.
    struct Pending {
        child: Child,
        first: u32,
        height: u32,
        /// Level of the boundary to the right.
        level: u8,
    }
    let level_left = if range.start == 0 { u8::MAX } else { level(codes, range.start - 1) };
    let level_right = |leaf: u32| if leaf as usize + 1 == codes.len() { u8::MAX } else { level(codes, leaf) };
    let mut stack: Vec<Pending> = Vec::with_capacity(MAX_DEPTH as usize);
    let mut order = order.iter_mut();
    for leaf in range.clone() {
        let right = level_right(leaf);
        let (mut child, mut first, mut height) = (Child::leaf(leaf), leaf, 1);
        while stack.last().is_some_and(|left| left.level < right) {
            let Some(left) = stack.pop() else { break };
            // The parent splits at the lower of the two boundaries.
            let is_left = right < stack.last().map_or(level_left, |outer| outer.level);
            let id = if is_left { leaf } else { left.first };
            nodes[(id - range.start) as usize] = Node { left: left.child, right: child, first: left.first, last: leaf };
            if let Some(slot) = order.next() {
                *slot = NodeId(id);
            }
            (child, first, height) = (Child::inner(NodeId(id)), left.first, 1 + height.max(left.height));
        }
        stack.push(Pending { child, first, height, level: right });
    }
    stack.pop().map_or(0, |root| root.height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Bits, ChildKind, sort_by_code};
    use proptest::prelude::*;

    /// The tree by its definition, top down: split at the highest differing bit of (code, position).
    fn oracle(codes: &[u64]) -> Vec<Node> {
        let key = |i: u32| u128::from(codes[i as usize]) << 32 | u128::from(i);
        let mut nodes = vec![Node::UNSET; codes.len().saturating_sub(1)];
        let mut stack = if codes.len() < 2 { vec![] } else { vec![(0u32, 0u32, codes.len() as u32 - 1)] };
        while let Some((id, first, last)) = stack.pop() {
            let bit = 127 - (key(first) ^ key(last)).leading_zeros();
            let split = (first..last).find(|&i| key(i + 1) >> bit & 1 == 1).unwrap();
            nodes[id as usize] = Node {
                left: Tree::subtree(first, split, true),
                right: Tree::subtree(split + 1, last, false),
                first,
                last,
            };
            if first < split {
                stack.push((split, first, split));
            }
            if split + 1 < last {
                stack.push((split + 1, split + 1, last));
            }
        }
        nodes
    }

    fn check(codes: &[u64]) {
        let sorted = sort_by_code(codes, Bits::B63);
        let tree = radix(sorted.clone());
        assert_eq!(tree.nodes, oracle(&sorted.codes));
        // Children come before parents, every node once.
        let mut seen = vec![false; tree.nodes.len()];
        for &id in &tree.bottom_up {
            let node = tree.nodes[id.index()];
            for child in [node.left, node.right] {
                if let ChildKind::Inner(child) = child.kind() {
                    assert!(seen[child.index()], "node {} before its child {}", id.0, child.0);
                }
            }
            assert!(!std::mem::replace(&mut seen[id.index()], true), "node {} twice", id.0);
        }
        assert!(seen.into_iter().all(|s| s));
        for task in &tree.tasks {
            for id in &tree.bottom_up[task.nodes.clone()] {
                assert!(task.leaves.contains(&id.0));
            }
        }
        let bound = 63 + usize::BITS - codes.len().saturating_sub(1).leading_zeros() + 1;
        assert!(tree.depth <= bound, "depth {} beyond {bound}", tree.depth);
    }

    #[test]
    fn equals_the_definition_on_chains_duplicates_and_sizes() {
        for n in [0u64, 1, 2, 3, 4, 255, 256, 257, 10_000] {
            check(&vec![5; n as usize]);
            check(&(0..n).collect::<Vec<_>>());
            check(&(0..n).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 50).collect::<Vec<_>>());
        }
        check(&(0..63).map(|i| 1u64 << i).collect::<Vec<_>>());
    }

    #[test]
    fn depth_is_that_of_the_deepest_leaf() {
        let sorted = sort_by_code(&(0..20_000u64).map(|i| i * i * 77).collect::<Vec<_>>(), Bits::B63);
        let tree = radix(sorted);
        let (mut longest, mut stack) = (0, vec![(tree.root().unwrap(), 1)]);
        while let Some((child, depth)) = stack.pop() {
            longest = longest.max(depth);
            if let ChildKind::Inner(id) = child.kind() {
                let node = tree.nodes[id.index()];
                stack.extend([(node.left, depth + 1), (node.right, depth + 1)]);
            }
        }
        assert_eq!(tree.depth, longest);
    }

    proptest! {
        #[test]
        fn equals_the_definition(codes in prop::collection::vec(0u64..40, 0..200)) {
            check(&codes);
        }
        #[test]
        fn equals_the_definition_sparse(codes in prop::collection::vec(any::<u64>().prop_map(|c| c >> 1), 0..200)) {
            check(&codes);
        }
    }
}
