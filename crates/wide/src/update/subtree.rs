//! New boxes: in each piece of a BVH, bottom-up, on all threads, then in the nodes above them.

use std::collections::HashMap;
use std::ops::Range;

use canted_obb::Aabb;

use super::extremes::{Closing, Ends, Extremes, Sums};
use super::rotation::{EdgeProducts, turn_frames};
use super::vertices::Vertices;
use crate::build::item::Item;
use crate::config::Costs;
use crate::leaf::Placed;
use crate::node::{CacheLine, ChildWord, DecodedWord, NodeKind, Nodes, Row, SubtreeSlots, node_words};
use crate::par;
use crate::simd::{AvailablePath, Scalar, Simd, Task};
use crate::traverse::BoxPads;

/// What a refit keeps of all leaves for the oriented boxes above them: primitives, or the vertices of triangles.
pub(super) trait Kept: Default + Send + Sync {
    /// With room for so many primitives.
    fn with_capacity(n: usize) -> Self;

    /// How many items there are: primitives, or vectors of points.
    fn n_items(&self) -> usize;

    /// The ends along these rows of a range of items, where the coordinates of all that is in the box are at most `reach`.
    fn ends<S: Simd>(&self, simd: S, range: Range<usize>, rows: [[f32; 3]; 3], reach: f32) -> Ends;
}

impl Kept for Vertices {
    fn with_capacity(n: usize) -> Self {
        Self::with_capacity(n)
    }

    fn n_items(&self) -> usize {
        self.n_eights()
    }

    #[inline(always)]
    fn ends<S: Simd>(&self, simd: S, range: Range<usize>, rows: [[f32; 3]; 3], reach: f32) -> Ends {
        self.ends(simd, range, rows, reach)
    }
}

impl Kept for Vec<Placed<'_>> {
    fn with_capacity(n: usize) -> Self {
        Self::with_capacity(n)
    }

    fn n_items(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn ends<S: Simd>(&self, _: S, range: Range<usize>, rows: [[f32; 3]; 3], _: f32) -> Ends {
        let slabs = Item::slabs(&self[range], rows);
        Ends { lo: slabs.lo.map(f64::from), hi: slabs.hi.map(f64::from) }
    }
}

/// A leaf: the part of a unit that it starts with, relative to the piece, and the number of its primitives.
#[derive(Clone, Copy, Debug)]
pub(super) struct LeafSlots {
    pub(super) first: usize,
    pub(super) n: usize,
}

/// The leaves of a piece, in the order of nodes and their slots.
#[derive(Debug)]
pub(super) struct LeafStates<K> {
    /// [`Extremes::EMPTY`], then those of each leaf, then of each node.
    pub(super) extremes: Vec<Extremes>,
    /// Object space.
    pub(super) bounds: Aabb,
    /// Of all primitives.
    pub(super) area: f64,
    /// All items relative to the reference point, where oriented boxes need them.
    pub(super) items: Option<K>,
    /// An empty range, then that of the items of each leaf, then of each node, where items are kept.
    pub(super) ranges: Vec<[usize; 2]>,
    /// [`EdgeProducts::ZERO`], then those of each leaf, then of each node, where frames turn with triangles.
    pub(super) products: Option<Vec<EdgeProducts>>,
}

/// Adds leaves as they were before the motion.
pub(super) type Before<'a, K, U> = dyn Fn(&[U], &[LeafSlots], &mut LeafStates<K>) + Sync + 'a;

/// Adds them as they are after the motion, and writes them.
pub(super) type After<'a, K, U> = dyn Fn(&mut [U], &[LeafSlots], &mut LeafStates<K>) + Sync + 'a;

/// What all pieces of a refit share.
pub(super) struct Shared<'a, K, U> {
    pub(super) before: &'a Before<'a, K, U>,
    pub(super) after: &'a After<'a, K, U>,
    pub(super) path: AvailablePath,
    pub(super) pads: &'a BoxPads,
    pub(super) costs: &'a Costs,
    /// Parts of a unit.
    pub(super) n_parts: usize,
    /// Whether items are kept.
    pub(super) keeps_items: bool,
    /// Whether the frames of oriented boxes turn with what is inside.
    pub(super) turns_frames: bool,
    /// Whether the state before the motion is measured, too.
    pub(super) measures_before: bool,
}

/// A piece before or after the motion.
#[derive(Debug)]
pub(super) struct State<K> {
    /// Of the whole piece.
    pub(super) extremes: Extremes,
    pub(super) bounds: Aabb,
    pub(super) sums: Sums,
    /// All items, where oriented boxes need them.
    items: K,
    products: EdgeProducts,
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
    let (nodes, leaves) = content_of(piece, lines, shared.n_parts * piece.units.start);
    let n_items = shared.keeps_items.then(|| leaves.iter().map(|leaf| leaf.n).sum());
    let mut before = None;
    if shared.measures_before {
        let mut states = LeafStates::new(leaves.len() + nodes.len(), n_items, false);
        (shared.before)(units, &leaves, &mut states);
        let n_lines = piece.lines.start;
        before = Some(shared.path.run(Close {
            nodes: &nodes,
            leaves: &leaves,
            n_lines,
            lines,
            pads: None,
            costs: shared.costs,
            states,
        }));
    }
    let mut states = LeafStates::new(leaves.len() + nodes.len(), n_items, shared.turns_frames);
    (shared.after)(units, &leaves, &mut states);
    let (n_lines, pads) = (piece.lines.start, Some(shared.pads));
    let after =
        shared.path.run(Close { nodes: &nodes, leaves: &leaves, n_lines, lines, pads, costs: shared.costs, states });
    (after, before)
}

/// All nodes, parents before children, and all leaves in their order. Parts of units are relative to the first one.
fn content_of(piece: &SubtreeSlots, lines: &[CacheLine], first_part: usize) -> (Vec<Node>, Vec<LeafSlots>) {
    let leaf = |first: u32, n: u32| LeafSlots { first: first as usize - first_part, n: n as usize };
    let n_most = lines.len() / NodeKind::Aligned.n_lines();
    let (mut nodes, mut leaves, mut open) = (Vec::with_capacity(n_most), Vec::with_capacity(8 * n_most), vec![]);
    match piece.root.kind() {
        DecodedWord::Node(kind, line) => open.push((kind, line)),
        DecodedWord::Leaf { first, n } => leaves.push(leaf(first, n)),
        DecodedWord::Empty => {}
    }
    while let Some((kind, line)) = open.pop() {
        let line = line - piece.lines.start as u32;
        nodes.push(Node { kind, line });
        let n_open = open.len();
        for word in node_words(lines, kind, line) {
            match word.kind() {
                DecodedWord::Node(kind, line) => open.push((kind, line)),
                DecodedWord::Leaf { first, n } => leaves.push(leaf(first, n)),
                DecodedWord::Empty => {}
            }
        }
        open[n_open..].reverse();
    }
    (nodes, leaves)
}

/// Distinguishes the nodes that start at different lines.
fn slot_of(line: usize) -> usize {
    line / NodeKind::Aligned.n_lines()
}

impl<K: Kept> LeafStates<K> {
    /// Of `n` leaves and nodes; `n_items` where items are kept.
    pub(super) fn new(n: usize, n_items: Option<usize>, turns_frames: bool) -> Self {
        let mut extremes = Vec::with_capacity(1 + n);
        extremes.push(Extremes::EMPTY);
        let products = turns_frames.then(|| {
            let mut products = Vec::with_capacity(1 + n);
            products.push(EdgeProducts::ZERO);
            products
        });
        let (items, mut ranges) = (n_items.map(K::with_capacity), vec![]);
        if items.is_some() {
            ranges.reserve_exact(1 + n);
            ranges.push([0; 2]);
        }
        Self { extremes, bounds: Aabb::EMPTY, area: 0.0, items, ranges, products }
    }
}

/// Closes the nodes of a piece, the last one first; all leaves are known. Writes boxes if pads are given.
struct Close<'a, K> {
    nodes: &'a [Node],
    leaves: &'a [LeafSlots],
    /// Lines before the piece.
    n_lines: usize,
    lines: &'a mut [CacheLine],
    pads: Option<&'a BoxPads>,
    costs: &'a Costs,
    states: LeafStates<K>,
}

impl<K: Kept> Task for Close<'_, K> {
    type Output = State<K>;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> State<K> {
        let Self { nodes, leaves, n_lines, lines, pads, costs, states } = self;
        let LeafStates { mut extremes, bounds, area, items, mut ranges, mut products } = states;
        let mut numbers = vec![0; lines.len().div_ceil(NodeKind::Aligned.n_lines())];
        for (i, node) in nodes.iter().enumerate() {
            numbers[slot_of(node.line as usize)] = 1 + leaves.len() + i;
        }
        extremes.resize(1 + leaves.len() + nodes.len(), Extremes::EMPTY);
        if let Some(products) = &mut products {
            products.resize(extremes.len(), EdgeProducts::ZERO);
        }
        if items.is_some() {
            ranges.resize(extremes.len(), [0; 2]);
        }
        let (mut sums, mut next_leaf) = (Sums { area, ..Sums::default() }, leaves.len());
        for (i, &Node { kind, line }) in nodes.iter().enumerate().rev() {
            let (words, line) = (*node_words(lines, kind, line), line as usize);
            let mut children = [0; 8];
            for (child, word) in children.iter_mut().zip(&words).rev() {
                *child = match word.kind() {
                    DecodedWord::Empty => 0,
                    DecodedWord::Node(_, line) => numbers[slot_of(line as usize - n_lines)],
                    DecodedWord::Leaf { .. } => {
                        next_leaf -= 1;
                        next_leaf + 1
                    }
                };
            }
            let number = 1 + leaves.len() + i;
            let rows: &mut [Row] = bytemuck::cast_slice_mut(&mut lines[line..line + kind.n_lines()]);
            if let Some(products) = &mut products {
                let slots = children.map(|child| &products[child]);
                if kind == NodeKind::Oriented {
                    turn_frames(simd, rows, slots);
                }
                products[number] = EdgeProducts::sum(simd, slots.into_iter());
            }
            let closing = Closing { kind, words: &words, children: children.map(|child| &extremes[child]), costs };
            let node = closing.close(
                simd,
                rows,
                pads,
                &mut sums,
                #[inline(always)]
                |slot, rows| {
                    let items = items.as_ref().expect("oriented nodes keep what is below them");
                    let [first, end] = ranges[children[slot]];
                    items.ends(simd, first..end, rows, extremes[children[slot]].reach())
                },
            );
            extremes[number] = node;
            // The items of a node and of all nodes below are consecutive.
            if items.is_some() {
                let used = || children.iter().filter(|child| **child > 0);
                ranges[number] = used().fold([usize::MAX, 0], |[first, end], &child| {
                    [first.min(ranges[child][0]), end.max(ranges[child][1])]
                });
            }
        }
        let root = if nodes.is_empty() { leaves.len().min(1) } else { 1 + leaves.len() };
        let products = products.map_or(EdgeProducts::ZERO, |products| products[root]);
        State { extremes: extremes[root], bounds, sums, items: items.unwrap_or_default(), products }
    }
}

/// Updates all pieces. Returns the bounds and the sums of the whole BVH after the motion, and before it where that is measured; `None`
/// without primitives.
pub(super) fn update_all<K: Kept, U: Send>(
    nodes: &mut Nodes,
    units: &mut [U],
    shared: &Shared<K, U>,
) -> [Option<(Aabb, Sums)>; 2] {
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
            before.close(i, kind, rows, &words, (None, shared));
        }
        after.close(i, kind, rows, &words, (Some(shared.pads), shared));
    }
    [after.all(), before.and_then(Sequence::all)]
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

    /// Adds a node above other pieces. Writes its boxes if pads are given.
    fn close<U>(
        &mut self,
        i: usize,
        kind: NodeKind,
        rows: &mut [Row],
        words: &[ChildWord; 8],
        (pads, shared): (Option<&BoxPads>, &Shared<K, U>),
    ) {
        let pieces = words.map(|word| self.by_word.get(&word.0).copied());
        let known = |piece: usize| self.states[piece].as_ref().expect("pieces below are known");
        let children = pieces.map(|piece| piece.map_or(&Extremes::EMPTY, |piece| &known(piece).extremes));
        let slots = pieces.map(|piece| piece.map_or(&EdgeProducts::ZERO, |piece| &known(piece).products));
        if kind == NodeKind::Oriented && pads.is_some() && shared.turns_frames {
            turn_frames(Scalar, rows, slots);
        }
        let products = EdgeProducts::sum(Scalar, slots.into_iter());
        let mut sums = Sums::default();
        let closing = Closing { kind, words, children, costs: shared.costs };
        let extremes = closing.close(Scalar, rows, pads, &mut sums, |slot, rows| {
            let first = pieces[slot].expect("a box around something");
            let below: Vec<_> = self.states[first..self.ends[first]].iter().flatten().collect();
            let reach = children[slot].reach();
            let ends = par::map(&below, 1, |state| shared.path.run(EndsOf { state, rows, reach }));
            ends.into_iter().fold(Ends::EMPTY, Ends::union)
        });
        let below = pieces.into_iter().flatten();
        let bounds = below.clone().fold(Aabb::EMPTY, |all, piece| all.union(known(piece).bounds));
        self.ends[i] = below.map(|piece| self.ends[piece]).max().unwrap_or(i + 1);
        self.states[i] = Some(State { extremes, bounds, sums, items: K::default(), products });
    }

    /// The bounds of the whole BVH, and its sums: the first piece holds all others.
    fn all(self) -> Option<(Aabb, Sums)> {
        let bounds = self.states.first()?.as_ref()?.bounds;
        let mut sums = Sums::default();
        self.states.iter().flatten().for_each(|state| sums.add(state.sums));
        Some((bounds, sums))
    }
}

/// The ends of all items of a piece along these rows, in a box whose content reaches so far.
struct EndsOf<'a, K> {
    state: &'a State<K>,
    rows: [[f32; 3]; 3],
    reach: f32,
}

impl<K: Kept> Task for EndsOf<'_, K> {
    type Output = Ends;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Ends {
        self.state.items.ends(simd, 0..self.state.items.n_items(), self.rows, self.reach)
    }
}
