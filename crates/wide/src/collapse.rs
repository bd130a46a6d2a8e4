//! Which subtrees of the binary tree become children of wide nodes, which nodes are oriented, and where leaves begin.

use canted_lbvh::{Child, ChildKind, Node, Tree, bottom_up};

use crate::costs::Costs;
use crate::layout::NodeKind;

/// Slots of a node.
pub(crate) const WIDTH: usize = 8;

/// Half surface areas of a subtree's boxes, in one unit for the whole tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Areas {
    /// In the mesh frame.
    pub(crate) aligned: f32,
    /// In the subtree's own frame, never more.
    pub(crate) oriented: f32,
}

impl Areas {
    /// Areas above zero, so that where areas are equal, the number of nodes decides.
    pub(crate) fn new(aligned: f32, oriented: f32) -> Self {
        let aligned = aligned.max(LEAST_AREA);
        Self { aligned, oriented: oriented.clamp(LEAST_AREA, aligned) }
    }
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
struct Table {
    slots: [[f32; WIDTH - 1]; KINDS],
    node: [f32; KINDS],
    areas: Areas,
}

const KINDS: usize = NodeKind::ALL.len();

impl Areas {
    fn of(&self, kind: usize) -> f32 {
        if kind == 0 { self.aligned } else { self.oriented }
    }
}

/// The plan of a wide BVH: costs of every subtree, from which choices follow.
///
/// Reads: a binary tree, areas of its nodes and leaves. Writes: tables.
/// Holds: the collapse of least predicted cost, among all that keep the binary tree's subtrees together.
/// Source: the dynamic program of Wald, Benthin & Boulos 2008 in the form of Ylitie, Karras & Laine 2017, extended to
/// choose the kind of each node.
pub(crate) struct Plan<'a> {
    tree: &'a Tree,
    costs: Costs,
    tables: Vec<Table>,
    /// In leaf order.
    leaf_areas: &'a [Areas],
    /// Kinds that nodes may have.
    n_kinds: usize,
}

impl<'a> Plan<'a> {
    /// Computes the costs of all collapses of `tree`; `oriented` allows oriented nodes.
    pub(crate) fn new(
        tree: &'a Tree,
        inner_areas: &[Areas],
        leaf_areas: &'a [Areas],
        costs: &Costs,
        oriented: bool,
    ) -> Self {
        let n_kinds = if oriented { KINDS } else { 1 };
        let leaf = |position: u32| leaf_table(leaf_areas[position as usize], costs);
        let unset = leaf_table(Areas::default(), costs);
        let tables = bottom_up(tree, unset, leaf, |id, node, left: &Table, right: &Table| {
            join(inner_areas[id.index()], node, left, right, costs, n_kinds)
        });
        Self { tree, costs: *costs, tables, leaf_areas, n_kinds }
    }

    fn table(&self, child: Child) -> Table {
        match child.kind() {
            ChildKind::Leaf(position) => leaf_table(self.leaf_areas[position as usize], &self.costs),
            ChildKind::Inner(id) => self.tables[id.index()],
        }
    }

    /// Predicted cost of the BVH for a ray that enters its box, in tests of aligned nodes times area.
    pub(crate) fn cost(&self, root: Child) -> f32 {
        self.table(root).slots[0][0]
    }

    /// Area of a subtree's box in a parent of this kind.
    pub(crate) fn area(&self, child: Child, kind: NodeKind) -> f32 {
        self.table(child).areas.of(kind as usize)
    }

    /// How a parent of this kind stores `child`.
    pub(crate) fn form(&self, child: Child, parent: NodeKind) -> Form {
        let ChildKind::Inner(id) = child.kind() else { return Form::Leaf };
        let table = &self.tables[id.index()];
        let area = table.areas.of(parent as usize);
        let n_leaves = self.tree.nodes[id.index()].n_leaves() as usize;
        best_form(table, area, n_leaves, &self.costs, self.n_kinds).1
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

    fn fill(&self, child: Child, table: &Table, kind: usize, slots: usize, out: &mut Vec<Child>) {
        let costs = &table.slots[kind];
        // The fewest slots of that cost: the others would stay empty.
        let slots = (1..=slots).find(|n| costs[n - 1] <= costs[slots - 1]).unwrap_or(1);
        match child.kind() {
            ChildKind::Inner(id) if slots > 1 => self.divide(&self.tree.nodes[id.index()], kind, slots, out),
            _ => out.push(child),
        }
    }
}

fn leaf_table(areas: Areas, costs: &Costs) -> Table {
    let leaf = costs.leaf_of(1);
    Table {
        slots: [[areas.aligned * leaf; WIDTH - 1], [areas.oriented * leaf; WIDTH - 1]],
        node: [f32::INFINITY; KINDS],
        areas,
    }
}

fn join(areas: Areas, node: &Node, left: &Table, right: &Table, costs: &Costs, n_kinds: usize) -> Table {
    let mut table = Table { slots: [[0.0; WIDTH - 1]; KINDS], node: [f32::INFINITY; KINDS], areas };
    for kind in 0..n_kinds {
        table.node[kind] = best_division(&left.slots[kind], &right.slots[kind], WIDTH).0;
    }
    for kind in 0..n_kinds {
        let alone = best_form(&table, areas.of(kind), node.n_leaves() as usize, costs, n_kinds).0;
        table.slots[kind][0] = alone;
        for slots in 2..WIDTH {
            let divided = best_division(&left.slots[kind], &right.slots[kind], slots).0;
            table.slots[kind][slots - 1] = divided.min(table.slots[kind][slots - 2]);
        }
    }
    table
}

/// The cheapest form of a subtree whose box has `area` in its parent; where no form has a finite cost, one that holds it.
#[inline]
fn best_form(table: &Table, area: f32, n_leaves: usize, costs: &Costs, n_kinds: usize) -> (f32, Form) {
    let mut best = if n_leaves <= costs.max_leaf {
        (area * costs.leaf_of(n_leaves), Form::Leaf)
    } else {
        (f32::INFINITY, Form::Node(NodeKind::Aligned))
    };
    for (kind, below) in NodeKind::ALL.into_iter().zip(table.node).take(n_kinds) {
        let cost = area * costs.node(kind) + below;
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
