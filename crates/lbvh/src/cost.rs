use crate::{Child, ChildKind, Costs, Leaf, NodeId, Tree, Volumes};

/// Sums over the inner nodes of a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TreeCost {
    /// Number of inner nodes.
    pub n_nodes: usize,
    /// Number of inner nodes with an oriented volume.
    pub n_oriented: usize,
    /// Sum of volumes, in cubes of `unit`.
    pub volume: f64,
    /// Sum of surface areas, in squares of `unit`.
    pub area: f64,
    /// Expected cost of a line through the root by the surface area heuristic (SAH), with [`Costs`].
    pub sah: f64,
}

/// SAH cost, and the sums of volumes and areas in units of the length `unit`.
///
/// A line that hits the volume of a node hits that of a child with the ratio of areas (MacDonald & Booth 1990). A node
/// costs the tests of the boxes of both children, a leaf a primitive test.
#[must_use]
pub fn tree_cost<L: Leaf>(tree: &Tree, volumes: &Volumes, leaves: &[L], costs: &Costs, unit: f64) -> TreeCost {
    let mut sums = TreeCost { n_nodes: tree.nodes.len(), ..TreeCost::default() };
    if tree.nodes.is_empty() {
        return sums;
    }
    let scale = 1.0 / unit;
    let root_area = volumes.of(NodeId::ROOT).area().max(f64::MIN_POSITIVE);
    // The area of the box that the node above tests.
    let tested_area = |child: Child, oriented: bool| match child.kind() {
        ChildKind::Inner(id) if oriented => volumes.of(id).area(),
        ChildKind::Inner(id) => volumes.aabbs[id.index()].area(),
        ChildKind::Leaf(position) if oriented && volumes.is_oriented(child) => {
            leaves[position as usize].oriented_area()
        }
        ChildKind::Leaf(position) => leaves[position as usize].aabb().area(),
    };
    let pair_cost = |id: NodeId| 2.0 * if volumes.children_oriented(id) { costs.obb } else { costs.aabb };
    for (i, node) in (0..).zip(&tree.nodes) {
        let volume = volumes.of(NodeId(i));
        let children = [node.left, node.right];
        sums.n_oriented += usize::from(volumes.is_oriented(Child::inner(NodeId(i))));
        sums.volume += volume.volume() * scale * scale * scale;
        sums.area += volume.area() * scale * scale;
        let oriented = volumes.children_oriented(NodeId(i));
        if i == 0 {
            sums.sah += pair_cost(NodeId::ROOT);
        }
        for child in children {
            let visit = tested_area(child, oriented) / root_area;
            sums.sah += visit
                * match child.kind() {
                    ChildKind::Leaf(_) => costs.primitive,
                    ChildKind::Inner(id) => pair_cost(id),
                };
        }
    }
    sums
}
