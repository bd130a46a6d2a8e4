//! Parts of a BVH that own a run of memory each, so that each can be updated on a thread of its own.
//!
//! Reads: the layout of a build, or the outline of a loaded BVH. Holds: pieces are in the order of memory and cover all of it, parents
//! before children.

use std::ops::Range;

use crate::layout::{LeafLayout, Word};
use crate::outline::{LeafOutline, Outline, Slot};

/// Most primitives of a piece that is a subtree.
pub(crate) const MAX_SUBTREE: usize = 1 << 12;

/// A subtree, or a single node above all subtrees.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub(crate) root: Word,
    pub(crate) lines: Range<usize>,
    pub(crate) units: Range<usize>,
    /// Whether this is a single node above subtrees.
    pub(crate) is_above: bool,
}

/// The pieces of a BVH whose records may be anywhere; a single piece where subtrees are scattered.
pub(crate) fn of_outline(
    outline: &Outline,
    layout: &LeafLayout,
    root: Word,
    n_lines: usize,
    n_units: usize,
) -> Vec<Piece> {
    let first = match (outline.nodes.first(), outline.leaves.first()) {
        (Some(_), _) => Slot::Node(0),
        (None, Some(_)) => Slot::Leaf(0),
        (None, None) => return vec![],
    };
    let mut pieces = vec![];
    let mut open = vec![(first, root)];
    while let Some((slot, root)) = open.pop() {
        let piece = of_slot(outline, layout, slot, root);
        if let (Slot::Node(node), true) = (slot, piece.is_above) {
            let node = &outline.nodes[node];
            let children = node.slots.iter().filter(|&&slot| slot != Slot::Empty);
            // The first slot is popped first, and its records are the first.
            open.extend(children.rev().map(|&slot| (slot, word(outline, slot))));
        }
        pieces.push(piece);
    }
    // Nodes above have no units, and single leaves no lines: theirs are empty, where those of the next piece start.
    let (mut line, mut unit) = (n_lines, n_units);
    for piece in pieces.iter_mut().rev() {
        if piece.lines.is_empty() {
            piece.lines = line..line;
        }
        if piece.units.is_empty() {
            piece.units = unit..unit;
        }
        (line, unit) = (piece.lines.start, piece.units.start);
    }
    let follow = |of: fn(&Piece) -> &Range<usize>, n: usize| {
        let mut end = 0;
        pieces.iter().all(|piece| std::mem::replace(&mut end, of(piece).end) == of(piece).start) && end == n
    };
    if follow(|piece| &piece.lines, n_lines) && follow(|piece| &piece.units, n_units) {
        return pieces;
    }
    vec![Piece { root, lines: 0..n_lines, units: 0..n_units, is_above: false }]
}

/// The piece that starts at a slot; the units of a node above subtrees are empty.
fn of_slot(outline: &Outline, layout: &LeafLayout, slot: Slot, root: Word) -> Piece {
    let places = outline.places(slot);
    let end_of = |leaf: &LeafOutline| leaf.unit(layout) + layout.n_units(leaf.places.len());
    let units = |leaves: &[LeafOutline]| {
        let start = leaves.iter().map(|leaf| leaf.unit(layout)).min().unwrap_or(0);
        start..leaves.iter().map(end_of).max().unwrap_or(start)
    };
    match slot {
        Slot::Node(node) if places.len() > MAX_SUBTREE => {
            let node = &outline.nodes[node];
            Piece { root, lines: node.line..node.line + node.kind.n_lines(), units: 0..0, is_above: true }
        }
        Slot::Node(node) => {
            // Parents precede children, so the starts of places do not decrease.
            let nodes = &outline.nodes[node..];
            let nodes = &nodes[..nodes.partition_point(|node| node.places.start < places.end)];
            let first = outline.leaves.partition_point(|leaf| leaf.places.start < places.start);
            let leaves = &outline.leaves[first..];
            let leaves = &leaves[..leaves.partition_point(|leaf| leaf.places.start < places.end)];
            let start = nodes.iter().map(|node| node.line).min().unwrap_or(0);
            let end = nodes.iter().map(|node| node.line + node.kind.n_lines()).max().unwrap_or(start);
            Piece { root, lines: start..end, units: units(leaves), is_above: false }
        }
        Slot::Leaf(leaf) => Piece { root, lines: 0..0, units: units(&outline.leaves[leaf..=leaf]), is_above: false },
        Slot::Empty => unreachable!("empty slots start no piece"),
    }
}

/// The word that names the content of a slot.
fn word(outline: &Outline, slot: Slot) -> Word {
    match slot {
        Slot::Node(node) => Word::node(outline.nodes[node].kind, outline.nodes[node].line),
        Slot::Leaf(leaf) => Word::leaf(outline.leaves[leaf].first, outline.leaves[leaf].places.len()),
        Slot::Empty => Word::EMPTY,
    }
}
