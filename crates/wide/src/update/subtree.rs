//! New boxes: in each piece of a BVH, bottom-up, on all threads, then in the nodes above them.

use std::collections::HashMap;
use std::ops::Range;

use canted_obb::Aabb;
use canted_trace::Slabs;

use super::boxes::frame_of;
use super::points::Points;
use crate::build::item::Item;
use crate::config::Costs;
use crate::leaf::{Placed, Primitive};
use crate::node::{
    CacheLine, ChildWord, Content, DecodedWord, NodeKind, Nodes, Row, SubtreeSlots, node_words, write_boxes,
    write_slabs,
};
use crate::par;
use crate::traverse::BoxPads;

/// What the predicted cost is computed from; sums of pieces add up.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    /// Surface areas of all items.
    pub(crate) area: f64,
    /// Over all children of nodes: half of the area of the box, times the cost of a visit.
    pub(crate) weighted: f64,
    /// Costs of a visit to every child.
    pub(crate) visits: f64,
}

impl Sums {
    pub(super) fn add(&mut self, other: Self) {
        self.area += other.area;
        self.weighted += other.weighted;
        self.visits += other.visits;
    }
}

/// What a refit keeps of all leaves for the oriented boxes above them: primitives, or the vertices of triangles.
pub(super) trait Kept: Default + Send + Sync {
    fn n(&self) -> usize;

    /// The box with these rows around a range, whose coordinates are at most `reach`, rounded outward.
    fn slabs(&self, range: Range<usize>, rows: [[f32; 3]; 3], reach: f32) -> Slabs;
}

impl Kept for Points {
    fn n(&self) -> usize {
        self.len()
    }

    fn slabs(&self, range: Range<usize>, rows: [[f32; 3]; 3], reach: f32) -> Slabs {
        self.slabs(range, rows, reach)
    }
}

impl<P: Primitive> Kept for Vec<Placed<'_, P>> {
    fn n(&self) -> usize {
        self.len()
    }

    fn slabs(&self, range: Range<usize>, rows: [[f32; 3]; 3], _: f32) -> Slabs {
        Item::slabs(&self[range], rows)
    }
}

/// A leaf as it is, or as it was.
pub(super) struct LeafState {
    pub(super) content: Content,
    pub(super) area: f64,
}

/// The leaf of `n` items from a part of the units on, before the motion; appends its items, relative to the reference point.
pub(super) type Before<'a, K, U> = dyn Fn(&[U], usize, usize, Option<&mut K>) -> LeafState + Sync + 'a;

/// The same after the motion, which is written.
pub(super) type After<'a, K, U> = dyn Fn(&mut [U], usize, usize, Option<&mut K>) -> LeafState + Sync + 'a;

/// What all pieces of a refit share.
pub(super) struct Shared<'a, K, U> {
    pub(super) before: &'a Before<'a, K, U>,
    pub(super) after: &'a After<'a, K, U>,
    pub(super) pads: &'a BoxPads,
    pub(super) costs: &'a Costs,
    /// Parts of a unit.
    pub(super) n_parts: usize,
    /// Whether items are kept.
    pub(super) keeps_items: bool,
    /// Whether the state before the motion is measured, too.
    pub(super) measures_before: bool,
}

/// A piece before or after the motion.
#[derive(Debug)]
pub(super) struct State<K> {
    /// Of the whole piece.
    pub(super) content: Content,
    pub(super) sums: Sums,
    /// All items, where oriented boxes need them.
    pub(super) items: K,
}

/// A child of a node.
#[derive(Clone, Debug)]
pub(super) struct Child {
    pub(super) content: Content,
    /// Of the items, or of the pieces below.
    pub(super) below: Range<usize>,
}

/// The box of a child before it is padded.
pub(super) enum ChildBox {
    Aligned(Aabb),
    Oriented(Slabs),
}

impl ChildBox {
    fn half_area(&self) -> f64 {
        let (lo, hi) = match self {
            Self::Aligned(aabb) => (aabb.min, aabb.max),
            Self::Oriented(slabs) => (slabs.lo, slabs.hi),
        };
        half_area(lo.map(f64::from), hi.map(f64::from))
    }
}

/// Half of the surface area of a box.
pub(crate) fn half_area(lo: [f64; 3], hi: [f64; 3]) -> f64 {
    let [x, y, z]: [f64; 3] = std::array::from_fn(|k| (hi[k] - lo[k]).max(0.0));
    x * y + y * z + z * x
}

/// The children of a node, empty slots last or between.
pub(super) type Children = [Option<Child>; 8];

/// The boxes of all children; `slabs` computes oriented ones.
fn boxes_of(
    kind: NodeKind,
    rows: &[Row],
    children: &Children,
    slabs: impl Fn(&Child, [[f32; 3]; 3]) -> Slabs,
) -> [Option<ChildBox>; 8] {
    std::array::from_fn(|i| {
        let child = children[i].as_ref()?;
        Some(match kind {
            NodeKind::Aligned => ChildBox::Aligned(child.content.aligned),
            NodeKind::Oriented => ChildBox::Oriented(slabs(child, frame_of(rows, i))),
        })
    })
}

/// Adds the boxes of a node to its sums.
fn add_boxes(sums: &mut Sums, boxes: &[Option<ChildBox>; 8], words: &[ChildWord; 8], costs: &Costs) {
    for (child, &word) in boxes.iter().zip(words) {
        if let Some(child) = child {
            let visit = visit(word, costs);
            sums.weighted += visit * child.half_area();
            sums.visits += visit;
        }
    }
}

/// Writes padded boxes into the rows of a node.
fn write_node(kind: NodeKind, rows: &mut [Row], children: &Children, boxes: &[Option<ChildBox>; 8], pads: &BoxPads) {
    let pad = |i: usize| children[i].as_ref().map_or(0.0, |child| pads.of(kind, child.content.reach));
    match kind {
        NodeKind::Aligned => write_boxes(&mut rows[..6], |i| match &boxes[i] {
            Some(ChildBox::Aligned(aabb)) => Some((*aabb, pad(i))),
            _ => None,
        }),
        NodeKind::Oriented => {
            for (i, child) in boxes.iter().enumerate() {
                let slabs = match child {
                    Some(ChildBox::Oriented(slabs)) => Some((*slabs, pad(i))),
                    _ => None,
                };
                write_slabs(rows, i, slabs);
            }
        }
    }
}

/// Cost of a visit to what a word names.
pub(crate) fn visit(word: ChildWord, costs: &Costs) -> f64 {
    match word.kind() {
        DecodedWord::Empty => 0.0,
        DecodedWord::Node(kind, _) => f64::from(costs.node(kind)),
        DecodedWord::Leaf { n, .. } => f64::from(costs.leaf) + f64::from(costs.block) * f64::from(n.div_ceil(8)),
    }
}

/// A node of the piece, and the line that it starts with, relative to the piece.
#[derive(Clone, Copy)]
struct Node {
    kind: NodeKind,
    line: u32,
}

/// Updates a piece that owns `lines` and `units`. Returns its state after the motion, and before it where that is measured.
fn update<K: Kept, U>(
    piece: &SubtreeSlots,
    lines: &mut [CacheLine],
    units: &mut [U],
    shared: &Shared<K, U>,
) -> (State<K>, Option<State<K>>) {
    let nodes = nodes_of(piece, lines);
    let (mut after, mut before) =
        (Side::new(nodes.len(), shared), shared.measures_before.then(|| Side::new(nodes.len(), shared)));
    let base = shared.n_parts * piece.units.start;
    let mut numbers = vec![0; lines.len().div_ceil(NodeKind::Aligned.n_lines())];
    for (i, node) in nodes.iter().enumerate() {
        numbers[slot_of(node.line as usize)] = i;
    }
    let number = |line: u32| numbers[slot_of(line as usize - piece.lines.start)];
    // In the order of memory, which the processor then fetches ahead; nodes are closed in the opposite order.
    for &Node { kind, line } in &nodes {
        for word in node_words(lines, kind, line) {
            if let DecodedWord::Leaf { first, n } = word.kind() {
                let (first, n) = (first as usize - base, n as usize);
                if let Some(before) = &mut before {
                    before.add_leaf(|items| (shared.before)(units, first, n, items));
                }
                after.add_leaf(|items| (shared.after)(units, first, n, items));
            }
        }
    }
    for (i, &Node { kind, line }) in nodes.iter().enumerate().rev() {
        let words = *node_words(lines, kind, line);
        let line = line as usize;
        let rows: &mut [Row] = bytemuck::cast_slice_mut(&mut lines[line..line + kind.n_lines()]);
        if let Some(before) = &mut before {
            let children = before.children(&words, number);
            before.close(i, kind, rows, &words, &children, shared.costs);
        }
        let children = after.children(&words, number);
        let boxes = after.close(i, kind, rows, &words, &children, shared.costs);
        write_node(kind, rows, &children, &boxes, shared.pads);
    }
    if let DecodedWord::Leaf { first, n } = piece.root.kind() {
        let (first, n) = (first as usize - base, n as usize);
        if let Some(before) = &mut before {
            let leaf = (shared.before)(units, first, n, before.items.as_mut());
            before.set_root(leaf);
        }
        let leaf = (shared.after)(units, first, n, after.items.as_mut());
        after.set_root(leaf);
    }
    (after.state(), before.map(Side::state))
}

/// All nodes, parents before children.
fn nodes_of(piece: &SubtreeSlots, lines: &[CacheLine]) -> Vec<Node> {
    let (mut nodes, mut open) = (Vec::with_capacity(lines.len() / NodeKind::Aligned.n_lines()), vec![piece.root]);
    while let Some(word) = open.pop() {
        if let DecodedWord::Node(kind, line) = word.kind() {
            let line = line - piece.lines.start as u32;
            nodes.push(Node { kind, line });
            open.extend(node_words(lines, kind, line).iter().rev());
        }
    }
    nodes
}

/// Distinguishes the nodes that start at different lines.
fn slot_of(line: usize) -> usize {
    line / NodeKind::Aligned.n_lines()
}

/// The state of a piece as it grows: all leaves, then nodes, the last one first.
struct Side<K> {
    /// Leaves that no node has taken yet.
    leaves: Vec<Child>,
    /// Contents of nodes by number, and their items.
    nodes: Vec<Option<Child>>,
    root: Content,
    sums: Sums,
    items: Option<K>,
}

impl<K: Kept> Side<K> {
    fn new<U>(n_nodes: usize, shared: &Shared<K, U>) -> Self {
        let items = shared.keeps_items.then(K::default);
        Self { leaves: vec![], nodes: vec![None; n_nodes], root: Content::EMPTY, sums: Sums::default(), items }
    }

    fn set_root(&mut self, leaf: LeafState) {
        self.root = leaf.content;
        self.sums.area += leaf.area;
    }

    /// Adds the next leaf in the order of nodes and of their slots.
    fn add_leaf(&mut self, read: impl FnOnce(Option<&mut K>) -> LeafState) {
        let start = self.n_items();
        let LeafState { content, area } = read(self.items.as_mut());
        self.sums.area += area;
        self.leaves.push(Child { content, below: start..self.n_items() });
    }

    /// The children that the words of the last open node name: nodes were closed before, leaves are the last ones.
    fn children(&mut self, words: &[ChildWord; 8], number: impl Fn(u32) -> usize) -> Children {
        let mut children = Children::default();
        for (child, word) in children.iter_mut().zip(words).rev() {
            *child = match word.kind() {
                DecodedWord::Empty => None,
                DecodedWord::Node(_, line) => self.nodes[number(line)].take(),
                DecodedWord::Leaf { .. } => self.leaves.pop(),
            };
        }
        children
    }

    fn n_items(&self) -> usize {
        self.items.as_ref().map_or(0, K::n)
    }

    /// Adds a node whose children are known; returns their boxes.
    fn close(
        &mut self,
        number: usize,
        kind: NodeKind,
        rows: &[Row],
        words: &[ChildWord; 8],
        children: &Children,
        costs: &Costs,
    ) -> [Option<ChildBox>; 8] {
        let boxes = boxes_of(kind, rows, children, |child, rows| {
            let items = self.items.as_ref().expect("oriented nodes keep what is below them");
            items.slabs(child.below.clone(), rows, child.content.reach)
        });
        add_boxes(&mut self.sums, &boxes, words, costs);
        let all = children.iter().flatten();
        let content = all.clone().fold(Content::EMPTY, |content, child| content.union(child.content));
        // The leaves of a node and of all nodes below are consecutive.
        let start = all.clone().map(|child| child.below.start).min().unwrap_or(0);
        let end = all.map(|child| child.below.end).max().unwrap_or(start);
        self.nodes[number] = Some(Child { content, below: start..end });
        self.root = content;
        boxes
    }

    fn state(self) -> State<K> {
        State { content: self.root, sums: self.sums, items: self.items.unwrap_or_default() }
    }
}

/// Updates all pieces. Returns the state of the whole BVH after the motion, and before it where that is measured; `None` without
/// primitives.
pub(super) fn update_all<K: Kept, U: Send>(
    nodes: &mut Nodes,
    units: &mut [U],
    shared: &Shared<K, U>,
) -> (Option<State<K>>, Option<State<K>>) {
    let pieces = &nodes.pieces[..];
    let (mut lines_left, mut units_left) = (&mut nodes.lines[..], units);
    let (mut subtrees, mut above) = (vec![], vec![]);
    for (i, piece) in pieces.iter().enumerate() {
        let (own_lines, lines_after) = std::mem::take(&mut lines_left).split_at_mut(piece.lines.len());
        let (own_units, units_after) = std::mem::take(&mut units_left).split_at_mut(piece.units.len());
        (lines_left, units_left) = (lines_after, units_after);
        if piece.is_above {
            above.push((i, own_lines));
        } else {
            subtrees.push((i, own_lines, own_units));
        }
    }
    let numbers: Vec<usize> = subtrees.iter().map(|&(i, ..)| i).collect();
    let states = par::map_jobs(subtrees, |(i, lines, units)| update(&pieces[i], lines, units, shared));
    let (mut after, mut before) = (Sequence::new(pieces), shared.measures_before.then(|| Sequence::new(pieces)));
    for (i, (after_piece, before_piece)) in numbers.into_iter().zip(states) {
        after.states[i] = Some(after_piece);
        if let Some((before, piece)) = before.as_mut().zip(before_piece) {
            before.states[i] = Some(piece);
        }
    }
    for (i, lines) in above.into_iter().rev() {
        let DecodedWord::Node(kind, _) = pieces[i].root.kind() else { unreachable!("nodes alone are above") };
        let words = *node_words(lines, kind, 0);
        let rows: &mut [Row] = bytemuck::cast_slice_mut(lines);
        if let Some(before) = &mut before {
            before.close(i, kind, rows, &words, shared.costs);
        }
        let (children, boxes) = after.close(i, kind, rows, &words, shared.costs);
        write_node(kind, rows, &children, &boxes, shared.pads);
    }
    (after.all(), before.and_then(Sequence::all))
}

/// The states of all pieces; those of nodes above are closed last first.
struct Sequence<K> {
    /// The piece that starts with a word.
    by_word: HashMap<u32, usize>,
    states: Vec<Option<State<K>>>,
    /// Where the subtree of each piece ends.
    ends: Vec<usize>,
}

impl<K: Kept> Sequence<K> {
    fn new(pieces: &[SubtreeSlots]) -> Self {
        let by_word = pieces.iter().enumerate().map(|(i, piece)| (piece.root.0, i)).collect();
        let states = pieces.iter().map(|_| None).collect();
        Self { by_word, states, ends: (1..=pieces.len()).collect() }
    }

    /// Adds a node above other pieces; returns its children and their boxes.
    fn close(
        &mut self,
        i: usize,
        kind: NodeKind,
        rows: &[Row],
        words: &[ChildWord; 8],
        costs: &Costs,
    ) -> (Children, [Option<ChildBox>; 8]) {
        let children: Children = words.map(|word| {
            let piece = *self.by_word.get(&word.0)?;
            let state = self.states[piece].as_ref().expect("pieces below are known");
            Some(Child { content: state.content, below: piece..self.ends[piece] })
        });
        let boxes = boxes_of(kind, rows, &children, |child, rows| {
            let known = self.states[child.below.clone()].iter().flatten();
            joined(
                rows,
                par::map(&known.collect::<Vec<_>>(), 1, |state| {
                    state.items.slabs(0..state.items.n(), rows, state.content.reach)
                }),
            )
        });
        let mut sums = Sums::default();
        add_boxes(&mut sums, &boxes, words, costs);
        let content = children.iter().flatten().fold(Content::EMPTY, |all, child| all.union(child.content));
        self.ends[i] = children.iter().flatten().map(|child| child.below.end).max().unwrap_or(i + 1);
        self.states[i] = Some(State { content, sums, items: K::default() });
        (children, boxes)
    }

    /// The state of the whole BVH: the first piece holds all others.
    fn all(self) -> Option<State<K>> {
        let content = self.states.first()?.as_ref()?.content;
        let mut sums = Sums::default();
        self.states.iter().flatten().for_each(|state| sums.add(state.sums));
        Some(State { content, sums, items: K::default() })
    }
}

/// The box around several with the same rows; boxes around nothing are empty.
fn joined(rows: [[f32; 3]; 3], all: Vec<Slabs>) -> Slabs {
    let mut around = Slabs { rows, lo: [f32::INFINITY; 3], hi: [f32::NEG_INFINITY; 3] };
    for slabs in all {
        for k in 0..3 {
            around.lo[k] = around.lo[k].min(slabs.lo[k]);
            around.hi[k] = around.hi[k].max(slabs.hi[k]);
        }
    }
    around
}
