//! The records that rays walk through, and the words that point to them.
//!
//! ```text
//! box node     lo, hi of x, y, z in the mesh's frame (6 x 8), 8 child words                     256 bytes
//! lean node    9 components of rows, 3 centres, 3 half-extents (15 x 8), 8 child words          512 bytes
//! triangles    v0, v1, v2 (9 x 8), 8 numbers; or four of each                                   320, 160 bytes
//! ```
//!
//! Two leaves of at most two triangles share four lanes: thin ribbons make leaves of one quad each.
//!
//! Everything is little tables of eight lanes, structure of arrays. Empty slots hold boxes that no ray enters, by
//! finite numbers: no box holds NaN or infinity.

use bytemuck::{Pod, Zeroable};

/// A cache line of eight-lane rows; nodes start on one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Line(pub(crate) [u32; 16]);

/// Half a block of triangles: four of them, or one half of eight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(32))]
pub(crate) struct Half(pub(crate) [u32; HALF_WORDS]);

/// Parts of a half-block that words can name: lanes 0 and 1, lanes 2 and 3.
pub(crate) const PARTS: usize = 2;

/// Lanes of a part, and most triangles of a leaf that shares its half-block.
pub(crate) const PART_LANES: usize = 2;

/// Words of four triangles: nine coordinates and the primitive each.
pub(crate) const HALF_WORDS: usize = 40;

/// Lines of each node.
pub(crate) const BOX_LINES: usize = 4;
/// Lines of a node with a frame for each child.
pub(crate) const LEAN_LINES: usize = 8;

/// Most triangles of a leaf.
pub(crate) const MAX_LEAF: usize = 32;

/// Coordinates beyond those that are promised: an empty slot's lower planes; the upper ones are its negative.
pub(crate) const NOWHERE: f32 = 9.223_372e18;

/// Kinds of nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NodeKind {
    /// Boxes along the axes of the mesh's frame.
    Aligned,
    /// A frame for each child.
    Oriented,
}

impl NodeKind {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::Aligned, Self::Oriented];

    /// Cache lines of a node.
    pub(crate) fn n_lines(self) -> usize {
        match self {
            Self::Aligned => BOX_LINES,
            Self::Oriented => LEAN_LINES,
        }
    }
}

/// A child reference: bit 31 a leaf.
///
/// Leaf: bits 26 to 30 its number of primitives less one, the rest the place of its first. Node: bits 29 and 30 its
/// kind, the rest its first line. Places of triangles are counted in parts of half-blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Word(pub(crate) u32);

/// A child reference, opened.
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
    /// Places of leaves.
    pub(crate) const MAX_FIRST: usize = 1 << 26;
    /// Lines of nodes.
    pub(crate) const MAX_LINE: usize = 1 << 29;

    /// An unused slot; no ray enters its box.
    pub(crate) const EMPTY: Self = Self(u32::MAX >> 1);

    /// A leaf of `n` primitives, of which the first is at `first`.
    #[expect(clippy::cast_possible_truncation, reason = "asserted to be small")]
    pub(crate) fn leaf(first: usize, n: usize) -> Self {
        assert!(first < Self::MAX_FIRST && (1..=MAX_LEAF).contains(&n), "the builder checks the limits");
        Self(Self::LEAF | (n as u32 - 1) << 26 | first as u32)
    }

    /// A node.
    #[expect(clippy::cast_possible_truncation, reason = "asserted to be small")]
    pub(crate) fn node(kind: NodeKind, line: usize) -> Self {
        assert!(line < Self::MAX_LINE, "the builder checks the limits");
        Self((kind as u32) << 29 | line as u32)
    }

    /// What the word says.
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

/// Most primitives of the caller's, or boxes, of a tree.
pub const MAX_PRIMITIVES: usize = Limits::OF_WORDS.n_parts;

/// Most triangles of a tree, where all blocks are full; one whose blocks are not, or that has too many nodes, may hold fewer.
pub const MAX_TRIANGLES: usize = Limits::OF_WORDS.n_triangles();

/// How much the words of a tree can name: of tests less, for nobody builds what does not fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Parts of what leaves hold: of half-blocks, or whole numbers.
    pub(crate) n_parts: usize,
    /// Lines of nodes.
    pub(crate) n_lines: usize,
}

impl Limits {
    pub(crate) const OF_WORDS: Self = Self { n_parts: Word::MAX_FIRST, n_lines: Word::MAX_LINE };

    /// Most triangles, all lanes of all parts.
    pub(crate) const fn n_triangles(self) -> usize {
        PART_LANES * self.n_parts
    }
}

/// Eight lanes of a record.
pub(crate) type Row = [f32; 8];

/// The rows of a node's lines.
#[inline(always)]
pub(crate) fn rows<const LINES: usize, const ROWS: usize>(lines: &[Line], first: u32) -> &[Row; ROWS] {
    const { assert!(LINES * 2 == ROWS) };
    let first = first as usize;
    let lines: &[Line; LINES] = lines[first..first + LINES].try_into().expect("as long as asked for");
    bytemuck::cast_ref::<[Line; LINES], [Row; ROWS]>(lines)
}

/// The child words of a node.
pub(crate) fn node_words(lines: &[Line], kind: NodeKind, line: u32) -> &[Word; 8] {
    match kind {
        NodeKind::Aligned => bytemuck::cast_ref(&rows::<BOX_LINES, 8>(lines, line)[6]),
        NodeKind::Oriented => bytemuck::cast_ref(&rows::<LEAN_LINES, 16>(lines, line)[15]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_say_what_they_were_made_of() {
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
    fn records_are_as_long_as_the_table_says() {
        assert_eq!(NodeKind::ALL.map(|kind| kind.n_lines() * size_of::<Line>()), [256, 512]);
        assert_eq!(size_of::<Half>(), 160);
    }
}
