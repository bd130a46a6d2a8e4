//! The hierarchy of all records, found by a traversal that checks each of them.

use std::ops::Range;

use crate::node::{ChildWord, DecodedWord, Flaw, LeafLayout, MAX_SUBTREE, NodeKind, Nodes, SubtreeSlots, node_words};

/// What a slot of a node holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slot {
    Empty,
    /// Index in [`Hierarchy::leaves`].
    Leaf(usize),
    /// Index in [`Hierarchy::nodes`].
    Node(usize),
}

/// A node and what is below it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CheckedNode {
    pub(crate) kind: NodeKind,
    pub(crate) line: usize,
    pub(crate) slots: [Slot; 8],
    /// Places of all primitives below.
    pub(crate) places: Range<usize>,
}

/// A leaf: the part of a unit that it starts with, and its primitives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CheckedLeaf {
    pub(crate) first: usize,
    pub(crate) places: Range<usize>,
    /// Whether another leaf shares its unit.
    pub(crate) is_shared: bool,
}

impl CheckedLeaf {
    /// Its first unit.
    pub(crate) fn unit(&self, layout: &LeafLayout) -> usize {
        self.first / layout.n_parts
    }

    /// The part of it that the leaf starts with.
    pub(crate) fn part(&self, layout: &LeafLayout) -> usize {
        self.first % layout.n_parts
    }
}

/// All nodes and leaves, parents before children.
///
/// The place of a primitive is the number of those before it, depth first, so those below any node are consecutive.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Hierarchy {
    pub(crate) nodes: Vec<CheckedNode>,
    pub(crate) leaves: Vec<CheckedLeaf>,
    pub(crate) n_places: usize,
    /// Greatest number of nodes from the root to a leaf.
    pub(crate) depth: u32,
}

impl Hierarchy {
    /// Traverses all records from the root; each must be reached once, which also ends the traversal.
    pub(crate) fn of(nodes: &Nodes, n_units: usize, layout: &LeafLayout) -> Result<Self, Flaw> {
        let mut hierarchy = Self::default();
        let mut lines = Claims::new("line", nodes.lines.len());
        let mut parts = Claims::new(layout.part_name, layout.n_parts * n_units);
        let mut open = vec![(nodes.root, None, 0)];
        while let Some((word, parent, depth)) = open.pop() {
            let slot = match word.kind() {
                DecodedWord::Empty if word == ChildWord::EMPTY => Slot::Empty,
                DecodedWord::Empty => return Err(Flaw::Word { word: word.0 }),
                DecodedWord::Leaf { first, n } => {
                    let (first, n) = (first as usize, n as usize);
                    if n > layout.in_part && first % layout.n_parts != 0 {
                        return Err(Flaw::Word { word: word.0 });
                    }
                    parts.claim(first, layout.n_parts_of(n))?;
                    hierarchy.add_leaf(first, n)
                }
                DecodedWord::Node(kind, line) => {
                    lines.claim(line as usize, kind.n_lines())?;
                    let index = hierarchy.nodes.len();
                    let words = node_words(&nodes.lines, kind, line);
                    // The stack returns the last entry first.
                    open.extend(words.iter().enumerate().rev().map(|(i, &w)| (w, Some((index, i)), depth + 1)));
                    hierarchy.add_node(kind, line as usize, depth + 1)
                }
            };
            if let Some((node, i)) = parent {
                let node: &mut CheckedNode = &mut hierarchy.nodes[node];
                node.slots[i] = slot;
            }
        }
        lines.all_claimed()?;
        hierarchy.find_shared(layout, &mut parts);
        parts.all_claimed()?;
        hierarchy.close()?;
        Ok(hierarchy)
    }

    fn add_leaf(&mut self, first: usize, n: usize) -> Slot {
        let start = self.n_places;
        self.n_places += n;
        self.leaves.push(CheckedLeaf { first, places: start..self.n_places, is_shared: false });
        Slot::Leaf(self.leaves.len() - 1)
    }

    /// Marks leaves that share a unit; a leaf in a first part owns the second part that no leaf takes.
    fn find_shared(&mut self, layout: &LeafLayout, parts: &mut Claims) {
        for leaf in self.leaves.iter_mut().filter(|leaf| leaf.places.len() <= layout.in_part) {
            leaf.is_shared = parts.taken[leaf.first ^ 1];
        }
        let is_alone = |leaf: &&CheckedLeaf| {
            leaf.places.len() <= layout.in_part && !leaf.is_shared && leaf.first.is_multiple_of(2)
        };
        for leaf in self.leaves.iter().filter(is_alone) {
            parts.taken[leaf.first | 1] = true;
        }
    }

    fn add_node(&mut self, kind: NodeKind, line: usize, depth: u32) -> Slot {
        let places = self.n_places..self.n_places;
        self.depth = self.depth.max(depth);
        self.nodes.push(CheckedNode { kind, line, slots: [Slot::Empty; 8], places });
        Slot::Node(self.nodes.len() - 1)
    }

    /// Ends the places of every node where those of its last child end.
    fn close(&mut self) -> Result<(), Flaw> {
        for i in (0..self.nodes.len()).rev() {
            let node = &self.nodes[i];
            let end = node.slots.iter().map(|&slot| self.places(slot).end).max().unwrap_or(0);
            if end <= node.places.start {
                return Err(Flaw::NoChildren { line: node.line });
            }
            self.nodes[i].places.end = end;
        }
        Ok(())
    }

    /// Places of the primitives below a slot.
    pub(crate) fn places(&self, slot: Slot) -> Range<usize> {
        match slot {
            Slot::Empty => 0..0,
            Slot::Leaf(leaf) => self.leaves[leaf].places.clone(),
            Slot::Node(node) => self.nodes[node].places.clone(),
        }
    }

    /// Nodes in the order of their lines.
    pub(crate) fn nodes_by_line(&self) -> Vec<&CheckedNode> {
        let mut nodes: Vec<_> = self.nodes.iter().collect();
        nodes.sort_unstable_by_key(|node| node.line);
        nodes
    }
}

/// Which units of an array belong to a record.
pub(crate) struct Claims {
    unit: &'static str,
    taken: Vec<bool>,
}

impl Claims {
    pub(crate) fn new(unit: &'static str, n: usize) -> Self {
        Self { unit, taken: vec![false; n] }
    }

    pub(crate) fn claim(&mut self, first: usize, n: usize) -> Result<(), Flaw> {
        let n_units = self.taken.len();
        let Some(own) = self.taken.get_mut(first..first + n) else {
            return Err(Flaw::Outside { unit: self.unit, at: first + n - 1, n_units });
        };
        match own.iter().position(|&taken| taken) {
            Some(i) => Err(Flaw::Twice { unit: self.unit, at: first + i }),
            None => {
                own.fill(true);
                Ok(())
            }
        }
    }

    fn all_claimed(&self) -> Result<(), Flaw> {
        match self.taken.iter().position(|&taken| !taken) {
            Some(at) => Err(Flaw::Unreached { unit: self.unit, at }),
            None => Ok(()),
        }
    }
}

/// The pieces of a BVH whose records may be anywhere; a single piece where subtrees are scattered.
pub(crate) fn subtrees_of(
    hierarchy: &Hierarchy,
    layout: &LeafLayout,
    root: ChildWord,
    n_lines: usize,
    n_units: usize,
) -> Vec<SubtreeSlots> {
    let first = match (hierarchy.nodes.first(), hierarchy.leaves.first()) {
        (Some(_), _) => Slot::Node(0),
        (None, Some(_)) => Slot::Leaf(0),
        (None, None) => return vec![],
    };
    let mut pieces = vec![];
    let mut open = vec![(first, root)];
    while let Some((slot, root)) = open.pop() {
        let piece = of_slot(hierarchy, layout, slot, root);
        if let (Slot::Node(node), true) = (slot, piece.is_above) {
            let node = &hierarchy.nodes[node];
            let children = node.slots.iter().filter(|&&slot| slot != Slot::Empty);
            // The first slot is popped first, and its records are the first.
            open.extend(children.rev().map(|&slot| (slot, word(hierarchy, slot))));
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
    let follow = |of: fn(&SubtreeSlots) -> &Range<usize>, n: usize| {
        let mut end = 0;
        pieces.iter().all(|piece| std::mem::replace(&mut end, of(piece).end) == of(piece).start) && end == n
    };
    if follow(|piece| &piece.lines, n_lines) && follow(|piece| &piece.units, n_units) {
        return pieces;
    }
    vec![SubtreeSlots { root, lines: 0..n_lines, units: 0..n_units, is_above: false }]
}

/// The piece that starts at a slot; the units of a node above subtrees are empty.
fn of_slot(hierarchy: &Hierarchy, layout: &LeafLayout, slot: Slot, root: ChildWord) -> SubtreeSlots {
    let places = hierarchy.places(slot);
    let end_of = |leaf: &CheckedLeaf| leaf.unit(layout) + layout.n_units(leaf.places.len());
    let units = |leaves: &[CheckedLeaf]| {
        let start = leaves.iter().map(|leaf| leaf.unit(layout)).min().unwrap_or(0);
        start..leaves.iter().map(end_of).max().unwrap_or(start)
    };
    match slot {
        Slot::Node(node) if places.len() > MAX_SUBTREE => {
            let node = &hierarchy.nodes[node];
            SubtreeSlots { root, lines: node.line..node.line + node.kind.n_lines(), units: 0..0, is_above: true }
        }
        Slot::Node(node) => {
            // Parents precede children, so the starts of places do not decrease.
            let nodes = &hierarchy.nodes[node..];
            let nodes = &nodes[..nodes.partition_point(|node| node.places.start < places.end)];
            let first = hierarchy.leaves.partition_point(|leaf| leaf.places.start < places.start);
            let leaves = &hierarchy.leaves[first..];
            let leaves = &leaves[..leaves.partition_point(|leaf| leaf.places.start < places.end)];
            let start = nodes.iter().map(|node| node.line).min().unwrap_or(0);
            let end = nodes.iter().map(|node| node.line + node.kind.n_lines()).max().unwrap_or(start);
            SubtreeSlots { root, lines: start..end, units: units(leaves), is_above: false }
        }
        Slot::Leaf(leaf) => {
            SubtreeSlots { root, lines: 0..0, units: units(&hierarchy.leaves[leaf..=leaf]), is_above: false }
        }
        Slot::Empty => unreachable!("empty slots start no piece"),
    }
}

/// The word that names the content of a slot.
fn word(hierarchy: &Hierarchy, slot: Slot) -> ChildWord {
    match slot {
        Slot::Node(node) => ChildWord::node(hierarchy.nodes[node].kind, hierarchy.nodes[node].line),
        Slot::Leaf(leaf) => ChildWord::leaf(hierarchy.leaves[leaf].first, hierarchy.leaves[leaf].places.len()),
        Slot::Empty => ChildWord::EMPTY,
    }
}
