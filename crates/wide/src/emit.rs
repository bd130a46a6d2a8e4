//! From a plan to records: first where everything stands, then, on all threads, what it holds.

mod leaf;
mod node;
#[cfg(test)]
mod tests;

use canted_lbvh::{Child, ChildKind, Corners, Tree};
use canted_obb::{Aabb, PrimId};

use leaf::{LeafForm, Triangles, distinct};
pub(crate) use leaf::{Numbers, n_halves};
use node::write_node;
pub(crate) use node::{write_boxes, write_slabs};

use crate::Sizes;
use crate::collapse::{Form, Plan};
use crate::layout::{Half, Limits, Line, NodeKind, Word, WordKind, node_words};
use crate::par;

/// A wide node before it is written: its place and its children.
#[derive(Clone, Debug)]
struct Draft {
    kind: NodeKind,
    line: usize,
    children: Vec<(Child, Word)>,
}

/// A leaf before it is written: the part of a place that it starts with, and its primitives in leaf order.
#[derive(Clone, Copy, Debug)]
struct LeafDraft {
    first: usize,
    start: u32,
    end: u32,
}

/// What boxes are written from.
pub(crate) struct Source<'a> {
    pub(crate) tree: &'a Tree,
    /// Vertices in leaf order; empty where primitives are not triangles.
    pub(crate) corners: &'a [Corners],
    /// Primitive of each leaf.
    pub(crate) primitives: &'a [PrimId],
    /// Boxes in the mesh's frame, rounded outward: of leaves, and of inner nodes by their number.
    pub(crate) leaf_boxes: &'a [Aabb],
    pub(crate) inner_boxes: &'a [Aabb],
    /// Frames of leaves and inner nodes.
    pub(crate) frames: &'a (dyn Fn(Child) -> [[f32; 3]; 3] + Sync),
}

/// Nodes and leaves as rays walk through them.
#[derive(Clone, Debug)]
pub(crate) struct Records {
    pub(crate) lines: Vec<Line>,
    pub(crate) halves: Vec<Half>,
    pub(crate) root: Word,
    /// Nodes on the longest way from the root to a leaf, the leaf left out.
    pub(crate) depth: u32,
}

impl Records {
    /// Sizes, by a walk over all nodes.
    pub(crate) fn sizes(&self) -> Sizes {
        let mut sizes = Sizes {
            nodes: [0; 2],
            node_bytes: size_of_val(&self.lines[..]),
            block_bytes: size_of_val(&self.halves[..]),
            depth: self.depth,
        };
        let mut open = vec![self.root];
        while let Some(word) = open.pop() {
            if let WordKind::Node(kind, line) = word.kind() {
                sizes.nodes[kind as usize] += 1;
                open.extend_from_slice(node_words(&self.lines, kind, line));
            }
        }
        sizes
    }
}

/// A tree has more records than its references can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TooLarge;

/// Writes the wide tree of `plan` over triangles.
pub(crate) fn emit(source: &Source, plan: &Plan, limits: &Limits) -> Result<Records, TooLarge> {
    let (records, halves) = emit_as::<Triangles>(source, plan, limits)?;
    Ok(Records { halves, ..records })
}

/// Writes the wide tree of `plan`, and apart from it what its leaves hold; nothing is written of one that is too large.
pub(crate) fn emit_as<L: LeafForm>(
    source: &Source,
    plan: &Plan,
    limits: &Limits,
) -> Result<(Records, Vec<L::Place>), TooLarge> {
    let (drafts, leaves, root, depth) = layout::<L>(source, plan, limits)?;
    let n_lines = drafts.last().map_or(0, |draft| draft.line + draft.kind.n_lines());
    let n_places = leaves.last().map_or(0, |leaf| leaf.first / L::PARTS + L::n_places(leaf.n(source)));
    let mut lines = vec![Line([0; 16]); n_lines];
    let mut places = vec![L::UNSET; n_places];
    let write_node = |draft: &Draft, out: &mut [Line]| write_node(source, draft, out);
    par::for_pieces(&drafts, &mut lines, |draft| draft.line, write_node);
    // Leaves that share a place are written by one job.
    let together: Vec<&[LeafDraft]> = leaves.chunk_by(|a, b| a.first / L::PARTS == b.first / L::PARTS).collect();
    let write_leaves = |leaves: &&[LeafDraft], out: &mut [L::Place]| {
        for leaf in *leaves {
            let (places, n) = distinct(source, leaf.start, leaf.end);
            L::write(source, &places[..n], leaf.first % L::PARTS, out);
        }
    };
    par::for_pieces(&together, &mut places, |leaves| leaves[0].first / L::PARTS, write_leaves);
    Ok((Records { lines, halves: Vec::new(), root, depth }, places))
}

impl LeafDraft {
    /// Number of different primitives.
    fn n(&self, source: &Source) -> usize {
        distinct(source, self.start, self.end).1
    }
}

fn range(tree: &Tree, child: Child) -> (u32, u32) {
    match child.kind() {
        ChildKind::Leaf(place) => (place, place + 1),
        ChildKind::Inner(id) => {
            let node = &tree.nodes[id.index()];
            (node.first, node.last + 1)
        }
    }
}

/// Places given to leaves so far.
#[derive(Default)]
struct Given {
    n_places: usize,
    /// The second part of a place whose first is taken.
    free: Option<usize>,
}

impl Given {
    /// The part that a leaf of `n` primitives starts with.
    fn next<L: LeafForm>(&mut self, n: usize, limits: &Limits) -> Result<usize, TooLarge> {
        if let Some(part) = self.free.take_if(|_| n <= L::IN_PART) {
            return Ok(part);
        }
        let first = L::PARTS * self.n_places;
        self.n_places += L::n_places(n);
        if n <= L::IN_PART {
            self.free = Some(first + 1);
        }
        if L::PARTS * self.n_places > limits.n_parts { Err(TooLarge) } else { Ok(first) }
    }
}

/// Gives every node and leaf its place, depth first, larger children first; leaves are sorted by theirs.
fn layout<L: LeafForm>(
    source: &Source,
    plan: &Plan,
    limits: &Limits,
) -> Result<(Vec<Draft>, Vec<LeafDraft>, Word, u32), TooLarge> {
    let (mut drafts, mut leaves): (Vec<Draft>, Vec<LeafDraft>) = (vec![], vec![]);
    let Some(root) = source.tree.root() else { return Ok((drafts, leaves, Word::EMPTY, 0)) };
    let (mut n_lines, mut given, mut deepest) = (0, Given::default(), 0);
    let mut root_word = Word::EMPTY;
    // The subtree, its parent's kind, the slot that waits for its word, and its depth.
    let mut open = vec![(root, NodeKind::Aligned, None, 0u32)];
    while let Some((child, parent_kind, slot, depth)) = open.pop() {
        let word = match plan.form(child, parent_kind) {
            Form::Leaf => {
                let (start, end) = range(source.tree, child);
                let (_, n) = distinct(source, start, end);
                let first = given.next::<L>(n, limits)?;
                leaves.push(LeafDraft { first, start, end });
                Word::leaf(first, n)
            }
            Form::Node(kind) => {
                let mut children = plan.children(child, kind);
                children.sort_by(|&a, &b| plan.area(b, kind).total_cmp(&plan.area(a, kind)));
                let line = n_lines;
                n_lines += kind.n_lines();
                if n_lines > limits.n_lines {
                    return Err(TooLarge);
                }
                let index = drafts.len();
                // The stack gives back the last first.
                open.extend(children.iter().enumerate().rev().map(|(i, &c)| (c, kind, Some((index, i)), depth + 1)));
                deepest = deepest.max(depth + 1);
                let children = children.into_iter().map(|c| (c, Word::EMPTY)).collect();
                drafts.push(Draft { kind, line, children });
                Word::node(kind, line)
            }
        };
        match slot {
            None => root_word = word,
            Some((draft, i)) => drafts[draft].children[i].1 = word,
        }
    }
    leaves.sort_unstable_by_key(|leaf| leaf.first);
    Ok((drafts, leaves, root_word, deepest))
}
