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

use bytemuck::{Pod, Zeroable};

use crate::pieces::Piece;
use crate::records::Records;

/// A cache line of two eight-lane rows; nodes start on one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Line(pub(crate) [u32; 16]);

/// Half of a block of triangles: four of them, or one half of eight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(32))]
pub(crate) struct Half(pub(crate) [u32; HALF_WORDS]);

/// Parts of a half-block that words can name: lanes 0 and 1, lanes 2 and 3.
pub(crate) const PARTS: usize = 2;

/// Lanes of a part, and most triangles of a leaf that shares its half-block.
pub(crate) const PART_LANES: usize = 2;

/// Words of four triangles: nine coordinates and an id each.
pub(crate) const HALF_WORDS: usize = 40;

/// Lines of an aligned node.
pub(crate) const ALIGNED_LINES: usize = 4;
/// Lines of an oriented node.
pub(crate) const ORIENTED_LINES: usize = 8;

/// Most primitives of a leaf.
pub(crate) const MAX_LEAF: usize = 32;

/// The lower planes of an empty slot, beyond all supported coordinates; its upper planes are the negative.
pub(crate) const NOWHERE: f32 = 9.223_372e18;

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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Word(pub(crate) u32);

/// A decoded child reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WordKind {
    /// Primitives of a leaf.
    Leaf { first: u32, n: u32 },
    /// A node and its first line.
    Node(NodeKind, u32),
    /// No child.
    Empty,
}

impl Word {
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
    pub(crate) fn kind(self) -> WordKind {
        if self.0 & Self::LEAF != 0 {
            return WordKind::Leaf { first: self.0 & 0x03ff_ffff, n: (self.0 >> 26 & 31) + 1 };
        }
        let line = self.0 & 0x1fff_ffff;
        match self.0 >> 29 {
            0 => WordKind::Node(NodeKind::Aligned, line),
            1 => WordKind::Node(NodeKind::Oriented, line),
            _ => WordKind::Empty,
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
    pub(crate) const OF_WORDS: Self = Self { n_parts: Word::MAX_FIRST, n_lines: Word::MAX_LINE };

    /// Most triangles: all lanes of all parts.
    pub(crate) const fn n_triangles(self) -> usize {
        PART_LANES * self.n_parts
    }
}

/// How leaves are made of units: half-blocks of triangles, or ids of primitives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafLayout {
    /// Parts of a unit that words can name.
    pub(crate) n_parts: usize,
    /// Most primitives of a leaf that takes one part only; 0 where units have no parts.
    pub(crate) in_part: usize,
    /// Primitives of a unit.
    pub(crate) in_unit: usize,
    /// What messages call a part.
    pub(crate) part_name: &'static str,
}

impl LeafLayout {
    /// Half-blocks of triangles.
    pub(crate) const BLOCKS: Self =
        Self { n_parts: PARTS, in_part: PART_LANES, in_unit: 4, part_name: "part of a block" };
    /// Ids of primitives.
    pub(crate) const IDS: Self = Self { n_parts: 1, in_part: 0, in_unit: 1, part_name: "position" };

    /// Units that hold `n` primitives.
    pub(crate) fn n_units(&self, n: usize) -> usize {
        n.div_ceil(self.in_unit)
    }

    /// Parts that a leaf of `n` primitives takes.
    pub(crate) fn n_parts_of(&self, n: usize) -> usize {
        if n <= self.in_part { 1 } else { self.n_parts * self.n_units(n) }
    }
}

/// The words of a triangle: the first one, and the distance to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Lane {
    pub(crate) first: usize,
    pub(crate) step: usize,
}

impl Lane {
    /// Rows of vertices; then follows that of ids.
    pub(crate) const ID_ROW: usize = 9;

    /// Of triangle `i` in a leaf of `n`, relative to its first half-block; the leaf starts in this part of a half-block: blocks of eight precede a last block of four.
    pub(crate) fn of(i: usize, n: usize, part: usize) -> Self {
        if i / 8 * 8 + 4 >= n {
            Self { first: i / 4 * HALF_WORDS + part * PART_LANES + i % 4, step: 4 }
        } else {
            Self { first: i / 8 * 2 * HALF_WORDS + i % 8, step: 8 }
        }
    }

    /// The word of a row: nine coordinates, then the id.
    pub(crate) fn word(self, row: usize) -> usize {
        self.first + row * self.step
    }
}

/// All nodes of a BVH.
#[derive(Clone, Debug)]
pub(crate) struct Nodes {
    pub(crate) lines: Records<Line>,
    pub(crate) root: Word,
    /// Greatest number of nodes from the root to a leaf.
    pub(crate) depth: u32,
    /// Whether any node is oriented.
    pub(crate) has_oriented: bool,
    /// Parts of nodes and leaves that threads can change on their own.
    pub(crate) pieces: Vec<Piece>,
}

impl Nodes {
    /// Entries of memory that a traversal needs for subtrees that wait: up to seven siblings on each level, and one more subtree on top.
    #[inline]
    pub(crate) fn stack_len(&self) -> usize {
        7 * self.depth as usize + 8
    }

    pub(crate) fn n_bytes(&self) -> usize {
        size_of_val(&self.lines[..])
    }

    /// In the order of [`NodeKind::ALL`].
    pub(crate) fn n_of_each_kind(&self) -> [usize; 2] {
        let mut n = [0; 2];
        self.each_word(|word| {
            if let WordKind::Node(kind, _) = word {
                n[kind as usize] += 1;
            }
        });
        n
    }

    /// Calls `visit` with every word, depth first.
    pub(crate) fn each_word(&self, mut visit: impl FnMut(WordKind)) {
        let mut open = vec![self.root];
        while let Some(word) = open.pop() {
            let word = word.kind();
            visit(word);
            if let WordKind::Node(kind, line) = word {
                open.extend_from_slice(node_words(&self.lines, kind, line));
            }
        }
    }
}

/// Eight lanes of a record.
pub(crate) type Row = [f32; 8];

/// The rows of a node's lines.
#[inline(always)]
pub(crate) fn rows<const LINES: usize, const ROWS: usize>(lines: &[Line], first: u32) -> &[Row; ROWS] {
    const { assert!(LINES * 2 == ROWS) };
    let first = first as usize;
    let lines: &[Line; LINES] = lines[first..first + LINES].try_into().expect("the length is that of the range");
    bytemuck::cast_ref::<[Line; LINES], [Row; ROWS]>(lines)
}

/// The child words of a node.
pub(crate) fn node_words(lines: &[Line], kind: NodeKind, line: u32) -> &[Word; 8] {
    match kind {
        NodeKind::Aligned => bytemuck::cast_ref(&rows::<ALIGNED_LINES, 8>(lines, line)[6]),
        NodeKind::Oriented => bytemuck::cast_ref(&rows::<ORIENTED_LINES, 16>(lines, line)[15]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_decode_to_what_was_encoded() {
        for (first, n) in [(0u32, 1u32), (7, 32), (0x03ff_ffff, 5)] {
            assert_eq!(Word::leaf(first as usize, n as usize).kind(), WordKind::Leaf { first, n });
        }
        for kind in NodeKind::ALL {
            for line in [0u32, 1, 0x1fff_ffff] {
                assert_eq!(Word::node(kind, line as usize).kind(), WordKind::Node(kind, line));
            }
        }
        assert_eq!(Word::EMPTY.kind(), WordKind::Empty);
    }

    #[test]
    fn records_have_the_documented_sizes() {
        assert_eq!(NodeKind::ALL.map(|kind| kind.n_lines() * size_of::<Line>()), [256, 512]);
        assert_eq!(size_of::<Half>(), 160);
    }
}
