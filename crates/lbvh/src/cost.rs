use crate::{Child, ChildKind, Leaf, NodeId, Tree, Volumes};

/// What a step costs, relative to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// Test of an axis-aligned box.
    pub aabb: f64,
    /// Test of a leaning box.
    pub obb: f64,
    /// Test of a primitive.
    pub primitive: f64,
}

impl Default for Costs {
    /// Of a traced binary tree, from the nanoseconds of its parts and what fits the measured rays a second.
    fn default() -> Self {
        Self { aabb: 1.0, obb: 1.5, primitive: 2.0 }
    }
}

impl Costs {
    /// What testing a node's children as leaning boxes saves, in cost times area.
    ///
    /// A line through the node meets a child's box with the ratio of areas. Each child not met saves its own pair, or
    /// its primitive; in return the node's pair costs more. What lies farther below does not depend on this choice.
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
        let dearer = volumes.of(id).area() * 2.0 * (self.obb - self.aabb);
        saved(children[0]) + saved(children[1]) - dearer
    }
}

/// Costs over a tree's inner nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TreeCost {
    /// Inner nodes.
    pub n_nodes: usize,
    /// Of these, nodes whose leaning box won over the axis-aligned one.
    pub n_oriented: usize,
    /// Sum of volumes, in cubes of the unit given.
    pub volume: f64,
    /// Sum of surface areas, in squares of the unit given.
    pub area: f64,
    /// Expected cost of a line through the root: the surface area heuristic with unequal node costs.
    pub sah: f64,
}

/// Sums volumes and areas, in units of the length `unit`, and the surface area heuristic.
///
/// A line that meets a node's volume meets a child's with the ratio of areas (MacDonald & Booth 1990); meeting a node
/// costs the test of its two children's boxes, each by its kind, and meeting a leaf's box costs a primitive test.
#[must_use]
pub fn tree_cost<L: Leaf>(tree: &Tree, volumes: &Volumes, leaves: &[L], costs: &Costs, unit: f64) -> TreeCost {
    let mut sums = TreeCost { n_nodes: tree.nodes.len(), ..TreeCost::default() };
    if tree.nodes.is_empty() {
        return sums;
    }
    let scale = 1.0 / unit;
    let root_area = volumes.of(NodeId::ROOT).area().max(f64::MIN_POSITIVE);
    // Along the axes of the space where the pair above is tested so.
    let met_area = |child: Child, leaning: bool| match child.kind() {
        ChildKind::Inner(id) if leaning => volumes.of(id).area(),
        ChildKind::Inner(id) => volumes.aabbs[id.index()].area(),
        ChildKind::Leaf(position) if leaning && volumes.is_oriented(child) => leaves[position as usize].oriented_area(),
        ChildKind::Leaf(position) => leaves[position as usize].aabb().area(),
    };
    let pair_cost = |id: NodeId| 2.0 * if volumes.children_oriented(id) { costs.obb } else { costs.aabb };
    for (i, node) in (0..).zip(&tree.nodes) {
        let volume = volumes.of(NodeId(i));
        let children = [node.left, node.right];
        sums.n_oriented += usize::from(volumes.is_oriented(Child::inner(NodeId(i))));
        sums.volume += volume.volume() * scale * scale * scale;
        sums.area += volume.area() * scale * scale;
        let leaning = volumes.children_oriented(NodeId(i));
        if i == 0 {
            sums.sah += pair_cost(NodeId::ROOT);
        }
        for child in children {
            let visit = met_area(child, leaning) / root_area;
            sums.sah += visit
                * match child.kind() {
                    ChildKind::Leaf(_) => costs.primitive,
                    ChildKind::Inner(id) => pair_cost(id),
                };
        }
    }
    sums
}
