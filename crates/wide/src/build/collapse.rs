//! Which subtrees of the binary tree become children of wide nodes, which nodes are oriented, and where leaves begin.

use canted_lbvh::{Child, ChildKind, Node, NodeId, Tree, bottom_up};

use crate::build::subtrees::LeafContents;
use crate::config::Costs;
use crate::node::NodeKind;

/// Slots of a node.
pub(crate) const WIDTH: usize = 8;

/// Half surface areas of a subtree's boxes, in one unit for the whole tree: by [`NodeKind`], in the mesh frame and, where nodes
/// may be oriented, in the subtree's own frame, never more.
pub(crate) type Areas<const KINDS: usize> = [f32; KINDS];

/// Nodes are aligned only.
pub(crate) const ALIGNED: usize = 1;

/// Nodes are aligned or oriented.
pub(crate) const BOTH: usize = NodeKind::ALL.len();

/// An area above zero, so that where areas are equal, the number of nodes decides.
pub(crate) fn positive(area: f32) -> f32 {
    area.max(LEAST_AREA)
}

/// The area of a box without area, in units of a scene whose extent is 1.
const LEAST_AREA: f32 = 1e-24;

/// How a parent stores a subtree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// All its primitives in one leaf.
    Leaf,
    /// A node of this kind.
    Node(NodeKind),
}

/// Costs of a subtree: `slots[kind][j - 1]` is the least where a parent of that kind gives it `j` slots, and
/// `node[kind]` the least of a node of that kind that is filled with it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Table<const KINDS: usize> {
    slots: [[f32; WIDTH - 1]; KINDS],
    node: [f32; KINDS],
    areas: Areas<KINDS>,
}

/// What a collapse minimizes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanCosts {
    pub(crate) rays: Costs,
    /// Of the memory of a cache line of nodes, in tests of aligned nodes times area: zero, or nodes are fuller than rays alone would have
    /// them.
    pub(crate) line: f32,
}

impl PlanCosts {
    /// Memory costs nothing.
    pub(crate) fn of_rays(rays: &Costs) -> Self {
        Self { rays: *rays, line: 0.0 }
    }
}

/// Costs of all collapses of a binary tree, by node: what a [`Plan`] is read from.
///
/// Reads: a binary tree, areas of its inner nodes and, by leaf order, of its leaves. Writes: a table for each inner node.
/// Source: the dynamic program of Wald, Benthin & Boulos 2008 in the form of Ylitie, Karras & Laine 2017, extended to
/// choose the kind of each node.
pub(crate) fn tables<const KINDS: usize>(
    tree: &Tree,
    members: LeafContents,
    inner_areas: impl Fn(NodeId) -> Areas<KINDS> + Sync,
    leaf_areas: impl Fn(usize) -> Areas<KINDS> + Sync,
    costs: &PlanCosts,
) -> Vec<Table<KINDS>> {
    let leaf = |position: u32| leaf_table(leaf_areas(position as usize), members.n(position, position), &costs.rays);
    let unset = leaf_table([0.0; KINDS], 1, &costs.rays);
    bottom_up(tree, unset, leaf, |id, node, left: &Table<KINDS>, right: &Table<KINDS>| {
        join(inner_areas(id), members.n(node.first, node.last), left, right, costs)
    })
}

/// The plan of a wide BVH: costs of every subtree, from which choices follow.
///
/// Holds: the collapse of least predicted cost, among all that keep the binary tree's subtrees together.
pub(crate) struct Plan<'a, const KINDS: usize> {
    pub(crate) tree: &'a Tree,
    pub(crate) members: LeafContents<'a>,
    pub(crate) costs: PlanCosts,
    /// Of the tree, with the same costs and areas.
    pub(crate) tables: &'a [Table<KINDS>],
    /// In leaf order.
    pub(crate) leaf_areas: &'a (dyn Fn(usize) -> Areas<KINDS> + Sync),
}

impl<const KINDS: usize> Plan<'_, KINDS> {
    fn table(&self, child: Child) -> Table<KINDS> {
        match child.kind() {
            ChildKind::Leaf(position) => {
                leaf_table((self.leaf_areas)(position as usize), self.members.n(position, position), &self.costs.rays)
            }
            ChildKind::Inner(id) => self.tables[id.index()],
        }
    }

    /// Predicted cost of the BVH for a ray that enters its box, in tests of aligned nodes times area.
    pub(crate) fn cost(&self, root: Child) -> f32 {
        self.table(root).slots[0][0]
    }

    /// Area of a subtree's box in a parent of this kind.
    pub(crate) fn area(&self, child: Child, kind: NodeKind) -> f32 {
        self.table(child).areas[kind as usize]
    }

    /// How a parent of this kind stores `child`.
    pub(crate) fn form(&self, child: Child, parent: NodeKind) -> Form {
        let ChildKind::Inner(id) = child.kind() else { return Form::Leaf };
        let table = &self.tables[id.index()];
        let node = &self.tree.nodes[id.index()];
        best_form(table, table.areas[parent as usize], self.members.n(node.first, node.last), &self.costs).1
    }

    /// The subtrees that fill a node of kind `kind` over inner node `child`.
    pub(crate) fn children(&self, child: Child, kind: NodeKind) -> Vec<Child> {
        let kind = kind as usize;
        let mut children = Vec::with_capacity(WIDTH);
        let ChildKind::Inner(id) = child.kind() else { return children };
        let node = &self.tree.nodes[id.index()];
        self.divide(node, kind, WIDTH, &mut children);
        children
    }

    fn divide(&self, node: &Node, kind: usize, slots: usize, out: &mut Vec<Child>) {
        let (left, right) = (self.table(node.left), self.table(node.right));
        let (_, left_slots) = best_division(&left.slots[kind], &right.slots[kind], slots);
        self.fill(node.left, &left, kind, left_slots, out);
        self.fill(node.right, &right, kind, slots - left_slots, out);
    }

    fn fill(&self, child: Child, table: &Table<KINDS>, kind: usize, slots: usize, out: &mut Vec<Child>) {
        let costs = &table.slots[kind];
        // The fewest slots of that cost: the others would stay empty.
        let slots = (1..=slots).find(|n| costs[n - 1] <= costs[slots - 1]).unwrap_or(1);
        match child.kind() {
            ChildKind::Inner(id) if slots > 1 => self.divide(&self.tree.nodes[id.index()], kind, slots, out),
            _ => out.push(child),
        }
    }
}

/// Of a leaf of `n` primitives.
fn leaf_table<const KINDS: usize>(areas: Areas<KINDS>, n: usize, costs: &Costs) -> Table<KINDS> {
    let leaf = costs.leaf_of(n);
    Table { slots: areas.map(|area| [area * leaf; WIDTH - 1]), node: [f32::INFINITY; KINDS], areas }
}

/// Of a node over `n` primitives.
fn join<const KINDS: usize>(
    areas: Areas<KINDS>,
    n: usize,
    left: &Table<KINDS>,
    right: &Table<KINDS>,
    costs: &PlanCosts,
) -> Table<KINDS> {
    let mut table = Table { slots: [[0.0; WIDTH - 1]; KINDS], node: [f32::INFINITY; KINDS], areas };
    for kind in 0..KINDS {
        table.node[kind] = best_division(&left.slots[kind], &right.slots[kind], WIDTH).0;
    }
    for (kind, &area) in areas.iter().enumerate() {
        let alone = best_form(&table, area, n, costs).0;
        table.slots[kind][0] = alone;
        for slots in 2..WIDTH {
            let divided = best_division(&left.slots[kind], &right.slots[kind], slots).0;
            table.slots[kind][slots - 1] = divided.min(table.slots[kind][slots - 2]);
        }
    }
    table
}

/// The cheapest form of a subtree of `n` primitives whose box has `area` in its parent; where no form has a finite cost, one
/// that holds it.
#[inline]
fn best_form<const KINDS: usize>(table: &Table<KINDS>, area: f32, n: usize, costs: &PlanCosts) -> (f32, Form) {
    let mut best = if n <= costs.rays.max_leaf {
        (area * costs.rays.leaf_of(n), Form::Leaf)
    } else {
        (f32::INFINITY, Form::Node(NodeKind::Aligned))
    };
    for (kind, below) in NodeKind::ALL.into_iter().zip(table.node) {
        let cost = area * costs.rays.node(kind) + below + costs.line * kind.n_lines() as f32;
        if cost < best.0 {
            best = (cost, Form::Node(kind));
        }
    }
    best
}

/// The cheapest division of slots between two subtrees, each getting at least one: cost, slots of the first.
#[inline]
fn best_division(left: &[f32; WIDTH - 1], right: &[f32; WIDTH - 1], slots: usize) -> (f32, usize) {
    let mut best = (f32::INFINITY, 1);
    for first in 1..slots {
        let cost = left[first - 1] + right[slots - first - 1];
        if cost < best.0 {
            best = (cost, first);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use canted_fixtures::soup;
    use canted_lbvh::{Leaf, triangle_corners};
    use canted_obb::Aabb;
    use canted_sah::Builder;

    use super::*;
    use crate::build::subtrees::Aligned;

    /// What rays cost below a subtree, and its cache lines, node by node.
    fn walked(plan: &Plan<ALIGNED>, child: Child, parent: NodeKind) -> (f64, usize) {
        let area = f64::from(plan.area(child, parent));
        let Form::Node(kind) = plan.form(child, parent) else {
            return (area * f64::from(plan.costs.rays.leaf_of(1)), 0);
        };
        let own = (area * f64::from(plan.costs.rays.node(kind)), kind.n_lines());
        let below = plan.children(child, kind).into_iter().map(|child| walked(plan, child, kind));
        below.fold(own, |(cost, n_lines), (more, n_more)| (cost + more, n_lines + n_more))
    }

    #[test]
    fn a_cost_of_memory_makes_fewer_nodes_and_is_part_of_the_cost() {
        let mesh = soup(9, 2_000);
        let corners = triangle_corners(&mesh.positions, &mesh.triangles).unwrap().0;
        let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
        let tree =
            canted_sah::build(&boxes, &boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b)), &Builder::default());
        let aligned = Aligned::of(&tree, &boxes, 1.0);
        let leaf_areas = |i: usize| [positive(aligned.leaf_areas[i])];
        let root = tree.root().unwrap();
        let planned = |line: f32| {
            let costs = PlanCosts { rays: Costs { max_leaf: 1, ..Costs::default() }, line };
            let inner = |id: NodeId| [positive(aligned.inner_areas[id.index()])];
            let tables = tables(&tree, LeafContents::Single, inner, leaf_areas, &costs);
            let plan =
                Plan { tree: &tree, members: LeafContents::Single, costs, tables: &tables, leaf_areas: &leaf_areas };
            (walked(&plan, root, NodeKind::Aligned), f64::from(plan.cost(root)))
        };
        let ((least, most_lines), cost) = planned(0.0);
        // Sums of some ten thousand positive terms in f32, of one level after the other.
        let is_equal = |a: f64, b: f64| (a - b).abs() < 1e-5 * b;
        assert!(is_equal(least, cost), "{least} {cost}");
        let line = (0.1 * cost / most_lines as f64) as f32;
        let ((rays, n_lines), with_memory) = planned(line);
        assert!(n_lines < most_lines && rays >= (1.0 - 1e-5) * least, "{n_lines} of {most_lines}, {rays}, {least}");
        assert!(is_equal(rays + f64::from(line) * n_lines as f64, with_memory));
        assert!(!is_equal(rays, with_memory), "memory is not part of the cost of rays");
    }
}
