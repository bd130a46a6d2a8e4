//! From a plan to records: first the position of every node and leaf, then, on all threads, their content.

mod leaf;
mod node;

use std::ops::Range;

use canted_lbvh::{Child, ChildKind, Tree};
use canted_obb::{Aabb, PrimId};
use canted_trace::Slabs;

use leaf::distinct;
pub(crate) use leaf::{write_ids, write_triangles};
use node::write_node;
pub(crate) use node::{write_boxes, write_slabs};

use crate::collapse::{Form, Plan, WIDTH};
use crate::layout::{LeafLayout, Limits, Line, NodeKind, Nodes, Word};
use crate::members::Members;
use crate::par;
use crate::traverse::BoxPads;

/// A wide node before it is written.
#[derive(Clone, Debug)]
struct NodeDraft {
    kind: NodeKind,
    line: usize,
    n_children: usize,
    children: [(Child, Word); WIDTH],
}

/// A leaf before it is written: the part of a unit that it starts with, and its primitives in leaf order.
#[derive(Clone, Copy, Debug)]
struct LeafDraft {
    first: usize,
    start: u32,
    end: u32,
    /// Number of different primitives.
    n: usize,
}

/// What records are written from.
pub(crate) struct Source<'a> {
    pub(crate) tree: &'a Tree,
    pub(crate) members: Members<'a>,
    /// The primitive of each place in leaf order.
    pub(crate) primitives: &'a [PrimId],
    /// Boxes in the mesh frame, rounded outward: of leaves, and of inner nodes by their number.
    pub(crate) leaf_boxes: &'a [Aabb],
    pub(crate) inner_boxes: &'a [Aabb],
    /// Frames of leaves and inner nodes.
    pub(crate) frames: &'a (dyn Fn(Child) -> [[f32; 3]; 3] + Sync),
    /// The box with these rows around the primitives of a range of places, rounded outward.
    pub(crate) slabs: &'a (dyn Fn(Range<usize>, [[f32; 3]; 3]) -> Slabs + Sync),
    /// Greatest coordinates, object space, of leaves and inner nodes.
    pub(crate) reach: &'a (dyn Fn(Child) -> f32 + Sync),
    pub(crate) pads: BoxPads,
}

/// A BVH has more records than its references can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TooLarge;

/// Writes a leaf: the positions of its primitives in leaf order, the part of the first unit that it starts with, the units.
pub(crate) type WriteLeaf<'a, U> = dyn Fn(&[u32], usize, &mut [U]) + Sync + 'a;

/// Writes the wide BVH of `plan`: nodes, and units of leaves; nothing is written of one that is too large.
pub(crate) fn emit<U: Copy + Send + Sync, const KINDS: usize>(
    source: &Source,
    plan: &Plan<'_, KINDS>,
    limits: &Limits,
    leaf_layout: &LeafLayout,
    unset: U,
    write: &WriteLeaf<U>,
) -> Result<(Nodes, Vec<U>), TooLarge> {
    let (drafts, leaves, root, depth) = layout(source, plan, limits, leaf_layout)?;
    let n_lines = drafts.last().map_or(0, |draft| draft.line + draft.kind.n_lines());
    let unit_of = |leaf: &LeafDraft| leaf.first / leaf_layout.n_parts;
    let n_units = leaves.last().map_or(0, |leaf| unit_of(leaf) + leaf_layout.n_units(leaf.n));
    let mut lines = par::filled(n_lines, Line([0; 16]));
    let mut units = par::filled(n_units, unset);
    par::for_pieces(&drafts, &mut lines, |draft| draft.line, |draft, out| write_node(source, draft, out));
    // Leaves that share a unit are written by one job.
    let together: Vec<&[LeafDraft]> = leaves.chunk_by(|a, b| unit_of(a) == unit_of(b)).collect();
    let write_leaves = |leaves: &&[LeafDraft], out: &mut [U]| {
        for leaf in *leaves {
            let (positions, n) = distinct(source.primitives, leaf.start, leaf.end);
            write(&positions[..n], leaf.first % leaf_layout.n_parts, out);
        }
    };
    par::for_pieces(&together, &mut units, |leaves| unit_of(&leaves[0]), write_leaves);
    Ok((Nodes { lines: lines.into(), root, depth }, units))
}

/// Places of the primitives below a child.
fn range(source: &Source, child: Child) -> Range<u32> {
    match child.kind() {
        ChildKind::Leaf(position) => source.members.range(position, position),
        ChildKind::Inner(id) => {
            let node = &source.tree.nodes[id.index()];
            source.members.range(node.first, node.last)
        }
    }
}

/// Assigns units to leaves.
struct Units<'a> {
    layout: &'a LeafLayout,
    n: usize,
    /// The second part of a unit whose first is taken.
    free: Option<usize>,
}

impl Units<'_> {
    /// The part that a leaf of `n` primitives starts with.
    fn next(&mut self, n: usize, limits: &Limits) -> Result<usize, TooLarge> {
        if let Some(part) = self.free.take_if(|_| n <= self.layout.in_part) {
            return Ok(part);
        }
        let first = self.layout.n_parts * self.n;
        self.n += self.layout.n_units(n);
        if n <= self.layout.in_part {
            self.free = Some(first + 1);
        }
        if self.layout.n_parts * self.n > limits.n_parts { Err(TooLarge) } else { Ok(first) }
    }
}

/// Assigns a position to every node and leaf, depth first, larger children first; sorts leaves by position.
fn layout<const KINDS: usize>(
    source: &Source,
    plan: &Plan<'_, KINDS>,
    limits: &Limits,
    leaf_layout: &LeafLayout,
) -> Result<(Vec<NodeDraft>, Vec<LeafDraft>, Word, u32), TooLarge> {
    let (mut drafts, mut leaves): (Vec<NodeDraft>, Vec<LeafDraft>) = (vec![], vec![]);
    let Some(root) = source.tree.root() else { return Ok((drafts, leaves, Word::EMPTY, 0)) };
    let (mut n_lines, mut units, mut deepest) = (0, Units { layout: leaf_layout, n: 0, free: None }, 0);
    let mut root_word = Word::EMPTY;
    // The subtree, its parent's kind, the slot that waits for its word, and its depth.
    let mut open = vec![(root, NodeKind::Aligned, None, 0u32)];
    while let Some((child, parent_kind, slot, depth)) = open.pop() {
        let word = match plan.form(child, parent_kind) {
            Form::Leaf => {
                let Range { start, end } = range(source, child);
                let (_, n) = distinct(source.primitives, start, end);
                let first = units.next(n, limits)?;
                leaves.push(LeafDraft { first, start, end, n });
                Word::leaf(first, n)
            }
            Form::Node(kind) => {
                let mut sized: Vec<(Child, f32)> =
                    plan.children(child, kind).into_iter().map(|child| (child, plan.area(child, kind))).collect();
                sized.sort_by(|a, b| b.1.total_cmp(&a.1));
                let line = n_lines;
                n_lines += kind.n_lines();
                if n_lines > limits.n_lines {
                    return Err(TooLarge);
                }
                let index = drafts.len();
                // The stack returns the last entry first.
                open.extend(sized.iter().enumerate().rev().map(|(i, &(c, _))| (c, kind, Some((index, i)), depth + 1)));
                deepest = deepest.max(depth + 1);
                let mut children = [(child, Word::EMPTY); WIDTH];
                for (slot, &(child, _)) in children.iter_mut().zip(&sized) {
                    slot.0 = child;
                }
                drafts.push(NodeDraft { kind, line, n_children: sized.len(), children });
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
