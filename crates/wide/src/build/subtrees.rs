//! What is known of each subtree: its boxes and areas, its primitives, and how far they reach.

use std::ops::Range;

use canted_lbvh::{Child, ChildKind, Tree, bottom_up};
use canted_obb::{Aabb, PrimId};

use crate::build::item::{Item, Items};
use crate::node::checked::{Hierarchy, Slot};
use crate::par;

/// Items of one job.
const CHUNK: usize = 1 << 13;

/// The scale of a mesh with these bounds: [`Aabb::unit_scale`], and 1 where they have no extent.
pub(crate) fn unit_scale(bounds: &Aabb) -> f32 {
    bounds.unit_scale().unwrap_or(1.0)
}

/// Half of a box's surface area in the scaled scene.
#[inline]
fn half_area(aabb: &Aabb, scale: f32) -> f32 {
    let [x, y, z]: [f32; 3] = std::array::from_fn(|k| scale * aabb.max[k] - scale * aabb.min[k]);
    x * y + y * z + z * x
}

/// Boxes of a binary tree and half of their areas, in the mesh frame.
pub(crate) struct Aligned {
    /// In leaf order.
    pub(crate) leaf_boxes: Vec<Aabb>,
    /// By node.
    pub(crate) inner_boxes: Vec<Aabb>,
    pub(crate) leaf_areas: Vec<f32>,
    pub(crate) inner_areas: Vec<f32>,
}

impl Aligned {
    /// For a tree over primitives with these boxes, in primitive order.
    pub(crate) fn of(tree: &Tree, boxes: &[Aabb], scale: f32) -> Self {
        Self::of_leaves(tree, par::map(&tree.leaves, CHUNK, |leaf| boxes[leaf.index()]), scale)
    }

    /// For a tree with these boxes of leaves, in leaf order.
    pub(crate) fn of_leaves(tree: &Tree, leaf_boxes: Vec<Aabb>, scale: f32) -> Self {
        let inner_boxes = bottom_up(tree, Aabb::EMPTY, |i| leaf_boxes[i as usize], |_, _, a, b| a.union(*b));
        let areas = |boxes: &[Aabb]| par::map(boxes, CHUNK, |aabb| half_area(aabb, scale));
        Self { leaf_areas: areas(&leaf_boxes), inner_areas: areas(&inner_boxes), leaf_boxes, inner_boxes }
    }
}

/// The primitives of leaves, by their place in leaf order.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LeafContents<'a> {
    /// One for each leaf.
    Single,
    /// Several: where each leaf starts, then the number of primitives.
    Groups(&'a [u32]),
}

impl LeafContents<'_> {
    /// Places of the primitives of leaves `first..=last`.
    #[inline]
    pub(crate) fn range(self, first: u32, last: u32) -> Range<u32> {
        match self {
            Self::Single => first..last + 1,
            Self::Groups(starts) => starts[first as usize]..starts[last as usize + 1],
        }
    }

    /// Their number.
    #[inline]
    pub(crate) fn n(self, first: u32, last: u32) -> usize {
        let range = self.range(first, last);
        (range.end - range.start) as usize
    }
}

/// Greatest absolute coordinates, relative to the reference point, of the bounds of all primitives below each leaf and each node.
pub(crate) struct SubtreeReaches {
    leaf: Vec<f32>,
    node: Vec<f32>,
}

impl SubtreeReaches {
    /// Of a binary tree whose leaves hold `members` of the `primitives` in leaf order; `boxes` are those of whole primitives in
    /// object space, if they are known.
    pub(crate) fn of_tree<I: Item>(
        tree: &Tree,
        members: LeafContents,
        primitives: &[PrimId],
        items: Items<I>,
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
    pub(crate) fn of_leaves(hierarchy: &Hierarchy, leaf: Vec<f32>) -> Self {
        let mut reaches = Self { leaf, node: vec![0.0; hierarchy.nodes.len()] };
        for (i, node) in hierarchy.nodes.iter().enumerate().rev() {
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
