//! The hierarchy of all records, found by a traversal that checks each of them.

use std::ops::Range;

use crate::flaw::Flaw;
use crate::layout::{LeafLayout, NodeKind, Nodes, Word, WordKind, node_words};

/// What a slot of a node holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slot {
    Empty,
    /// Index in [`Outline::leaves`].
    Leaf(usize),
    /// Index in [`Outline::nodes`].
    Node(usize),
}

/// A node and what is below it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NodeOutline {
    pub(crate) kind: NodeKind,
    pub(crate) line: usize,
    pub(crate) slots: [Slot; 8],
    /// Places of all primitives below.
    pub(crate) places: Range<usize>,
}

/// A leaf: the part of a unit that it starts with, and its primitives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LeafOutline {
    pub(crate) first: usize,
    pub(crate) places: Range<usize>,
    /// Whether another leaf shares its unit.
    pub(crate) is_shared: bool,
}

impl LeafOutline {
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
pub(crate) struct Outline {
    pub(crate) nodes: Vec<NodeOutline>,
    pub(crate) leaves: Vec<LeafOutline>,
    pub(crate) n_places: usize,
    /// Greatest number of nodes from the root to a leaf.
    pub(crate) depth: u32,
}

impl Outline {
    /// Traverses all records from the root; each must be reached once, which also ends the traversal.
    pub(crate) fn of(nodes: &Nodes, n_units: usize, layout: &LeafLayout) -> Result<Self, Flaw> {
        let mut outline = Self::default();
        let mut lines = Claims::new("line", nodes.lines.len());
        let mut parts = Claims::new(layout.part_name, layout.n_parts * n_units);
        let mut open = vec![(nodes.root, None, 0)];
        while let Some((word, parent, depth)) = open.pop() {
            let slot = match word.kind() {
                WordKind::Empty if word == Word::EMPTY => Slot::Empty,
                WordKind::Empty => return Err(Flaw::Word { word: word.0 }),
                WordKind::Leaf { first, n } => {
                    let (first, n) = (first as usize, n as usize);
                    if n > layout.in_part && first % layout.n_parts != 0 {
                        return Err(Flaw::Word { word: word.0 });
                    }
                    parts.claim(first, layout.n_parts_of(n))?;
                    outline.add_leaf(first, n)
                }
                WordKind::Node(kind, line) => {
                    lines.claim(line as usize, kind.n_lines())?;
                    let index = outline.nodes.len();
                    let words = node_words(&nodes.lines, kind, line);
                    // The stack returns the last entry first.
                    open.extend(words.iter().enumerate().rev().map(|(i, &w)| (w, Some((index, i)), depth + 1)));
                    outline.add_node(kind, line as usize, depth + 1)
                }
            };
            if let Some((node, i)) = parent {
                let node: &mut NodeOutline = &mut outline.nodes[node];
                node.slots[i] = slot;
            }
        }
        lines.all_claimed()?;
        outline.find_shared(layout, &mut parts);
        parts.all_claimed()?;
        outline.close()?;
        Ok(outline)
    }

    fn add_leaf(&mut self, first: usize, n: usize) -> Slot {
        let start = self.n_places;
        self.n_places += n;
        self.leaves.push(LeafOutline { first, places: start..self.n_places, is_shared: false });
        Slot::Leaf(self.leaves.len() - 1)
    }

    /// Marks leaves that share a unit; a leaf in a first part owns the second part that no leaf takes.
    fn find_shared(&mut self, layout: &LeafLayout, parts: &mut Claims) {
        for leaf in self.leaves.iter_mut().filter(|leaf| leaf.places.len() <= layout.in_part) {
            leaf.is_shared = parts.taken[leaf.first ^ 1];
        }
        let is_alone = |leaf: &&LeafOutline| {
            leaf.places.len() <= layout.in_part && !leaf.is_shared && leaf.first.is_multiple_of(2)
        };
        for leaf in self.leaves.iter().filter(is_alone) {
            parts.taken[leaf.first | 1] = true;
        }
    }

    fn add_node(&mut self, kind: NodeKind, line: usize, depth: u32) -> Slot {
        let places = self.n_places..self.n_places;
        self.depth = self.depth.max(depth);
        self.nodes.push(NodeOutline { kind, line, slots: [Slot::Empty; 8], places });
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
    pub(crate) fn nodes_by_line(&self) -> Vec<&NodeOutline> {
        let mut nodes: Vec<_> = self.nodes.iter().collect();
        nodes.sort_unstable_by_key(|node| node.line);
        nodes
    }
}

/// Which units of an array belong to a record.
struct Claims {
    unit: &'static str,
    taken: Vec<bool>,
}

impl Claims {
    fn new(unit: &'static str, n: usize) -> Self {
        Self { unit, taken: vec![false; n] }
    }

    fn claim(&mut self, first: usize, n: usize) -> Result<(), Flaw> {
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
