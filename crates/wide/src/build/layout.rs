//! Positions of nodes and leaves: of each subtree on its own, on all threads, then of the subtrees.

use std::ops::Range;

use canted_lbvh::{Child, ChildKind, Tree};
use canted_obb::{Aabb, PrimId};
use canted_trace::Slabs;

use crate::build::collapse::{Form, Plan, WIDTH};
use crate::build::subtrees::LeafContents;
use crate::node::{self, ChildWord, DecodedWord, LeafLayout, Limits, MAX_LEAF, MAX_SUBTREE, NodeKind};
use crate::par;
use crate::traverse::BoxPads;

/// What records are written from.
pub(crate) struct Source<'a> {
    pub(crate) tree: &'a Tree,
    pub(crate) members: LeafContents<'a>,
    /// The primitive of each place in leaf order.
    pub(crate) primitives: &'a [PrimId],
    /// Whether places may share a primitive.
    pub(crate) is_shared: bool,
    /// Boxes in the mesh frame, rounded outward: of leaves, and of inner nodes by their number.
    pub(crate) leaf_boxes: &'a [Aabb],
    pub(crate) inner_boxes: &'a [Aabb],
    /// Frames of leaves and inner nodes.
    pub(crate) frames: &'a (dyn Fn(Child) -> [[f32; 3]; 3] + Sync),
    /// The box with these rows around the primitives of a range of places, rounded outward.
    pub(crate) slabs: &'a (dyn Fn(Range<usize>, [[f32; 3]; 3]) -> Slabs + Sync),
    /// Greatest coordinates relative to the reference point, of leaves and inner nodes.
    pub(crate) reach: &'a (dyn Fn(Child) -> f32 + Sync),
    pub(crate) pads: BoxPads,
}

/// A BVH has more records than its references can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TooLarge;

/// Places of the primitives below a child.
pub(super) fn range(source: &Source, child: Child) -> Range<u32> {
    match child.kind() {
        ChildKind::Leaf(position) => source.members.range(position, position),
        ChildKind::Inner(id) => {
            let node = &source.tree.nodes[id.index()];
            source.members.range(node.first, node.last)
        }
    }
}

/// Positions of a leaf's primitives, each primitive once, and their number: references may share one.
pub(super) fn distinct(source: &Source, start: u32, end: u32) -> ([u32; MAX_LEAF], usize) {
    let primitives = source.primitives;
    let mut positions = [0; MAX_LEAF];
    let mut n = 0;
    for position in start..end {
        let primitive = primitives[position as usize];
        if !source.is_shared || !positions[..n].iter().any(|&p| primitives[p as usize] == primitive) {
            positions[n] = position;
            n += 1;
        }
    }
    (positions, n)
}

/// Their number.
pub(super) fn n_distinct(source: &Source, start: u32, end: u32) -> usize {
    if source.is_shared { distinct(source, start, end).1 } else { (end - start) as usize }
}

/// A wide node before it is written.
#[derive(Clone, Debug)]
pub(super) struct NodeDraft {
    pub(super) kind: NodeKind,
    /// Relative to the subtree.
    pub(super) line: usize,
    pub(super) n_children: usize,
    /// Words relative to the subtree.
    pub(super) children: [(Child, ChildWord); WIDTH],
}

/// A leaf before it is written: the part of a unit that it starts with, and the places of its primitives in leaf
/// order.
#[derive(Clone, Copy, Debug)]
pub(super) struct LeafDraft {
    /// Relative to the subtree.
    pub(super) first: usize,
    pub(super) places: [u32; 2],
}

/// Nodes and leaves in one piece of memory: a subtree, or a single node above all subtrees.
#[derive(Clone, Debug)]
pub(super) struct SubtreeDraft {
    pub(super) nodes: Vec<NodeDraft>,
    pub(super) leaves: Vec<LeafDraft>,
    /// Relative to itself.
    root: ChildWord,
    pub(super) n_lines: usize,
    pub(super) n_units: usize,
    /// Lines and parts of units before it.
    pub(super) base: Base,
    /// Greatest number of nodes from the root of the BVH to a leaf in here.
    depth: u32,
}

/// Lines and parts of units before a piece.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Base {
    line: usize,
    part: usize,
}

impl Base {
    /// A word of a piece with this base.
    pub(super) fn word(self, word: ChildWord) -> ChildWord {
        match word.kind() {
            DecodedWord::Leaf { first, n } => ChildWord::leaf(self.part + first as usize, n as usize),
            DecodedWord::Node(kind, line) => ChildWord::node(kind, self.line + line as usize),
            DecodedWord::Empty => word,
        }
    }
}

/// All pieces in the order of memory.
#[derive(Default)]
pub(crate) struct Layout {
    pub(super) pieces: Vec<SubtreeDraft>,
    pub(super) root: Option<ChildWord>,
    pub(super) depth: u32,
    pub(super) n_lines: usize,
    pub(super) n_units: usize,
}

/// A child that waits for its position: the kind of its parent, the slot that names it, its depth.
#[derive(Clone, Copy)]
struct Waiting {
    child: Child,
    parent: NodeKind,
    /// A node and its slot.
    slot: Option<(usize, usize)>,
    depth: u32,
}

/// Assigns a position to every node and leaf, depth first, larger children first; an error where the BVH is too large.
pub(crate) fn layout<const KINDS: usize>(
    source: &Source,
    plan: &Plan<'_, KINDS>,
    limits: &Limits,
    leaf_layout: &LeafLayout,
) -> Result<Layout, TooLarge> {
    let Some(root) = source.tree.root() else { return Ok(Layout::default()) };
    // Nodes above all subtrees are pieces of their own, so that memory keeps the order of a traversal.
    let mut above: Vec<(Waiting, Option<NodeDraft>)> = vec![];
    let mut open = vec![Waiting { child: root, parent: NodeKind::Aligned, slot: None, depth: 0 }];
    while let Some(waiting) = open.pop() {
        let form = plan.form(waiting.child, waiting.parent);
        match form {
            Form::Node(kind) if range(source, waiting.child).len() > MAX_SUBTREE => {
                let draft = draft(plan, waiting.child, kind, 0);
                push_children(&mut open, &draft, above.len(), waiting.depth + 1);
                above.push((waiting, Some(draft)));
            }
            _ => above.push((waiting, None)),
        }
    }
    let mut pieces = par::map(&above, 1, |(waiting, draft)| match draft {
        Some(draft) => SubtreeDraft::of_node(draft.clone(), waiting.depth + 1),
        None => SubtreeDraft::of_subtree(source, plan, leaf_layout, *waiting),
    });
    let mut layout = Layout::default();
    for (i, (waiting, _)) in above.iter().enumerate() {
        let piece = &mut pieces[i];
        piece.base = Base { line: layout.n_lines, part: leaf_layout.n_parts * layout.n_units };
        layout.n_lines += piece.n_lines;
        layout.n_units += piece.n_units;
        layout.depth = layout.depth.max(piece.depth);
        if layout.n_lines > limits.n_lines || leaf_layout.n_parts * layout.n_units > limits.n_parts {
            return Err(TooLarge);
        }
        let word = piece.base.word(piece.root);
        match waiting.slot {
            None => layout.root = Some(word),
            // Nodes above hold words of the whole BVH.
            Some((above, slot)) => pieces[above].nodes[0].children[slot].1 = word,
        }
    }
    Ok(Layout { pieces, ..layout })
}

/// A node whose children have no words yet, larger children first.
fn draft<const KINDS: usize>(plan: &Plan<'_, KINDS>, child: Child, kind: NodeKind, line: usize) -> NodeDraft {
    let mut rest: Vec<(Child, f32)> =
        plan.children(child, kind).into_iter().map(|child| (child, plan.area(child, kind))).collect();
    let (n_children, mut children) = (rest.len(), [(child, ChildWord::EMPTY); WIDTH]);
    // At most eight children: a sort of the standard library takes several kB of every program. Of equals the first comes first.
    for slot in &mut children[..n_children] {
        let larger = |most: usize, i: usize| if rest[i].1.total_cmp(&rest[most].1).is_gt() { i } else { most };
        slot.0 = rest.remove((1..rest.len()).fold(0, larger)).0;
    }
    NodeDraft { kind, line, n_children, children }
}

/// Pushes the children of node `index` so that the first is popped first.
fn push_children(open: &mut Vec<Waiting>, draft: &NodeDraft, index: usize, depth: u32) {
    let children = draft.children[..draft.n_children].iter().enumerate().rev();
    open.extend(children.map(|(i, &(child, _))| Waiting { child, parent: draft.kind, slot: Some((index, i)), depth }));
}

impl SubtreeDraft {
    /// A node whose depth in the BVH, itself included, is `depth`.
    fn of_node(draft: NodeDraft, depth: u32) -> Self {
        let (root, n_lines) = (ChildWord::node(draft.kind, 0), draft.kind.n_lines());
        Self { nodes: vec![draft], leaves: vec![], root, n_lines, n_units: 0, base: Base::default(), depth }
    }

    fn of_subtree<const KINDS: usize>(
        source: &Source,
        plan: &Plan<'_, KINDS>,
        leaf_layout: &LeafLayout,
        root: Waiting,
    ) -> Self {
        let mut piece = Self {
            nodes: vec![],
            leaves: vec![],
            root: ChildWord::EMPTY,
            n_lines: 0,
            n_units: 0,
            base: Base::default(),
            depth: root.depth,
        };
        let mut units = Units::new(leaf_layout);
        let mut open = vec![Waiting { slot: None, ..root }];
        while let Some(Waiting { child, parent, slot, depth }) = open.pop() {
            let word = match plan.form(child, parent) {
                Form::Leaf => {
                    let Range { start, end } = range(source, child);
                    let n = n_distinct(source, start, end);
                    let first = units.next(n);
                    piece.leaves.push(LeafDraft { first, places: [start, end] });
                    ChildWord::leaf(first, n)
                }
                Form::Node(kind) => {
                    let draft = draft(plan, child, kind, piece.n_lines);
                    push_children(&mut open, &draft, piece.nodes.len(), depth + 1);
                    piece.depth = piece.depth.max(depth + 1);
                    let word = ChildWord::node(kind, piece.n_lines);
                    piece.n_lines += kind.n_lines();
                    piece.nodes.push(draft);
                    word
                }
            };
            match slot {
                None => piece.root = word,
                Some((node, i)) => piece.nodes[node].children[i].1 = word,
            }
        }
        Self { n_units: units.n, ..piece }
    }

    /// A word of this piece as the whole BVH names it.
    pub(super) fn word(&self, word: ChildWord) -> ChildWord {
        // A single node refers to other pieces, whose words are final.
        if self.is_above() { word } else { self.base.word(word) }
    }

    /// Where it is in memory.
    pub(super) fn of_memory(&self, leaf_layout: &LeafLayout) -> node::SubtreeSlots {
        let (line, unit) = (self.base.line, self.base.part / leaf_layout.n_parts);
        node::SubtreeSlots {
            root: self.base.word(self.root),
            lines: line..line + self.n_lines,
            units: unit..unit + self.n_units,
            is_above: self.is_above(),
        }
    }

    /// Whether this is a node above all subtrees.
    fn is_above(&self) -> bool {
        self.leaves.is_empty()
    }
}

/// Assigns units to the leaves of a subtree.
pub(crate) struct Units<'a> {
    layout: &'a LeafLayout,
    pub(crate) n: usize,
    /// The second part of a unit whose first is taken.
    free: Option<usize>,
}

impl<'a> Units<'a> {
    pub(crate) fn new(layout: &'a LeafLayout) -> Self {
        Self { layout, n: 0, free: None }
    }

    /// The part that a leaf of `n` primitives starts with.
    pub(crate) fn next(&mut self, n: usize) -> usize {
        if let Some(part) = self.free.take_if(|_| n <= self.layout.in_part) {
            return part;
        }
        let first = self.layout.n_parts * self.n;
        self.n += self.layout.n_units(n);
        if n <= self.layout.in_part {
            self.free = Some(first + 1);
        }
        first
    }
}
