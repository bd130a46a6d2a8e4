//! Top-down builds: references -> { midpoint, median, binned, sweep } -> assemble -> tree.

use canted_lbvh::{Child, ChildKind, MAX_DEPTH, Node, NodeId, Task, Tree};
use canted_obb::{Aabb, PrimId};

use crate::{
    binned::{Grid, MAX_BINS, Plane, best_plane, halve, partition, split_at_median},
    par,
    reference::{Bounds, Reference, centers, unit_scale},
};

/// Where [`top_down()`] splits the primitives of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// At the midpoint between the outermost box centers. Deep where primitives cluster.
    Midpoint,
    /// At the median of the box centers: the shallowest tree.
    Median,
    /// Between any two box centers, at least SAH cost: the slowest to build.
    Sweep,
    /// Between bins, at least SAH cost.
    Binned {
        /// Bins per axis, 2 to 64.
        bins: u32,
        /// Up to this many primitives, at most 32, all splits are tried as in [`Split::Sweep`].
        sweep_threshold: u32,
    },
}

/// The axes on which splits are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// The axis with the largest extent of box centers.
    Longest,
    /// One axis after the other by depth, skipping axes on which all centers are equal.
    Cyclic,
    /// All three; the split of least SAH cost wins.
    All,
}

impl Axes {
    /// The axes tried on a node at `depth`.
    pub(crate) fn at(self, depth: u32, centers: impl Fn() -> Bounds) -> &'static [usize] {
        const EACH: [usize; 3] = [0, 1, 2];
        let axis = match self {
            Self::All => return &EACH,
            Self::Longest => centers().longest(),
            Self::Cyclic => {
                let extent = centers().extent().to_array();
                (0..3).map(|k| (depth as usize + k) % 3).find(|&axis| extent[axis] > 0.0).unwrap_or(0)
            }
        };
        &EACH[axis..=axis]
    }
}

/// How a tree is built from the root down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopDownConfig {
    /// Where nodes are split.
    pub split: Split,
    /// On which axes.
    pub axes: Axes,
    /// Maximum number of nodes from the root to a leaf, the leaf included. Nodes that would exceed it are halved by
    /// count, so a limit below `1 + ceil(log2 n)` is raised to that.
    pub max_depth: u32,
}

impl TopDownConfig {
    /// 32 bins on all axes.
    pub const BINNED: Self =
        Self { split: Split::Binned { bins: 32, sweep_threshold: 16 }, axes: Axes::All, max_depth: MAX_DEPTH };

    /// Leaves above which the children of a node are built in parallel.
    pub(crate) const FORK: usize = 1 << 12;

    /// Whether only halving by count keeps `n` leaves below a node at `depth` within the limit.
    pub(crate) fn must_halve(&self, n: usize, depth: u32) -> bool {
        let levels = usize::BITS - (n - 1).leading_zeros();
        depth + levels >= self.max_depth
    }
}

impl Default for TopDownConfig {
    fn default() -> Self {
        Self::BINNED
    }
}

/// Builds a tree from the root down, with one primitive per leaf.
///
/// Reads: a finite box for each primitive. Writes: a tree with its own leaf order.
/// Holds: a depth of at most `max_depth`; the same bits for any number of threads; equal boxes are halved by count.
/// Source: surface area heuristic of Goldsmith & Salmon 1987 and MacDonald & Booth 1990; binning after Wald 2007.
#[must_use]
pub fn top_down(boxes: &[Aabb], config: &TopDownConfig) -> Tree {
    let scale = unit_scale(boxes).unwrap_or(1.0);
    let mut references = par::from_fn(boxes.len(), CHUNK, |i| Reference::new(i as u32, &boxes[i], scale));
    assemble(boxes.len(), |slots| {
        if config.split == Split::Sweep {
            return sweep(&references, config, slots, 1);
        }
        let mut scratch = references.clone();
        build(Span { references: &mut references, scratch: &mut scratch }, config, slots, 1)
    })
}

/// Boxes per job.
const CHUNK: usize = 1 << 13;

/// The references of a node, and scratch memory of the same size.
pub(crate) struct Span<'a> {
    pub(crate) references: &'a mut [Reference],
    pub(crate) scratch: &'a mut [Reference],
}

impl<'a> Span<'a> {
    /// The first `n_left` references and the others.
    pub(crate) fn at(self, n_left: usize) -> [Span<'a>; 2] {
        let (left, right) = self.references.split_at_mut(n_left);
        let (left_scratch, right_scratch) = self.scratch.split_at_mut(n_left);
        [Span { references: left, scratch: left_scratch }, Span { references: right, scratch: right_scratch }]
    }
}

/// Builds a subtree at `depth`; returns its height in nodes.
fn build(mut span: Span<'_>, config: &TopDownConfig, slots: SubtreeSlots<'_>, depth: u32) -> u32 {
    let n = span.references.len();
    if let [reference] = span.references {
        slots.leaf(PrimId(reference.primitive()));
        return 1;
    }
    if let Split::Binned { sweep_threshold, .. } = config.split
        && n <= (sweep_threshold as usize).min(MAX_BLOCK)
    {
        return sweep_block(span.references, config, slots, depth);
    }
    let n_left = split(&mut span, config, depth);
    let [left, right] = span.at(n_left);
    let (left_slots, right_slots) = slots.split(n_left);
    let (build_left, build_right) =
        (|| build(left, config, left_slots, depth + 1), || build(right, config, right_slots, depth + 1));
    let (a, b) =
        if n > TopDownConfig::FORK { par::join(build_left, build_right) } else { (build_left(), build_right()) };
    1 + a.max(b)
}

/// Splits the references; returns the number on the left, never none or all.
pub(crate) fn split(span: &mut Span<'_>, config: &TopDownConfig, depth: u32) -> usize {
    let n = span.references.len();
    let centers = centers(span.references);
    if config.must_halve(n, depth) {
        return halve(span.references, centers.longest());
    }
    let axes = config.axes.at(depth, || centers);
    let n_bins = match config.split {
        Split::Median => return split_at_median(span.references, axes),
        Split::Sweep => unreachable!("sweep splits are built by `sweep`"),
        Split::Midpoint => 2,
        Split::Binned { bins, .. } => bins.min(max_bins(n)),
    };
    let grid = Grid::new(&centers, n_bins);
    let plane = match (config.split, axes) {
        (Split::Midpoint, &[axis]) => Some(Plane { axis, bin: 1 }),
        _ => best_plane(span.references, &grid, axes),
    };
    let n_left = plane.map_or(0, |plane| partition(span.references, span.scratch, grid.left_of(plane)));
    if n_left == 0 || n_left == n {
        return halve(span.references, centers.longest());
    }
    std::mem::swap(&mut span.references, &mut span.scratch);
    n_left
}

/// Maximum number of bins for `n` references: more would be mostly empty.
fn max_bins(n: usize) -> u32 {
    match n {
        ..64 => 8,
        64..256 => 16,
        _ => MAX_BINS,
    }
}

/// Maximum number of leaves of a task; larger trees have larger tasks.
const TASK_LEAVES: usize = 1 << 12;

/// The slices that a subtree owns while a tree is built from the root: disjoint, so subtrees are built in parallel.
pub(crate) struct SubtreeSlots<'a> {
    id: NodeId,
    first: u32,
    nodes: &'a mut [Node],
    leaves: &'a mut [PrimId],
    /// Its nodes, children before parents.
    order: &'a mut [NodeId],
}

impl<'a> SubtreeSlots<'a> {
    pub(crate) fn n_leaves(&self) -> usize {
        self.leaves.len()
    }

    /// A single leaf.
    pub(crate) fn leaf(self, primitive: PrimId) {
        self.leaves[0] = primitive;
    }

    /// Creates the node, with `n_left` leaves on the left; returns the slices of its children.
    pub(crate) fn split(self, n_left: usize) -> (SubtreeSlots<'a>, SubtreeSlots<'a>) {
        let n = self.leaves.len();
        let (first, last) = (self.first, self.first + n as u32 - 1);
        let (left_id, right_id) = (NodeId(first + n_left as u32 - 1), NodeId(first + n_left as u32));
        let child = |id: NodeId, is_leaf| if is_leaf { Child::leaf(id.0) } else { Child::inner(id) };
        let (left, right) = (child(left_id, n_left == 1), child(right_id, n_left + 1 == n));
        self.nodes[(self.id.0 - first) as usize] = Node { left, right, first, last };
        self.order[n - 2] = self.id;
        let (nodes, right_nodes) = self.nodes.split_at_mut(n_left);
        let (leaves, right_leaves) = self.leaves.split_at_mut(n_left);
        let (order, right_order) = self.order[..n - 2].split_at_mut(n_left - 1);
        (
            SubtreeSlots { id: left_id, first, nodes, leaves, order },
            SubtreeSlots {
                id: right_id,
                first: right_id.0,
                nodes: right_nodes,
                leaves: right_leaves,
                order: right_order,
            },
        )
    }
}

/// A tree over `n` leaves whose nodes `build` creates; `build` returns the height in nodes, the leaf included.
///
/// Writes: a tree numbered as described at [`Node`].
pub(crate) fn assemble(n: usize, build: impl FnOnce(SubtreeSlots<'_>) -> u32) -> Tree {
    let unset = Node { left: Child::leaf(0), right: Child::leaf(0), first: 0, last: 0 };
    let (mut nodes, mut leaves) = (vec![unset; n], vec![PrimId(0); n]);
    let mut order = vec![NodeId(0); n.saturating_sub(1)];
    let slots = SubtreeSlots { id: NodeId::ROOT, first: 0, nodes: &mut nodes, leaves: &mut leaves, order: &mut order };
    let depth = if n == 0 { 0 } else { build(slots) };
    nodes.pop();
    let (bottom_up, tasks) = schedule(&nodes, &order);
    Tree { nodes, leaves, bottom_up, tasks, depth }
}

/// Moves the nodes above all tasks to the end of an order in which subtrees are contiguous.
fn schedule(nodes: &[Node], order: &[NodeId]) -> (Vec<NodeId>, Vec<Task>) {
    let limit = TASK_LEAVES.max((nodes.len() + 1) / 64);
    let (mut bottom_up, mut tasks, mut tops) = (Vec::with_capacity(order.len()), vec![], vec![]);
    // Nodes with the start of their subtree in `order`.
    let mut stack = if nodes.is_empty() { vec![] } else { vec![(NodeId::ROOT, 0)] };
    while let Some((id, start)) = stack.pop() {
        let node = &nodes[id.index()];
        let n = node.n_leaves() as usize;
        if n <= limit {
            let first = bottom_up.len();
            bottom_up.extend_from_slice(&order[start..start + n - 1]);
            tasks.push(Task { leaves: node.first..node.last + 1, nodes: first..bottom_up.len() });
            continue;
        }
        tops.push(id);
        let n_left = match node.left.kind() {
            ChildKind::Leaf(_) => 1,
            ChildKind::Inner(left) => nodes[left.index()].n_leaves() as usize,
        };
        for (child, start) in [(node.right, start + n_left - 1), (node.left, start)] {
            if let ChildKind::Inner(id) = child.kind() {
                stack.push((id, start));
            }
        }
    }
    bottom_up.extend(tops.iter().rev());
    (bottom_up, tasks)
}

/// References to split between any two neighbors along an axis.
struct Sweep<'a> {
    references: &'a [Reference],
    /// Centers on each axis, as integers of the same order.
    keys: &'a [[u32; 3]],
    config: &'a TopDownConfig,
}

/// The references of a node sorted by center on each axis, and scratch memory.
struct Orders<'a> {
    by_axis: [&'a mut [u32]; 3],
    scratch: &'a mut [u32],
    costs: &'a mut [f32],
}

/// Maximum number of references that are swept without allocating.
pub(crate) const MAX_BLOCK: usize = 32;

/// Builds a subtree by full sweeps; returns its height in nodes.
///
/// Evaluates the SAH cost of every plane between two centers. Centers are sorted once and stay sorted when nodes are
/// split.
/// Source: MacDonald & Booth 1990; the presorting after Wald & Havran 2006.
pub(crate) fn sweep(references: &[Reference], config: &TopDownConfig, slots: SubtreeSlots<'_>, depth: u32) -> u32 {
    let keys: Vec<[u32; 3]> = references.iter().map(|r| [r.key(0), r.key(1), r.key(2)]).collect();
    let sorted = |axis: usize| {
        let mut keyed: Vec<u64> = (0..).zip(&keys).map(|(i, keys)| u64::from(keys[axis]) << 32 | i).collect();
        keyed.sort_unstable();
        keyed.into_iter().map(lower_half).collect::<Vec<_>>()
    };
    let (mut x, (mut y, mut z)) = par::join(|| sorted(0), || par::join(|| sorted(1), || sorted(2)));
    let (mut scratch, mut costs) = (vec![0; keys.len()], vec![0.0; keys.len()]);
    let orders = Orders { by_axis: [&mut x, &mut y, &mut z], scratch: &mut scratch, costs: &mut costs };
    Sweep { references, keys: &keys, config }.node(orders, slots, depth)
}

/// The same for at most [`MAX_BLOCK`] references.
#[inline(never)]
pub(crate) fn sweep_block(
    references: &[Reference],
    config: &TopDownConfig,
    slots: SubtreeSlots<'_>,
    depth: u32,
) -> u32 {
    let n = references.len();
    let (mut keys, mut orders) = ([[0; 3]; MAX_BLOCK], [[0; MAX_BLOCK]; 3]);
    let (mut scratch, mut costs) = ([0; MAX_BLOCK], [0.0; MAX_BLOCK]);
    for (keys, reference) in keys.iter_mut().zip(references) {
        *keys = [reference.key(0), reference.key(1), reference.key(2)];
    }
    for (axis, order) in orders.iter_mut().enumerate() {
        let mut keyed = [0u64; MAX_BLOCK];
        for ((i, slot), keys) in (0..).zip(&mut keyed[..n]).zip(&keys) {
            *slot = u64::from(keys[axis]) << 32 | i;
        }
        keyed[..n].sort_unstable();
        for (slot, key) in order.iter_mut().zip(&keyed[..n]) {
            *slot = lower_half(*key);
        }
    }
    let by_axis = orders.each_mut().map(|order| &mut order[..n]);
    let orders = Orders { by_axis, scratch: &mut scratch[..n], costs: &mut costs[..n] };
    Sweep { references, keys: &keys[..n], config }.node(orders, slots, depth)
}

fn lower_half(key: u64) -> u32 {
    key as u32
}

impl Sweep<'_> {
    /// Builds the node over all of `orders`; returns its height.
    fn node(&self, mut orders: Orders<'_>, slots: SubtreeSlots<'_>, depth: u32) -> u32 {
        let n = slots.n_leaves();
        if n == 1 {
            let reference = &self.references[orders.by_axis[0][0] as usize];
            slots.leaf(PrimId(reference.primitive()));
            return 1;
        }
        let (axis, n_left) = match n {
            2 => (0, 1),
            _ if self.config.must_halve(n, depth) => (self.centers(&orders).longest(), n.div_ceil(2)),
            _ => self.best_split(&mut orders, depth),
        };
        self.partition(&mut orders, axis, n_left);
        let (left, right) = orders.split(n_left);
        let (left_slots, right_slots) = slots.split(n_left);
        let (build_left, build_right) =
            (|| self.node(left, left_slots, depth + 1), || self.node(right, right_slots, depth + 1));
        let (a, b) =
            if n > TopDownConfig::FORK { par::join(build_left, build_right) } else { (build_left(), build_right()) };
        1 + a.max(b)
    }

    /// The bounds of the centers.
    fn centers(&self, orders: &Orders<'_>) -> Bounds {
        let end = |order: &[u32], i: usize| self.references[order[i] as usize];
        let last = orders.scratch.len() - 1;
        let ends = orders.by_axis.each_ref().map(|order| [end(order, 0), end(order, last)]);
        crate::reference::centers(ends.as_flattened())
    }

    /// Axis and number of references on the left of the cheapest split; ties go to the more balanced one.
    fn best_split(&self, orders: &mut Orders<'_>, depth: u32) -> (usize, usize) {
        let n = orders.scratch.len();
        let mut best = (f32::INFINITY, 0, 0, n / 2);
        for &axis in self.config.axes.at(depth, || self.centers(orders)) {
            let order = &*orders.by_axis[axis];
            let costs = &mut *orders.costs;
            let mut bounds = Bounds::EMPTY;
            for (i, &index) in order.iter().enumerate().skip(1).rev() {
                bounds = bounds.union(self.references[index as usize].bounds());
                costs[i] = bounds.half_area() * (n - i) as f32;
            }
            bounds = Bounds::EMPTY;
            for (i, &index) in (1..n).zip(order) {
                bounds = bounds.union(self.references[index as usize].bounds());
                let (cost, balance) = (bounds.half_area() * i as f32 + costs[i], i.min(n - i));
                if cost < best.0 || cost == best.0 && balance > best.1 {
                    best = (cost, balance, axis, i);
                }
            }
        }
        (best.2, best.3)
    }

    /// Moves the first `n_left` on `axis` to the front on every axis, in order.
    fn partition(&self, orders: &mut Orders<'_>, axis: usize, n_left: usize) {
        let pivot = orders.by_axis[axis][n_left];
        let key = |index: u32| (self.keys[index as usize][axis], index);
        for other in (0..3).filter(|&other| other != axis) {
            let order = &mut *orders.by_axis[other];
            let (mut front, mut back) = (0, 0);
            for i in 0..order.len() {
                let index = order[i];
                let left = key(index) < key(pivot);
                // The front never overtakes the reads; a wrong copy is overwritten.
                order[front] = index;
                orders.scratch[back] = index;
                front += usize::from(left);
                back += usize::from(!left);
            }
            order[front..].copy_from_slice(&orders.scratch[..back]);
        }
    }
}

impl Orders<'_> {
    fn split(self, n_left: usize) -> (Self, Self) {
        let [x, y, z] = self.by_axis.map(|order| order.split_at_mut(n_left));
        let (scratch, costs) = (self.scratch.split_at_mut(n_left), self.costs.split_at_mut(n_left));
        (
            Self { by_axis: [x.0, y.0, z.0], scratch: scratch.0, costs: costs.0 },
            Self { by_axis: [x.1, y.1, z.1], scratch: scratch.1, costs: costs.1 },
        )
    }
}
