//! What the leaves of a BVH hold, in the form that traversal uses.

mod closed;
mod extents;
mod moving;
mod patches;
mod primitive;
mod quadrics;
mod ribbons;
mod shapes;
mod triangles;

use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Side};

pub(crate) use closed::Closed;
pub use extents::{bounds_of_points, extent_of_box, extent_of_points};
pub use moving::{Moves, Moving};
pub(crate) use primitive::{Placed, Primitives, Shapes, extents_within, is_filtered};
pub use primitive::{Primitive, PrimitiveHit, SavedPrimitive};
pub use triangles::Triangle;
pub(crate) use triangles::{Blocks, StoredTriangles, each_near, unused_lanes_are_zero};

use crate::traverse::LeafRange;

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

    /// Calls `visit` with the primitive at a place of a leaf and its shape.
    #[doc(hidden)]
    fn with_shape<R>(
        leaves: &Self::Leaves,
        leaf: LeafRange,
        place: u32,
        visit: impl FnOnce(PrimId, &Self::Shape) -> R,
    ) -> R;

    #[doc(hidden)]
    fn leaf_data(leaves: &Self::Leaves) -> LeafData<'_>;
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
