use crate::{Child, ChildKind, Leaf, NodeId, Tree, Volumes};

/// Relative traversal costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// Test of an axis-aligned box.
    pub aabb: f64,
    /// Test of an oriented box.
    pub obb: f64,
    /// Test of a primitive.
    pub primitive: f64,
}

impl Default for Costs {
    /// Measured for a binary BVH: times of the tests, fitted to rays per second.
    fn default() -> Self {
        Self { aabb: 1.0, obb: 1.5, primitive: 2.0 }
    }
}

impl Costs {
    /// Predicted saving of testing the children of a node as oriented boxes, in cost times area.
    ///
    /// A line through the node hits the box of a child with the ratio of areas. Each child that is missed saves the tests of
    /// its own children, or its primitive; in return the test of this node costs more.
    pub(crate) fn oriented_gain<L: Leaf>(
        &self,
        volumes: &Volumes,
        leaves: &[L],
        id: NodeId,
        children: [Child; 2],
    ) -> f64 {
        let saved = |child: Child| match child.kind() {
            _ if !volumes.is_oriented(child) => 0.0,
            ChildKind::Leaf(position) => {
                let leaf = &leaves[position as usize];
                (leaf.aabb().area() - leaf.oriented_area()) * self.primitive
            }
            ChildKind::Inner(child) => {
                (volumes.aabbs[child.index()].area() - volumes.obbs[child.index()].area()) * 2.0 * self.aabb
            }
        };
        let extra = volumes.of(id).area() * 2.0 * (self.obb - self.aabb);
        saved(children[0]) + saved(children[1]) - extra
    }
}

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
