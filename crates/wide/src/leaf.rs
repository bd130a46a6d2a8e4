//! What the leaves of a BVH hold, in the form that traversal uses.

use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, ScaledRay, Side};

use crate::layout::NodeKind;
use crate::simd::Simd;

/// What a [`WideBvh`](crate::WideBvh) is over: [`Triangle`](crate::Triangle)s, stored in SIMD blocks, or any
/// [`Primitive`](crate::Primitive).
///
/// Implement [`Primitive`](crate::Primitive) for your own shapes; this trait then follows and cannot be implemented directly.
pub trait LeafPrimitive: Send + Sync + Sized {
    /// Storage of all leaves.
    #[doc(hidden)]
    type Leaves: Send + Sync;
    /// All leaves as one traversal sees them.
    #[doc(hidden)]
    type View<'a>: Copy
    where
        Self: 'a;
    /// What a [`HitSink`] is shown of the primitive that was hit.
    #[doc(hidden)]
    type Shape;
    /// A ray prepared for leaves.
    #[doc(hidden)]
    type Prepared<S: Simd>;

    /// How far hits may lie from their primitive, relative to `|o|∞ + ρ∞`; see [`Primitive::ERROR`](crate::Primitive::ERROR).
    #[doc(hidden)]
    const ERROR: f32;

    /// Whether that holds relative to every point of the space; see [`Primitive::IS_LOCAL`](crate::Primitive::IS_LOCAL).
    #[doc(hidden)]
    const IS_LOCAL: bool;

    #[doc(hidden)]
    fn view(leaves: &Self::Leaves) -> Self::View<'_>;

    #[doc(hidden)]
    fn prepare<S: Simd>(simd: S, ray: &ScaledRay) -> Self::Prepared<S>;

    /// Passes all hits of a leaf with `t <= t_max` to `sink`. Returns what `sink` returned last, or `t_max`.
    #[doc(hidden)]
    fn intersect_leaf<S: Simd, T: HitSink<Self::Shape>>(
        leaves: Self::View<'_>,
        simd: S,
        prepared: &Self::Prepared<S>,
        ray: &ScaledRay,
        leaf: LeafRange,
        sink: &mut T,
    ) -> f32;

    /// The primitives of a leaf.
    #[doc(hidden)]
    fn ids(leaves: &Self::Leaves, leaf: LeafRange) -> impl Iterator<Item = PrimId>;

    /// Calls `visit` with each primitive of a leaf and its shape.
    #[doc(hidden)]
    fn for_each_shape(leaves: &Self::Leaves, leaf: LeafRange, visit: impl FnMut(PrimId, &Self::Shape));

    #[doc(hidden)]
    fn leaf_data(leaves: &Self::Leaves) -> LeafData<'_>;
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

/// Decides what becomes of hits on a shape.
pub trait HitSink<M: ?Sized> {
    /// Whether nearer subtrees must be visited first.
    const ORDERED: bool;

    /// Whether every hit is accepted and the first one ends the traversal.
    const ANY: bool = false;

    /// Whether hits that are certainly inside of their shape go to [`HitSink::take_inside`].
    const SPLITS: bool = false;

    /// Takes a hit that is on no edge of its shape, where [`HitSink::SPLITS`]. Returns the new `t_max`.
    #[inline(always)]
    fn take_inside(&mut self, _: Hit, _: f32) -> f32 {
        unreachable!("the sink takes all hits alike")
    }

    /// Takes a hit that is certain but not computed, where [`HitSink::ANY`]. Returns a negative number.
    #[inline(always)]
    fn take_any(&mut self) -> f32 {
        unreachable!("the sink needs hits")
    }

    /// Takes a hit with `t_min <= t <= t_max`, all scaled. Returns the new `t_max`; a negative one ends the traversal.
    fn take(&mut self, ray: &ScaledRay, hit: Hit, shape: &M, t_max: f32) -> f32;

    /// `n` primitives are about to be tested.
    fn primitives(&mut self, n: u32);

    /// A node of this kind is about to be tested.
    fn node(&mut self, kind: NodeKind);
}

/// A hit in a BVH without instances.
#[inline(always)]
pub(crate) fn hit(t: f32, [u, v]: [f32; 2], side: Side, primitive: PrimId) -> Hit {
    Hit { t, u, v, primitive, instance: InstanceId(0), side }
}
