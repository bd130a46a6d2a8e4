//! All pieces of a BVH on all threads, then the nodes above them.

use std::collections::HashMap;

use canted_trace::Slabs;

use super::subtree::{
    self, Child, ChildBox, Children, Content, Leaves, Shared, State, Sums, add_boxes, boxes_of, write_node,
};
use crate::costs::Costs;
use crate::item::Item;
use crate::layout::{NodeKind, Nodes, Row, Word, WordKind, node_words};
use crate::par;
use crate::pieces::Piece;

/// Updates all pieces. Returns the state of the whole BVH after the motion, and before it where that is measured; `None` without
/// primitives.
pub(super) fn update<I: Item, U: Send, L: Leaves<I, U>>(
    nodes: &mut Nodes,
    units: &mut [U],
    shared: &Shared<L>,
) -> (Option<State<I>>, Option<State<I>>) {
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
    let states = par::map_jobs(subtrees, |(i, lines, units)| subtree::update(&pieces[i], lines, units, shared));
    let (mut after, mut before) = (Sequence::new(pieces), shared.measures_before.then(|| Sequence::new(pieces)));
    for (i, (after_piece, before_piece)) in numbers.into_iter().zip(states) {
        after.states[i] = Some(after_piece);
        if let Some((before, piece)) = before.as_mut().zip(before_piece) {
            before.states[i] = Some(piece);
        }
    }
    for (i, lines) in above.into_iter().rev() {
        let WordKind::Node(kind, _) = pieces[i].root.kind() else { unreachable!("nodes alone are above") };
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
struct Sequence<I> {
    /// The piece that starts with a word.
    by_word: HashMap<u32, usize>,
    states: Vec<Option<State<I>>>,
    /// Where the subtree of each piece ends.
    ends: Vec<usize>,
}

impl<I: Item> Sequence<I> {
    fn new(pieces: &[Piece]) -> Self {
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
        words: &[Word; 8],
        costs: &Costs,
    ) -> (Children, [Option<ChildBox>; 8]) {
        let children: Children = words.map(|word| {
            let piece = *self.by_word.get(&word.0)?;
            let state = self.states[piece].as_ref().expect("pieces below are known");
            Some(Child { content: state.content, below: piece..self.ends[piece] })
        });
        let boxes = boxes_of(kind, rows, &children, |child, rows| {
            let known = self.states[child.below.clone()].iter().flatten();
            joined(rows, par::map(&known.collect::<Vec<_>>(), 1, |state| I::slabs(&state.items, rows)))
        });
        let mut sums = Sums::default();
        add_boxes(&mut sums, &boxes, words, costs);
        let content = children.iter().flatten().fold(Content::EMPTY, |all, child| all.union(child.content));
        self.ends[i] = children.iter().flatten().map(|child| child.below.end).max().unwrap_or(i + 1);
        self.states[i] = Some(State { content, sums, items: vec![] });
        (children, boxes)
    }

    /// The state of the whole BVH: the first piece holds all others.
    fn all(self) -> Option<State<I>> {
        let content = self.states.first()?.as_ref()?.content;
        let mut sums = Sums::default();
        self.states.iter().flatten().for_each(|state| sums.add(state.sums));
        Some(State { content, sums, items: vec![] })
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
