use canted_lbvh::{Child, ChildKind, NodeId, Tree};
use canted_obb::Aabb;

use crate::{lanes::Lanes, par};

/// Nodes per job.
const CHUNK: usize = 1 << 13;

/// An inner node with the boxes of its children: one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Pair {
    pub(crate) boxes: Lanes,
    pub(crate) children: [Child; 2],
    /// The slot that refers to this node.
    pub(crate) parent: Slot,
    /// Nodes on the longest path to a leaf, both ends included.
    pub(crate) height: u32,
}

/// Position of a child: twice the number of the parent, plus one for the right child.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Slot(u32);

impl Slot {
    pub(crate) fn new(node: NodeId, side: u32) -> Self {
        Self(2 * node.0 + side)
    }

    pub(crate) fn node(self) -> NodeId {
        NodeId(self.0 >> 1)
    }

    pub(crate) fn side(self) -> u32 {
        self.0 & 1
    }

    pub(crate) fn sibling(self) -> Self {
        Self(self.0 ^ 1)
    }
}

/// A mutable tree: nodes store their parents and the boxes of their children.
///
/// Leaves are identified by their position in the original tree. An extra pair after the nodes has the root as its left
/// child, so that every node has a slot.
#[derive(Clone, Debug)]
pub(crate) struct Pairs {
    pub(crate) pairs: Vec<Pair>,
    pub(crate) leaf_parents: Vec<Slot>,
}

impl Pairs {
    /// The tree with boxes in units of `1 / scale`; at least two leaves.
    pub(crate) fn new(tree: &Tree, leaf_boxes: &[Aabb], scale: f32) -> Self {
        let unset = Pair { boxes: Lanes::UNSET, children: [Child::inner(NodeId::ROOT); 2], parent: Slot(0), height: 1 };
        let mut pairs = par::filled(tree.leaves.len(), unset);
        let mut leaf_parents = par::filled(tree.leaves.len(), Slot(0));
        let fill = |ids: &[NodeId], pairs: &mut [Pair], leaf_parents: &mut [Slot], base: u32| {
            for &id in ids {
                let node = tree.nodes[id.index()];
                let mut pair = Pair { children: [node.left, node.right], ..unset };
                for (side, child) in (0..).zip(pair.children) {
                    let slot = Slot::new(id, side);
                    let (aabb, height) = match child.kind() {
                        ChildKind::Leaf(position) => {
                            leaf_parents[(position - base) as usize] = slot;
                            (Lanes::of(&leaf_boxes[position as usize], scale), 1)
                        }
                        ChildKind::Inner(below) => {
                            let below = &mut pairs[(below.0 - base) as usize];
                            below.parent = slot;
                            (below.boxes.around(), below.height)
                        }
                    };
                    pair.boxes = pair.boxes.with(side, &aabb);
                    pair.height = pair.height.max(1 + height);
                }
                pairs[(id.0 - base) as usize] = pair;
            }
        };
        // Each task owns a slice of every array; the nodes above follow. Leaves directly below those are in no task.
        let mut jobs = Vec::with_capacity(tree.tasks.len());
        let (mut pairs_left, mut parents_left, mut done, mut tops) = (&mut pairs[..], &mut leaf_parents[..], 0, 0);
        for task in &tree.tasks {
            let (gap, n) = ((task.leaves.start - done) as usize, task.leaves.len());
            let (own_pairs, rest) = pairs_left[gap..].split_at_mut(n);
            let (own_parents, parents_rest) = parents_left[gap..].split_at_mut(n);
            (pairs_left, parents_left, done, tops) = (rest, parents_rest, task.leaves.end, task.nodes.end);
            jobs.push((&tree.bottom_up[task.nodes.clone()], own_pairs, own_parents, task.leaves.start));
        }
        par::for_jobs(jobs, |(ids, pairs, leaf_parents, base)| fill(ids, pairs, leaf_parents, base));
        fill(&tree.bottom_up[tops..], &mut pairs, &mut leaf_parents, 0);
        let mut pairs = Self { pairs, leaf_parents };
        pairs.put(pairs.top(), Child::inner(NodeId::ROOT), &pairs.pairs[0].boxes.around());
        pairs
    }

    /// The slot of the root.
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes")]
    pub(crate) fn top(&self) -> Slot {
        Slot::new(NodeId(self.pairs.len() as u32 - 1), 0)
    }

    #[inline]
    pub(crate) fn pair(&self, node: NodeId) -> &Pair {
        &self.pairs[node.index()]
    }

    #[inline]
    pub(crate) fn child(&self, slot: Slot) -> Child {
        self.pair(slot.node()).children[slot.side() as usize]
    }

    /// The box in a slot.
    #[inline]
    pub(crate) fn aabb(&self, slot: Slot) -> Lanes {
        self.pair(slot.node()).boxes.side(slot.side())
    }

    #[inline]
    pub(crate) fn slot(&self, child: Child) -> Slot {
        match child.kind() {
            ChildKind::Leaf(position) => self.leaf_parents[position as usize],
            ChildKind::Inner(id) => self.pair(id).parent,
        }
    }

    #[inline]
    pub(crate) fn height(&self, child: Child) -> u32 {
        match child.kind() {
            ChildKind::Leaf(_) => 1,
            ChildKind::Inner(id) => self.pair(id).height,
        }
    }

    /// Stores a subtree and its box in a slot.
    pub(crate) fn put(&mut self, slot: Slot, child: Child, aabb: &Lanes) {
        match child.kind() {
            ChildKind::Leaf(position) => self.leaf_parents[position as usize] = slot,
            ChildKind::Inner(id) => self.pairs[id.index()].parent = slot,
        }
        let pair = &mut self.pairs[slot.node().index()];
        pair.children[slot.side() as usize] = child;
        pair.boxes = pair.boxes.with(slot.side(), aabb);
    }

    /// Sum of the half areas of all inner nodes.
    pub(crate) fn sum_of_areas(&self) -> f64 {
        let (_, nodes) = self.pairs.split_last().unwrap_or((&self.pairs[0], &[]));
        let of = |nodes: &[Pair]| nodes.iter().map(|pair| pair.boxes.around().exact_half_area()).sum::<f64>();
        par::map_chunks(nodes, CHUNK, |_, nodes| of(nodes)).iter().sum()
    }

    /// Children of every node, in the order of a traversal that visits left children first; leaves by primitive.
    pub(crate) fn children(&self, tree: &Tree) -> Vec<[Child; 2]> {
        let mut children = Vec::with_capacity(tree.nodes.len());
        let mut stack = vec![(self.child(self.top()), None::<(usize, usize)>)];
        while let Some((child, slot)) = stack.pop() {
            let renamed = match child.kind() {
                ChildKind::Leaf(position) => Child::leaf(tree.leaves[position as usize].0),
                ChildKind::Inner(id) => {
                    let new = children.len();
                    let [left, right] = self.pair(id).children;
                    children.push([left, right]);
                    stack.extend([(right, Some((new, 1))), (left, Some((new, 0)))]);
                    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes")]
                    Child::inner(NodeId(new as u32))
                }
            };
            if let Some((parent, side)) = slot {
                children[parent][side] = renamed;
            }
        }
        children
    }
}
