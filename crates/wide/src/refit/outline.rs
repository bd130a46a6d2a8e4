//! What lies below what: one walk over all records, which trusts none of them.

use std::ops::Range;

use super::flaw::Flaw;
use crate::emit::{Records, n_halves};
use crate::layout::{NodeKind, PART_LANES, PARTS, Word, WordKind, node_words};

/// What a slot of a node holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slot {
    Nothing,
    /// Place in [`Outline::leaves`].
    Leaf(usize),
    /// Place in [`Outline::nodes`].
    Node(usize),
}

/// A node: where it stands and what is below it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NodeSpot {
    pub(crate) kind: NodeKind,
    pub(crate) line: usize,
    pub(crate) slots: [Slot; 8],
    /// Places of all triangles below.
    pub(crate) places: Range<usize>,
}

/// A leaf: the part of a half-block that it starts with, and its triangles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LeafSpot {
    pub(crate) first: usize,
    pub(crate) places: Range<usize>,
    /// Whether another leaf stands in the same half-block.
    pub(crate) is_shared: bool,
}

impl LeafSpot {
    /// Its first half-block.
    pub(crate) fn half(&self) -> usize {
        self.first / PARTS
    }

    /// The part of it that the leaf starts with.
    pub(crate) fn part(&self) -> usize {
        self.first % PARTS
    }
}

/// All nodes and leaves, parents before children.
///
/// A triangle's place counts all that are met before it, depth first, so those below any node lie side by side.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Outline {
    pub(crate) nodes: Vec<NodeSpot>,
    pub(crate) leaves: Vec<LeafSpot>,
    pub(crate) n_places: usize,
    /// Nodes on the longest way from the root to a leaf.
    pub(crate) depth: u32,
}

impl Outline {
    /// Walks from the root; every record must be reached once, which also ends the walk.
    pub(crate) fn of(records: &Records) -> Result<Self, Flaw> {
        let mut outline = Self::default();
        let mut lines = Claims::new("line", records.lines.len());
        let mut parts = Claims::new("part of a block", PARTS * records.halves.len());
        let mut open = vec![(records.root, None, 0)];
        while let Some((word, parent, depth)) = open.pop() {
            let slot = match word.kind() {
                WordKind::Empty if word == Word::EMPTY => Slot::Nothing,
                WordKind::Empty => return Err(Flaw::Word { word: word.0 }),
                WordKind::Leaf { first, n } => {
                    let (first, n) = (first as usize, n as usize);
                    if n > PART_LANES && first % PARTS != 0 {
                        return Err(Flaw::Word { word: word.0 });
                    }
                    parts.claim(first, if n > PART_LANES { PARTS * n_halves(n) } else { 1 })?;
                    outline.add_leaf(first, n)
                }
                WordKind::Node(kind, line) => {
                    lines.claim(line as usize, kind.n_lines())?;
                    let index = outline.nodes.len();
                    let words = node_words(&records.lines, kind, line);
                    // The stack gives back the last first.
                    open.extend(words.iter().enumerate().rev().map(|(i, &w)| (w, Some((index, i)), depth + 1)));
                    outline.add_node(kind, line as usize, depth + 1)
                }
            };
            if let Some((node, i)) = parent {
                let node: &mut NodeSpot = &mut outline.nodes[node];
                node.slots[i] = slot;
            }
        }
        lines.all_claimed()?;
        outline.share(&mut parts);
        parts.all_claimed()?;
        outline.close()?;
        Ok(outline)
    }

    fn add_leaf(&mut self, first: usize, n: usize) -> Slot {
        let start = self.n_places;
        self.n_places += n;
        self.leaves.push(LeafSpot { first, places: start..self.n_places, is_shared: false });
        Slot::Leaf(self.leaves.len() - 1)
    }

    /// Lets every small leaf know whether it shares its half-block; one in a first part owns the second that none has.
    fn share(&mut self, parts: &mut Claims) {
        for leaf in self.leaves.iter_mut().filter(|leaf| leaf.places.len() <= PART_LANES) {
            leaf.is_shared = parts.taken[leaf.first ^ 1];
        }
        for leaf in self.leaves.iter().filter(|leaf| !leaf.is_shared && leaf.part() == 0) {
            parts.taken[leaf.first | 1] = true;
        }
    }

    fn add_node(&mut self, kind: NodeKind, line: usize, depth: u32) -> Slot {
        let places = self.n_places..self.n_places;
        self.depth = self.depth.max(depth);
        self.nodes.push(NodeSpot { kind, line, slots: [Slot::Nothing; 8], places });
        Slot::Node(self.nodes.len() - 1)
    }

    /// Lets every node's places end where its last child's do.
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

    /// Places of the triangles below a slot.
    pub(crate) fn places(&self, slot: Slot) -> Range<usize> {
        match slot {
            Slot::Nothing => 0..0,
            Slot::Leaf(leaf) => self.leaves[leaf].places.clone(),
            Slot::Node(node) => self.nodes[node].places.clone(),
        }
    }

    /// Nodes in the order of their lines.
    pub(crate) fn nodes_by_line(&self) -> Vec<&NodeSpot> {
        let mut nodes: Vec<_> = self.nodes.iter().collect();
        nodes.sort_unstable_by_key(|node| node.line);
        nodes
    }

    /// Leaves in the order of their blocks and parts.
    pub(crate) fn leaves_by_block(&self) -> Vec<&LeafSpot> {
        let mut leaves: Vec<_> = self.leaves.iter().collect();
        leaves.sort_unstable_by_key(|leaf| leaf.first);
        leaves
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
