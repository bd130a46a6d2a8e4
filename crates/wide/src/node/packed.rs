//! The records of a BVH that was changed in place, one after another again.

use canted_obb::PrimId;

use super::checked::{Hierarchy, subtrees_of};
use super::{CacheLine, ChildWord, DecodedWord, LeafLayout, NodeKind, Nodes};

impl Nodes {
    /// The same nodes and the primitives of their leaves in the order of a traversal, without unused memory; `None` where they are already.
    pub(crate) fn packed(&self, order: &[PrimId]) -> Option<(Self, Vec<PrimId>)> {
        self.links.as_ref().filter(|links| links.is_scattered)?;
        let (mut lines, mut places): (Vec<CacheLine>, Vec<PrimId>) = (vec![], vec![]);
        let (mut root, mut depth) = (ChildWord::EMPTY, 0);
        // Each word with its row of the node above, and the slot.
        let mut open = vec![(self.root, None, 0)];
        while let Some((word, parent, level)) = open.pop() {
            let packed = match word.kind() {
                DecodedWord::Empty => word,
                DecodedWord::Leaf { first, n } => {
                    let (first, n) = (first as usize, n as usize);
                    let packed = ChildWord::leaf(places.len(), n);
                    places.extend_from_slice(&order[first..first + n]);
                    packed
                }
                DecodedWord::Node(kind, line) => {
                    let (at, line) = (lines.len(), line as usize);
                    lines.extend_from_slice(&self.lines[line..line + kind.n_lines()]);
                    let words = super::node_words(&self.lines, kind, line as u32);
                    let children = words.iter().enumerate().rev().filter(|(_, word)| **word != ChildWord::EMPTY);
                    open.extend(children.map(|(slot, &word)| (word, Some((kind, at, slot)), level + 1)));
                    depth = depth.max(level + 1);
                    ChildWord::node(kind, at)
                }
            };
            match parent {
                None => root = packed,
                Some((kind, line, slot)) => super::set_word(&mut lines, kind, line, slot, packed),
            }
        }
        let has_oriented = self.has_oriented;
        let mut nodes = Self { lines: lines.into(), root, depth, has_oriented, pieces: vec![], links: None };
        let hierarchy = nodes.find_pieces(&LeafLayout::IDS, places.len());
        nodes.has_oriented = hierarchy.nodes.iter().any(|node| node.kind == NodeKind::Oriented);
        Some((nodes, places))
    }

    /// Finds the pieces of records that are all reached once.
    pub(crate) fn find_pieces(&mut self, layout: &LeafLayout, n_units: usize) -> Hierarchy {
        let hierarchy = Hierarchy::of(self, n_units, layout).expect("all records were reached once");
        self.pieces = subtrees_of(&hierarchy, layout, self.root, self.lines.len(), n_units);
        hierarchy
    }

    /// The first part and the number of primitives of each leaf.
    pub(crate) fn leaf_words(&self) -> impl Iterator<Item = (u32, u32)> {
        let mut open = vec![self.root];
        std::iter::from_fn(move || {
            while let Some(word) = open.pop() {
                match word.kind() {
                    DecodedWord::Empty => {}
                    DecodedWord::Leaf { first, n } => return Some((first, n)),
                    DecodedWord::Node(kind, line) => {
                        open.extend(super::node_words(&self.lines, kind, line).iter().rev())
                    }
                }
            }
            None
        })
    }

    /// Gives each leaf another first part, in the order of a traversal.
    pub(crate) fn rename_leaves(&mut self, mut name: impl FnMut(usize) -> usize) {
        let mut open = vec![(self.root, None)];
        while let Some((word, slot)) = open.pop() {
            match word.kind() {
                DecodedWord::Empty => {}
                DecodedWord::Leaf { first, n } => {
                    let renamed = ChildWord::leaf(name(first as usize), n as usize);
                    match slot {
                        None => self.root = renamed,
                        Some((kind, line, i)) => super::set_word(&mut self.lines, kind, line, i, renamed),
                    }
                }
                DecodedWord::Node(kind, line) => {
                    let words = super::node_words(&self.lines, kind, line).iter().enumerate().rev();
                    open.extend(words.map(|(i, &word)| (word, Some((kind, line as usize, i)))));
                }
            }
        }
    }
}
