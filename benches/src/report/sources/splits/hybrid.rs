//! Radix trees of neighboring primitives below an SAH tree over their boxes.

use canted_lbvh::{Child, ChildKind, NodeId, Tree};
use canted_obb::{Aabb, PrimId};
use canted_sah::{Builder, TopDownConfig};

/// Most primitives of a subtree that stays a radix tree.
const MOST: u32 = 64;

/// Replaces the top of the radix tree, down to subtrees of at most [`MOST`] primitives, by a binned SAH tree.
///
/// Source: Lauterbach et al. 2009, and Pantaleoni, Luebke 2010, for the SAH on top.
pub(super) fn tree(boxes: &[Aabb], bounds: &Aabb) -> Tree {
    let radix = canted_sah::build(boxes, bounds, &Builder::Lbvh);
    let Some(root) = radix.root() else { return radix };
    let mut parts = vec![];
    collect(&radix, root, &mut parts);
    let around = |&part: &Child| {
        let mut all = Aabb::EMPTY;
        each_leaf(&radix, part, &mut |leaf| all = all.union(boxes[leaf.index()]));
        all
    };
    let part_boxes: Vec<Aabb> = parts.iter().map(around).collect();
    let top = canted_sah::build(&part_boxes, bounds, &Builder::TopDown(TopDownConfig::BINNED, None));
    let Some(top_root) = top.root() else { return radix };
    let mut joined = Joined { radix: &radix, top: &top, parts: &parts, children: vec![] };
    joined.add(top_root, true);
    let joined = Tree::from_children(&joined.children);
    joined.unwrap_or(radix)
}

/// The largest subtrees of at most [`MOST`] primitives, in order.
fn collect(tree: &Tree, child: Child, parts: &mut Vec<Child>) {
    let mut n = 0;
    each_leaf(tree, child, &mut |_| n += 1);
    match child.kind() {
        ChildKind::Inner(id) if n > MOST => {
            let node = &tree.nodes[id.index()];
            collect(tree, node.left, parts);
            collect(tree, node.right, parts);
        }
        _ => parts.push(child),
    }
}

fn each_leaf(tree: &Tree, child: Child, visit: &mut dyn FnMut(PrimId)) {
    match child.kind() {
        ChildKind::Leaf(position) => visit(tree.leaves[position as usize]),
        ChildKind::Inner(id) => {
            let node = &tree.nodes[id.index()];
            each_leaf(tree, node.left, visit);
            each_leaf(tree, node.right, visit);
        }
    }
}

/// The tree of both, as it grows.
struct Joined<'a> {
    radix: &'a Tree,
    top: &'a Tree,
    parts: &'a [Child],
    children: Vec<[Child; 2]>,
}

impl Joined<'_> {
    /// Adds a subtree of the top or of the radix tree; returns its root.
    fn add(&mut self, child: Child, is_top: bool) -> Child {
        let tree = if is_top { self.top } else { self.radix };
        match child.kind() {
            ChildKind::Leaf(position) if is_top => self.add(self.parts[tree.leaves[position as usize].index()], false),
            ChildKind::Leaf(position) => Child::leaf(tree.leaves[position as usize].0),
            ChildKind::Inner(id) => {
                let node = &tree.nodes[id.index()];
                let (left, right) = (node.left, node.right);
                let own = NodeId(u32::try_from(self.children.len()).expect("fewer nodes than leaves"));
                self.children.push([Child::inner(NodeId::ROOT); 2]);
                let pair = [self.add(left, is_top), self.add(right, is_top)];
                self.children[own.index()] = pair;
                Child::inner(own)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_primitive_stays_once() {
        let (corners, bounds) = {
            let mesh = canted_fixtures::soup(1, 1_000);
            canted_lbvh::triangle_corners(&mesh.positions, &mesh.triangles).unwrap()
        };
        let boxes: Vec<Aabb> = corners.iter().map(canted_lbvh::Leaf::aabb).collect();
        let tree = tree(&boxes, &bounds);
        let mut ids: Vec<usize> = tree.leaves.iter().map(|leaf| leaf.index()).collect();
        ids.sort_unstable();
        assert!(ids.into_iter().eq(0..1_000));
    }
}
