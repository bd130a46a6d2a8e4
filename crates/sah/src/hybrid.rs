use canted_lbvh::{Child, ChildKind, MAX_DEPTH, NodeId, Tree};
use canted_obb::Aabb;

use crate::{TopDownConfig, par, top_down};

/// Most primitives of a subtree that stays a radix tree.
const MOST: u32 = 64;

/// Parts per job.
const CHUNK: usize = 1 << 8;

/// The tree `radix` whose top, down to subtrees of at most [`MOST`] primitives, is replaced by a binned SAH tree.
///
/// Reads: a radix tree over finite boxes. Writes: a tree with its own leaf order. Holds: a depth of at most [`MAX_DEPTH`]; the
/// same bits for any number of threads.
/// Source: Lauterbach et al. 2009; Pantaleoni and Luebke 2010 for the SAH on top.
pub(crate) fn hybrid(radix: Tree, boxes: &[Aabb]) -> Tree {
    let parts = parts(&radix);
    if parts.len() < 2 {
        return radix;
    }
    let around = |part: &Child| {
        let leaves = match part.kind() {
            ChildKind::Leaf(position) => position..position + 1,
            ChildKind::Inner(id) => radix.nodes[id.index()].first..radix.nodes[id.index()].last + 1,
        };
        let leaves = &radix.leaves[leaves.start as usize..leaves.end as usize];
        leaves.iter().fold(Aabb::EMPTY, |all, leaf| all.union(boxes[leaf.index()]))
    };
    // A subtree of `MOST` leaves has as many nodes from its root to a leaf at most.
    let config = TopDownConfig { max_depth: MAX_DEPTH - MOST + 1, ..TopDownConfig::BINNED };
    let top = top_down(&par::map(&parts, CHUNK, around), &config);
    Tree::from_children(&joined(&top, &radix, &parts)).expect("each part stands once in the top")
}

/// The largest subtrees of at most [`MOST`] primitives, in leaf order.
fn parts(tree: &Tree) -> Vec<Child> {
    let mut parts = vec![];
    let mut open: Vec<Child> = tree.root().into_iter().collect();
    while let Some(child) = open.pop() {
        match child.kind() {
            ChildKind::Inner(id) if tree.nodes[id.index()].n_leaves() > MOST => {
                let node = tree.nodes[id.index()];
                open.extend([node.right, node.left]);
            }
            _ => parts.push(child),
        }
    }
    parts
}

/// The children of each node of `top`, whose leaves are replaced by `parts` of `radix`; of leaves the primitives.
fn joined(top: &Tree, radix: &Tree, parts: &[Child]) -> Vec<[Child; 2]> {
    let mut children = Vec::with_capacity(radix.nodes.len());
    // Subtrees, each with the tree that it is of, in the order of their numbers.
    let mut open = vec![(top, Child::inner(NodeId::ROOT))];
    let mut next = 0;
    while let Some(&(tree, child)) = open.get(next) {
        next += 1;
        let ChildKind::Inner(id) = child.kind() else { unreachable!("leaves get no number") };
        let node = tree.nodes[id.index()];
        children.push([node.left, node.right].map(|child| {
            let (tree, child) = match child.kind() {
                ChildKind::Leaf(position) if std::ptr::eq(tree, top) => {
                    (radix, parts[top.leaves[position as usize].index()])
                }
                _ => (tree, child),
            };
            match child.kind() {
                ChildKind::Leaf(position) => Child::leaf(tree.leaves[position as usize].0),
                ChildKind::Inner(_) => {
                    open.push((tree, child));
                    Child::inner(NodeId(open.len() as u32 - 1))
                }
            }
        }));
    }
    children
}
