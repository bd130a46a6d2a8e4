//! What leaves are made of: half-blocks of triangles, or ids of primitives, as words name them.

/// Half of a block of triangles: four of them, or one half of eight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(32))]
pub(crate) struct HalfBlock(pub(crate) [u32; HALF_BLOCK_WORDS]);

/// Parts of a half-block that words can name: lanes 0 and 1, lanes 2 and 3.
pub(crate) const PARTS: usize = 2;

/// Lanes of a part, and most triangles of a leaf that shares its half-block.
pub(crate) const PART_LANES: usize = 2;

/// Words of four triangles: nine coordinates and an id each.
pub(crate) const HALF_BLOCK_WORDS: usize = 40;

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
pub(crate) struct LaneWords {
    pub(crate) first: usize,
    pub(crate) step: usize,
}

impl LaneWords {
    /// Rows of vertices; then follows that of ids.
    pub(crate) const ID_ROW: usize = 9;

    /// Of triangle `i` in a leaf of `n`, relative to its first half-block; the leaf starts in this part of a half-block: blocks of eight precede a last block of four.
    pub(crate) fn of(i: usize, n: usize, part: usize) -> Self {
        if i / 8 * 8 + 4 >= n {
            Self { first: i / 4 * HALF_BLOCK_WORDS + part * PART_LANES + i % 4, step: 4 }
        } else {
            Self { first: i / 8 * 2 * HALF_BLOCK_WORDS + i % 8, step: 8 }
        }
    }

    /// The word of a row: nine coordinates, then the id.
    pub(crate) fn word(self, row: usize) -> usize {
        self.first + row * self.step
    }
}
