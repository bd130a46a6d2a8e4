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
    /// Of a traced binary tree: a leaning pair takes 1.4 times an axis-aligned one.
    fn default() -> Self {
        Self { aabb: 1.0, obb: 1.4, primitive: 1.0 }
    }
}

/// Sums over a tree's inner nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Inner nodes.
    pub n_nodes: usize,
    /// Of these, nodes whose leaning box won over the axis-aligned one.
    pub n_leaning: usize,
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
pub fn sums<L: Leaf>(tree: &Tree, volumes: &Volumes, leaves: &[L], costs: &Costs, unit: f64) -> Sums {
    let mut sums = Sums { n_nodes: tree.nodes.len(), ..Sums::default() };
    if tree.nodes.is_empty() {
        return sums;
    }
    let scale = 1.0 / unit;
    let root_area = volumes.of(NodeId::ROOT).area().max(f64::MIN_POSITIVE);
    let area = |child: Child| match child.kind() {
        ChildKind::Inner(id) => volumes.of(id).area(),
        ChildKind::Leaf(position) if volumes.leans(child) => leaves[position as usize].leaning_area(),
        ChildKind::Leaf(position) => leaves[position as usize].aabb().area(),
    };
    for (i, node) in (0..).zip(&tree.nodes) {
        let volume = volumes.of(NodeId(i));
        let children = [node.left, node.right];
        sums.n_leaning += usize::from(volumes.leans(Child::inner(NodeId(i))));
        sums.volume += volume.volume() * scale * scale * scale;
        sums.area += volume.area() * scale * scale;
        let box_test = if children.iter().any(|&child| volumes.leans(child)) { costs.obb } else { costs.aabb };
        let visit = volume.area() / root_area;
        sums.sah += visit * 2.0 * box_test;
        for child in children {
            if let ChildKind::Leaf(_) = child.kind() {
                sums.sah += area(child) / root_area * costs.primitive;
            }
        }
    }
    sums
}
