//! Primitives of the caller as leaves hold them.

use canted_obb::PrimId;
use canted_trace::ScaledRay;

use crate::leaf::{HitSink, LeafData, LeafPrimitive, LeafRange, hit};
use crate::primitive::Primitive;
use crate::simd::Simd;

/// Leaves of a BVH over primitives of the caller.
#[derive(Clone, Debug)]
pub struct Shapes<P> {
    /// Primitives by position in the leaves.
    pub(crate) order: Vec<PrimId>,
    /// In input order.
    pub(crate) primitives: Vec<P>,
}

impl<P: Primitive> LeafPrimitive for P {
    type Leaves = Shapes<P>;
    type View<'a>
        = &'a Shapes<P>
    where
        P: 'a;
    type Shape = P;
    type Prepared<S: Simd> = ();

    const ERROR: f32 = {
        assert!(P::ERROR >= 0.0 && P::ERROR <= 0.125, "the proof of the pads holds for errors of at most 1/8");
        P::ERROR
    };
    const IS_LOCAL: bool = P::IS_LOCAL;

    #[inline(always)]
    fn view(leaves: &Shapes<P>) -> &Shapes<P> {
        leaves
    }

    #[inline(always)]
    fn prepare<S: Simd>(_: S, _: &ScaledRay) {}

    #[inline(always)]
    fn intersect_leaf<S: Simd, T: HitSink<P>>(
        leaves: &Shapes<P>,
        _: S,
        (): &(),
        ray: &ScaledRay,
        leaf: LeafRange,
        sink: &mut T,
    ) -> f32 {
        let mut t_max = leaf.t_max;
        for id in Self::ids(leaves, leaf) {
            t_max = intersect(&leaves.primitives[id.index()], id, *ray, t_max, sink);
            if t_max < 0.0 {
                break;
            }
        }
        t_max
    }

    #[inline(always)]
    fn ids(leaves: &Shapes<P>, leaf: LeafRange) -> impl Iterator<Item = PrimId> {
        leaves.order[leaf.first as usize..(leaf.first + leaf.n) as usize].iter().copied()
    }

    #[inline]
    fn for_each_shape(leaves: &Shapes<P>, leaf: LeafRange, mut visit: impl FnMut(PrimId, &P)) {
        Self::ids(leaves, leaf).for_each(|id| visit(id, &leaves.primitives[id.index()]));
    }

    fn leaf_data(leaves: &Shapes<P>) -> LeafData<'_> {
        let n_bytes = size_of_val(&leaves.order[..]) + size_of_val(&leaves.primitives[..]);
        LeafData { blocks: &[], order: &leaves.order, n_bytes }
    }
}

/// Passes on the hits on one primitive, one after another: the first may be rejected.
#[inline(always)]
fn intersect<P: Primitive, T: HitSink<P>>(
    primitive: &P,
    id: PrimId,
    mut ray: ScaledRay,
    mut t_max: f32,
    sink: &mut T,
) -> f32 {
    while let Some(found) = primitive.intersect(&ray, t_max) {
        // A primitive that breaks its contract must not keep the traversal from ending.
        if !(ray.t_min <= found.t && found.t <= t_max && found.t.is_finite()) {
            break;
        }
        t_max = sink.take(&ray, hit(found.t, [found.u, found.v], found.side, id), primitive, t_max);
        ray.t_min = found.t.next_up();
        if ray.t_min > t_max {
            break;
        }
    }
    t_max
}
