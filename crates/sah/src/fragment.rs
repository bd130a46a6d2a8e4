use canted_obb::{Aabb, PrimId};

/// The part of a primitive inside a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fragment {
    pub(crate) primitive: PrimId,
    pub(crate) aabb: Aabb,
}

/// The box around all.
pub(crate) fn around(fragments: &[Fragment]) -> Aabb {
    fragments.iter().fold(Aabb::EMPTY, |all, fragment| all.union(fragment.aabb))
}
