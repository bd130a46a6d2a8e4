//! Primitives of the caller as leaves hold them.

use canted_obb::PrimId;

use crate::leaf::{LeafData, LeafPrimitive, LeafRange};
use crate::primitive::Primitive;

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
    type Shape = P;

    #[inline]
    fn for_each_shape(leaves: &Shapes<P>, leaf: LeafRange, mut visit: impl FnMut(PrimId, &P)) {
        let ids = &leaves.order[leaf.first as usize..(leaf.first + leaf.n) as usize];
        ids.iter().for_each(|&id| visit(id, &leaves.primitives[id.index()]));
    }

    fn leaf_data(leaves: &Shapes<P>) -> LeafData<'_> {
        let n_bytes = size_of_val(&leaves.order[..]) + size_of_val(&leaves.primitives[..]);
        LeafData { blocks: &[], order: &leaves.order, n_bytes }
    }
}
