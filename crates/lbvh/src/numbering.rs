//! Nodes in the numbering of [`Node`], from a tree of any other numbering.
//!
//! ```text
//! root -> outline: nodes near the root, parts below -> shape of each part -> numbers of its leaves -> nodes of each part
//! ```
//!
//! Parts are walked by all threads. The outline depends on the tree alone, and each part writes the slice that its leaves number, so the result is the
//! same for any number of threads.

use canted_obb::PrimId;

use crate::par;
use crate::tree::{Child, ChildKind, Node, NodeId, Task, Tree};

/// Levels of nodes above the parts: up to 512 parts.
const LEVELS: u32 = 9;

/// Fewest leaves of a tree that is divided into parts.
const DIVIDED: usize = 1 << 14;

/// What stands in the outline, where a walk that visits left children first arrives at it.
#[derive(Clone, Copy)]
enum Entry {
    /// A node near the root.
    Node,
    /// All that is below, at this depth.
    Part(Child, u32),
}

/// The nodes of a part, parents first and left children before right ones, each with its children and the number of leaves below.
type Shape = Vec<([Child; 2], u32)>;

/// A part that is given numbers: its shape, or the primitive of one that is a leaf; the number of its root and of its first leaf, its depth, and what it
/// writes.
struct Job<'a> {
    shape: Shape,
    single: Option<PrimId>,
    root: NodeId,
    first: u32,
    depth: u32,
    nodes: &'a mut [Node],
    leaves: &'a mut [PrimId],
}

impl Tree {
    /// The tree of at least two leaves with the children that `children` gives of each node; `primitive` gives the primitive of a leaf.
    ///
    /// They must describe a tree: [`Tree::from_children`] checks that.
    ///
    /// # Panics
    /// If there are other than `n_leaves` leaves below `root`.
    #[must_use]
    pub fn numbered(
        n_leaves: usize,
        root: NodeId,
        children: impl Fn(NodeId) -> [Child; 2] + Sync,
        primitive: impl Fn(u32) -> PrimId + Sync,
    ) -> Self {
        let levels = if n_leaves < DIVIDED { 0 } else { LEVELS };
        let outline = outline(root, levels, &children);
        let shape = |entry: &Entry| match entry {
            Entry::Part(child, _) => shape(*child, &children),
            Entry::Node => vec![],
        };
        let shapes = par::map(&outline, 1, shape);
        let splits = splits(&outline, &shapes);
        // One more than there are: the numbers of a part's leaves are a range of both arrays.
        let mut nodes = par::filled(n_leaves, Node::UNSET);
        let mut leaves = par::filled(n_leaves, PrimId(0));
        let mut tops = Vec::with_capacity(outline.len());
        let mut jobs = vec![];
        let (mut nodes_left, mut leaves_left) = (&mut nodes[..], &mut leaves[..]);
        let mut open = vec![(NodeId::ROOT, 0)];
        for ((entry, shape), [n_left, n_right]) in outline.iter().zip(shapes).zip(splits) {
            let (number, first) = open.pop().expect("two entries below each node");
            match *entry {
                Entry::Node => {
                    let (node, below) = node(first, n_left, n_right);
                    tops.push((number, node));
                    open.extend(below);
                }
                Entry::Part(child, depth) => {
                    let single = match child.kind() {
                        ChildKind::Leaf(leaf) => Some(primitive(leaf)),
                        ChildKind::Inner(_) => None,
                    };
                    let n = (n_left + n_right) as usize;
                    let (own_nodes, nodes_after) = nodes_left.split_at_mut(n);
                    let (own_leaves, leaves_after) = leaves_left.split_at_mut(n);
                    (nodes_left, leaves_left) = (nodes_after, leaves_after);
                    jobs.push(Job { shape, single, root: number, first, depth, nodes: own_nodes, leaves: own_leaves });
                }
            }
        }
        assert!(nodes_left.is_empty(), "other than {n_leaves} leaves");
        let numbered = par::map_jobs(jobs, |job| job.run(&primitive));
        // Parents first, each subtree contiguous.
        let (mut order, mut depth) = (Vec::with_capacity(n_leaves - 1), 0);
        let (mut of_parts, mut of_tops) = (numbered.iter(), tops.iter());
        for entry in &outline {
            match entry {
                Entry::Node => order.extend(of_tops.next().map(|(number, _)| *number)),
                Entry::Part(..) => {
                    let (numbers, part_depth) = of_parts.next().expect("a job for each part");
                    order.extend_from_slice(numbers);
                    depth = depth.max(*part_depth);
                }
            }
        }
        for (number, node) in tops {
            nodes[number.index()] = node;
        }
        nodes.truncate(n_leaves - 1);
        let mut tree = Self { nodes, leaves, bottom_up: Vec::with_capacity(n_leaves - 1), tasks: vec![], depth };
        tree.schedule(&order);
        tree
    }

    /// Groups the nodes, given parents first with each subtree contiguous, into tasks.
    fn schedule(&mut self, parents_first: &[NodeId]) {
        let limit = Self::task_limit(self.leaves.len());
        let mut tops = vec![];
        let mut rest = parents_first;
        while let Some((&id, below)) = rest.split_first() {
            let node = self.nodes[id.index()];
            if node.n_leaves() > limit {
                tops.push(id);
                rest = below;
                continue;
            }
            let (own, after) = rest.split_at(node.n_leaves() as usize - 1);
            let start = self.bottom_up.len();
            self.bottom_up.extend(own.iter().rev());
            self.tasks.push(Task { leaves: node.first..node.last + 1, nodes: start..self.bottom_up.len() });
            rest = after;
        }
        self.bottom_up.extend(tops.iter().rev());
    }
}

/// The nodes down to a level, and the parts below them.
fn outline(root: NodeId, levels: u32, children: impl Fn(NodeId) -> [Child; 2]) -> Vec<Entry> {
    let (mut outline, mut open) = (vec![], vec![(Child::inner(root), 1)]);
    while let Some((child, depth)) = open.pop() {
        match child.kind() {
            ChildKind::Inner(id) if depth <= levels => {
                outline.push(Entry::Node);
                let [left, right] = children(id);
                open.extend([(right, depth + 1), (left, depth + 1)]);
            }
            _ => outline.push(Entry::Part(child, depth)),
        }
    }
    outline
}

/// The nodes of a part; none for a leaf.
fn shape(child: Child, children: impl Fn(NodeId) -> [Child; 2]) -> Shape {
    let (mut shape, mut open) = (vec![], vec![child]);
    while let Some(child) = open.pop() {
        if let ChildKind::Inner(id) = child.kind() {
            let [left, right] = children(id);
            shape.push(([left, right], 0));
            open.extend([right, left]);
        }
    }
    for at in (0..shape.len()).rev() {
        let [n_left, n_right] = sides(&shape, at);
        shape[at].1 = n_left + n_right;
    }
    shape
}

/// Numbers of leaves below both children of a node, whose sizes are known. The nodes below the left child follow it, then those below the right one.
fn sides(shape: &[([Child; 2], u32)], at: usize) -> [u32; 2] {
    let ([left, right], _) = shape[at];
    let size = |child: Child, at: usize| match child.kind() {
        ChildKind::Leaf(_) => 1,
        ChildKind::Inner(_) => shape[at].1,
    };
    let n_left = size(left, at + 1);
    [n_left, size(right, at + n_left as usize)]
}

/// Numbers of leaves below both children of each entry; of a part all of them, and 0.
fn splits(outline: &[Entry], shapes: &[Shape]) -> Vec<[u32; 2]> {
    let mut splits = vec![[0; 2]; outline.len()];
    // Of the entries that follow, the next one last.
    let mut sizes = vec![];
    for (i, entry) in outline.iter().enumerate().rev() {
        splits[i] = match entry {
            Entry::Node => [(); 2].map(|()| sizes.pop().expect("two entries below each node")),
            Entry::Part(..) => [shapes[i].first().map_or(1, |(_, n)| *n), 0],
        };
        sizes.push(splits[i][0] + splits[i][1]);
    }
    splits
}

/// A node over leaves from `first` on, and the number and the first leaf of each child, the left one last; of a leaf the number is not used.
fn node(first: u32, n_left: u32, n_right: u32) -> (Node, [(NodeId, u32); 2]) {
    let (split, last) = (first + n_left - 1, first + n_left + n_right - 1);
    let (left, right) = (Tree::subtree(first, split, true), Tree::subtree(split + 1, last, false));
    (Node { left, right, first, last }, [(NodeId(split + 1), split + 1), (NodeId(split), first)])
}

impl Job<'_> {
    /// Writes nodes and leaves; returns the numbers of the nodes in their order, and the greatest depth.
    fn run(self, primitive: impl Fn(u32) -> PrimId) -> (Vec<NodeId>, u32) {
        let Self { shape, single, root, first: base, depth, nodes, leaves } = self;
        if let Some(single) = single {
            leaves[0] = single;
            return (vec![], depth);
        }
        let (mut numbers, mut deepest) = (Vec::with_capacity(shape.len()), depth);
        let mut open = vec![(root, base, depth)];
        for at in 0..shape.len() {
            let (number, first, depth) = open.pop().expect("a number for each node");
            let [n_left, n_right] = sides(&shape, at);
            let (node, below) = node(first, n_left, n_right);
            nodes[(number.0 - base) as usize] = node;
            numbers.push(number);
            deepest = deepest.max(depth + 1);
            let ([left, right], _) = shape[at];
            for (child, (number, first)) in [right, left].into_iter().zip(below) {
                match child.kind() {
                    ChildKind::Leaf(leaf) => leaves[(first - base) as usize] = primitive(leaf),
                    ChildKind::Inner(_) => open.push((number, first, depth + 1)),
                }
            }
        }
        (numbers, deepest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that look random: a linear congruence (Knuth 1997).
    fn below(state: &mut u64, n: usize) -> usize {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 33) as usize % n
    }

    /// A tree over primitives in a random order, its nodes in another one, the root first; often skewed, so that parts differ in size.
    fn random(n_leaves: u32, state: &mut u64) -> Vec<[Child; 2]> {
        let mut roots: Vec<Child> = (0..n_leaves).map(Child::leaf).collect();
        let mut made = vec![];
        while roots.len() > 1 {
            let skewed = below(state, 4) == 0;
            let a = roots.swap_remove(if skewed { roots.len() - 1 } else { below(state, roots.len()) });
            let b = roots.swap_remove(below(state, roots.len()));
            made.push([a, b]);
            roots.push(Child::inner(NodeId(made.len() as u32 - 1)));
        }
        let n = made.len() as u32;
        let renamed = |child: Child| match child.kind() {
            ChildKind::Inner(NodeId(id)) => Child::inner(NodeId(n - 1 - id)),
            ChildKind::Leaf(_) => child,
        };
        made.iter().rev().map(|pair| pair.map(renamed)).collect()
    }

    /// Walks both trees at once: the same leaves at the same places, numbers as [`Node`] states.
    fn check(tree: &Tree, children: &[[Child; 2]]) {
        let (mut next_leaf, mut depth) = (0, 0);
        let mut open = vec![(Child::inner(NodeId::ROOT), Child::inner(NodeId::ROOT), 1)];
        let mut is_seen = vec![false; tree.nodes.len()];
        while let Some((given, numbered, level)) = open.pop() {
            depth = depth.max(level);
            match (given.kind(), numbered.kind()) {
                (ChildKind::Leaf(primitive), ChildKind::Leaf(position)) => {
                    assert_eq!((position, tree.leaves[position as usize]), (next_leaf, PrimId(primitive)));
                    next_leaf += 1;
                }
                (ChildKind::Inner(old), ChildKind::Inner(new)) => {
                    let node = tree.nodes[new.index()];
                    assert_eq!(node.first, next_leaf);
                    assert!(new == NodeId::ROOT || new.0 == node.first || new.0 == node.last);
                    assert!(!std::mem::replace(&mut is_seen[new.index()], true));
                    let [left, right] = children[old.index()];
                    open.extend([(right, node.right, level + 1), (left, node.left, level + 1)]);
                }
                other => panic!("{other:?}"),
            }
        }
        assert_eq!((next_leaf as usize, depth), (tree.leaves.len(), tree.depth));
        // Children before parents, all of them.
        let mut place = vec![usize::MAX; tree.nodes.len()];
        tree.bottom_up.iter().enumerate().for_each(|(i, id)| place[id.index()] = i);
        for (i, node) in tree.nodes.iter().enumerate() {
            for child in [node.left, node.right] {
                if let ChildKind::Inner(below) = child.kind() {
                    assert!(place[below.index()] < place[i]);
                }
            }
        }
        assert!(place.iter().all(|&at| at < tree.nodes.len()));
    }

    #[test]
    fn trees_of_any_shape_keep_their_leaves_and_depth() {
        let mut state = 5;
        let sizes = [2, 3, 10, 1000, DIVIDED as u32 - 1, DIVIDED as u32, 50_000];
        for n in sizes {
            let children = random(n, &mut state);
            check(&Tree::from_children(&children).unwrap(), &children);
        }
        // A chain, of which all but a few nodes are in one part.
        let n = 2 * DIVIDED as u32;
        let next = |i: u32| if i + 2 < n { Child::inner(NodeId(i + 1)) } else { Child::leaf(n - 1) };
        let chain: Vec<[Child; 2]> = (0..n - 1)
            .map(|i| if i % 2 == 0 { [Child::leaf(i), next(i)] } else { [next(i), Child::leaf(i)] })
            .collect();
        check(&Tree::from_children(&chain).unwrap(), &chain);
    }

    #[test]
    #[should_panic(expected = "other than 4 leaves")]
    fn another_number_of_leaves_is_found() {
        let children = [[Child::leaf(0), Child::inner(NodeId(1))], [Child::leaf(1), Child::leaf(2)]];
        let _ = Tree::numbered(4, NodeId::ROOT, |id| children[id.index()], PrimId);
    }
}
