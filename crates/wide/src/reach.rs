//! How far the content of each subtree reaches: what the padding of its box is relative to.

use canted_lbvh::{Child, ChildKind, Tree, bottom_up};
use canted_obb::{Aabb, PrimId};

use crate::item::{Item, Items};
use crate::measure::Aligned;
use crate::members::Members;
use crate::outline::{Outline, Slot};
use crate::par;

/// Items of one job.
const CHUNK: usize = 1 << 13;

/// Greatest absolute coordinates, relative to the reference point, of the bounds of all primitives below each leaf and each node.
pub(crate) struct Reaches {
    leaf: Vec<f32>,
    node: Vec<f32>,
}

impl Reaches {
    /// Of a binary tree whose leaves hold `members` of the `primitives` in leaf order; `boxes` are those of whole primitives in
    /// object space, if they are known.
    pub(crate) fn of_tree<S: Items>(
        tree: &Tree,
        members: Members,
        primitives: &[PrimId],
        items: S,
        boxes: Option<&Aligned>,
    ) -> Self {
        if let Some(aligned) = boxes {
            let of_boxes = |boxes: &[Aabb]| par::map(boxes, CHUNK, Aabb::reach);
            return Self { leaf: of_boxes(&aligned.leaf_boxes), node: of_boxes(&aligned.inner_boxes) };
        }
        let of_items = par::map(primitives, CHUNK, |primitive| items.get(primitive.index()).aabb().reach());
        let of_leaf = |i: u32| {
            let places = members.range(i, i);
            of_items[places.start as usize..places.end as usize].iter().copied().fold(0.0, f32::max)
        };
        let n_leaves = u32::try_from(tree.leaves.len()).expect("leaves have 32-bit numbers");
        let leaf: Vec<f32> = (0..n_leaves).map(of_leaf).collect();
        let node = bottom_up(tree, 0.0, |i| leaf[i as usize], |_, _, a: &f32, b: &f32| a.max(*b));
        Self { leaf, node }
    }

    /// Of the leaves and nodes of a BVH, from those of its leaves.
    pub(crate) fn of_leaves(outline: &Outline, leaf: Vec<f32>) -> Self {
        let mut reaches = Self { leaf, node: vec![0.0; outline.nodes.len()] };
        for (i, node) in outline.nodes.iter().enumerate().rev() {
            reaches.node[i] = node.slots.map(|slot| reaches.of_slot(slot)).into_iter().fold(0.0, f32::max);
        }
        reaches
    }

    /// Below a child of the binary tree.
    pub(crate) fn of_child(&self, child: Child) -> f32 {
        match child.kind() {
            ChildKind::Leaf(place) => self.leaf[place as usize],
            ChildKind::Inner(id) => self.node[id.index()],
        }
    }

    /// Below a slot of a node; 0 if it is empty.
    pub(crate) fn of_slot(&self, slot: Slot) -> f32 {
        match slot {
            Slot::Empty => 0.0,
            Slot::Leaf(leaf) => self.leaf[leaf],
            Slot::Node(node) => self.node[node],
        }
    }
}
