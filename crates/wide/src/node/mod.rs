//! The records that rays traverse, and the words that name them.
//!
//! ```text
//! aligned node    lower, upper x, y, z in the mesh frame (6 x 8), 8 child words, unused (8)        256 bytes
//! oriented node   for each of 3 axes its x, y, z, center, half-extent (15 x 8), 8 child words      512 bytes
//! triangles       v0, v1, v2 (9 x 8), 8 ids; or four of each                                  320, 160 bytes
//! ```
//!
//! Two leaves of at most two triangles share four lanes: thin ribbons make leaves of one quad each.
//!
//! Every record is a structure of arrays with eight lanes. Empty slots hold boxes that no ray enters, of finite numbers: no
//! box holds NaN or infinity.

pub(crate) mod checked;
mod flaw;
mod links;
mod mapped;
mod packed;
mod pod;
mod records;
mod rows;
mod units;

use std::ops::Range;

pub use flaw::Flaw;
pub(crate) use links::{Change, Content, Link, Links, NO_NODE};
pub(crate) use mapped::Map;
pub(crate) use records::Records;
pub use rows::NodeBox;
pub(crate) use rows::{NOWHERE, Row, node_words, rows, set_word, write_box, write_boxes, write_intervals, write_slabs};
pub(crate) use units::{HALF_BLOCK_WORDS, HalfBlock, LaneWords, LeafLayout, PART_LANES, PARTS};

/// A cache line of two eight-lane rows; nodes start on one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(64))]
pub(crate) struct CacheLine(pub(crate) [u32; 16]);

/// Lines of an aligned node.
pub(crate) const ALIGNED_LINES: usize = 4;
/// Lines of an oriented node.
pub(crate) const ORIENTED_LINES: usize = 8;

/// Most primitives of a leaf.
pub(crate) const MAX_LEAF: usize = 32;

/// Kinds of nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NodeKind {
    /// Eight boxes aligned with one frame, that of the mesh.
    Aligned,
    /// Eight oriented boxes, each with its own frame.
    Oriented,
}

impl NodeKind {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::Aligned, Self::Oriented];

    /// Cache lines of a node.
    pub(crate) fn n_lines(self) -> usize {
        match self {
            Self::Aligned => ALIGNED_LINES,
            Self::Oriented => ORIENTED_LINES,
        }
    }
}

/// A child reference.
///
/// Leaf: bit 31 set, bits 26 to 30 the number of primitives less one, the rest the position of the first. Node: bits 29 and 30
/// the kind, the rest the first line. Positions are counted in parts of the units that leaves are made of ([`LeafLayout`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub(crate) struct ChildWord(pub(crate) u32);

/// A decoded child reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DecodedWord {
    /// Primitives of a leaf.
    Leaf { first: u32, n: u32 },
    /// A node and its first line.
    Node(NodeKind, u32),
    /// No child.
    Empty,
}

impl ChildWord {
    const LEAF: u32 = 1 << 31;
    /// Positions of leaves.
    pub(crate) const MAX_FIRST: usize = 1 << 26;
    /// Lines of nodes.
    pub(crate) const MAX_LINE: usize = 1 << 29;

    /// An unused slot; no ray enters its box.
    pub(crate) const EMPTY: Self = Self(u32::MAX >> 1);

    /// A leaf of `n` primitives.
    pub(crate) fn leaf(first: usize, n: usize) -> Self {
        assert!(first < Self::MAX_FIRST && (1..=MAX_LEAF).contains(&n), "the builder checks the limits");
        Self(Self::LEAF | (n as u32 - 1) << 26 | first as u32)
    }

    /// A node.
    pub(crate) fn node(kind: NodeKind, line: usize) -> Self {
        assert!(line < Self::MAX_LINE, "the builder checks the limits");
        Self((kind as u32) << 29 | line as u32)
    }

    /// Decodes the word.
    #[inline(always)]
    pub(crate) fn kind(self) -> DecodedWord {
        if self.0 & Self::LEAF != 0 {
            return DecodedWord::Leaf { first: self.0 & 0x03ff_ffff, n: (self.0 >> 26 & 31) + 1 };
        }
        let line = self.0 & 0x1fff_ffff;
        match self.0 >> 29 {
            0 => DecodedWord::Node(NodeKind::Aligned, line),
            1 => DecodedWord::Node(NodeKind::Oriented, line),
            _ => DecodedWord::Empty,
        }
    }
}

/// Most primitives of a BVH over [`Primitive`](crate::Primitive)s.
pub const MAX_PRIMITIVES: usize = Limits::OF_WORDS.n_parts;

/// Most triangles of a BVH, where all blocks are full; one with many nodes, or blocks that are not full, may hold fewer.
pub const MAX_TRIANGLES: usize = Limits::OF_WORDS.n_triangles();

/// How much the words of a BVH can name; tests use smaller limits, which they can reach.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Positions of leaves.
    pub(crate) n_parts: usize,
    /// Lines of nodes.
    pub(crate) n_lines: usize,
}

impl Limits {
    pub(crate) const OF_WORDS: Self = Self { n_parts: ChildWord::MAX_FIRST, n_lines: ChildWord::MAX_LINE };

    /// Most triangles: all lanes of all parts.
    pub(crate) const fn n_triangles(self) -> usize {
        PART_LANES * self.n_parts
    }
}

/// Most primitives of a piece that is a subtree.
pub(crate) const MAX_SUBTREE: usize = 1 << 12;

/// A subtree, or a single node above all subtrees.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SubtreeSlots {
    pub(crate) root: ChildWord,
    pub(crate) lines: Range<usize>,
    pub(crate) units: Range<usize>,
    /// Whether this is a single node above subtrees.
    pub(crate) is_above: bool,
}

/// All nodes of a BVH.
#[derive(Clone, Debug)]
pub(crate) struct Nodes {
    pub(crate) lines: Records<CacheLine>,
    pub(crate) root: ChildWord,
    /// Greatest number of nodes from the root to a leaf.
    pub(crate) depth: u32,
    /// Whether any node is oriented; rays pass by oriented nodes of a BVH that says it has none.
    pub(crate) has_oriented: bool,
    /// Parts of nodes and leaves that threads can change on their own.
    pub(crate) pieces: Vec<SubtreeSlots>,
    /// What changes of single primitives need; from the first one on, until all boxes change.
    pub(crate) links: Option<Box<Links>>,
}

impl Nodes {
    /// Entries of memory that a traversal needs for subtrees that wait: up to seven siblings on each level, and one more subtree on top.
    #[inline]
    pub(crate) fn stack_len(&self) -> usize {
        7 * self.depth as usize + 8
    }

    pub(crate) fn n_bytes(&self) -> usize {
        size_of_val(&self.lines[..]) + self.links.as_ref().map_or(0, |links| links.n_bytes())
    }

    /// In the order of [`NodeKind::ALL`].
    pub(crate) fn n_of_each_kind(&self) -> [usize; 2] {
        let mut n = [0; 2];
        self.each_word(|word| {
            if let DecodedWord::Node(kind, _) = word {
                n[kind as usize] += 1;
            }
        });
        n
    }

    /// Calls `visit` with every word, depth first.
    pub(crate) fn each_word(&self, mut visit: impl FnMut(DecodedWord)) {
        let mut open = vec![self.root];
        while let Some(word) = open.pop() {
            let word = word.kind();
            visit(word);
            if let DecodedWord::Node(kind, line) = word {
                open.extend_from_slice(node_words(&self.lines, kind, line));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_decode_to_what_was_encoded() {
        for (first, n) in [(0u32, 1u32), (7, 32), (0x03ff_ffff, 5)] {
            assert_eq!(ChildWord::leaf(first as usize, n as usize).kind(), DecodedWord::Leaf { first, n });
        }
        for kind in NodeKind::ALL {
            for line in [0u32, 1, 0x1fff_ffff] {
                assert_eq!(ChildWord::node(kind, line as usize).kind(), DecodedWord::Node(kind, line));
            }
        }
        assert_eq!(ChildWord::EMPTY.kind(), DecodedWord::Empty);
    }

    #[test]
    fn records_have_the_documented_sizes() {
        assert_eq!(NodeKind::ALL.map(|kind| kind.n_lines() * size_of::<CacheLine>()), [256, 512]);
        assert_eq!(size_of::<HalfBlock>(), 160);
    }
}
