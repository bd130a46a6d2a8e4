//! What the leaves of a BVH hold, in the form that traversal uses.

mod primitive;
mod shapes;
mod triangles;

use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Side};

pub(crate) use primitive::Shapes;
pub use primitive::{Primitive, PrimitiveHit, SavedPrimitive};
pub(crate) use shapes::extents_within;
pub use shapes::{bounds_of_points, extent_of_box, extent_of_points};
pub(crate) use triangles::{Blocks, StoredTriangles, unused_lanes_are_zero};
pub use triangles::{Triangle, TriangleBvh};

/// What a [`WideBvh`](crate::WideBvh) is over: [`Triangle`](crate::Triangle)s, stored in SIMD blocks, or any
/// [`Primitive`](crate::Primitive).
///
/// Implement [`Primitive`](crate::Primitive) for your own shapes; this trait then follows and cannot be implemented directly.
pub trait LeafPrimitive: Send + Sync + Sized {
    /// Storage of all leaves.
    #[doc(hidden)]
    type Leaves: Send + Sync;
    /// What a distance is measured to.
    #[doc(hidden)]
    type Shape;

    /// Calls `visit` with each primitive of a leaf and its shape.
    #[doc(hidden)]
    fn for_each_shape(leaves: &Self::Leaves, leaf: LeafRange, visit: impl FnMut(PrimId, &Self::Shape));

    #[doc(hidden)]
    fn leaf_data(leaves: &Self::Leaves) -> LeafData<'_>;
}

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

/// A leaf, and how far the ray still goes.
#[derive(Clone, Copy, Debug)]
pub struct LeafRange {
    pub(crate) first: u32,
    pub(crate) n: u32,
    pub(crate) t_max: f32,
}

impl LeafRange {
    /// A leaf outside of a traversal by rays.
    pub(crate) fn new(first: u32, n: u32) -> Self {
        Self { first, n, t_max: f32::INFINITY }
    }
}

/// All leaves as words.
#[derive(Clone, Copy, Debug)]
pub struct LeafData<'a> {
    /// Triangle blocks; empty for other primitives.
    pub(crate) blocks: &'a [u32],
    /// Primitives by position in the leaves; empty for triangles, whose blocks hold their ids.
    pub(crate) order: &'a [PrimId],
    pub(crate) n_bytes: usize,
}

/// A hit in a BVH without instances.
#[inline(always)]
pub(crate) fn hit(t: f32, [u, v]: [f32; 2], side: Side, primitive: PrimId) -> Hit {
    Hit { t, u, v, primitive, instance: InstanceId(0), side }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_have_the_documented_sizes() {
        assert_eq!(size_of::<HalfBlock>(), 160);
    }
}
