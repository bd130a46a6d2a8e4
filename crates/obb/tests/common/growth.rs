//! What a merge may add to a child, and what it must keep.

use canted_obb::Obb;

use super::exact::{self, ExactBox};

#[track_caller]
pub(crate) fn assert_contains(name: &str, parent: &Obb, children: &[Obb]) {
    let oracle = ExactBox::of(parent);
    for child in children {
        assert!(exact::corners(child).iter().all(|corner| oracle.contains(corner)), "{name}: {child:?} in {parent:?}");
    }
}

/// `f32` roundings of a frame's columns, and of a half-extent, that a merge may add: the frame is rounded in the child
/// and in the parent, by half a unit in the last place of each of three entries, and rotations the box's diagonal.
pub(crate) const REFRAMED: f64 = 2.0 * 3.0 * 1.733 * 0.5 * f32::EPSILON as f64;

/// How far the half-extents of `parent`, in any order, exceed those of `child`, over its greatest.
pub(crate) fn growth(parent: &Obb, child: &Obb) -> f64 {
    let sorted = |obb: &Obb| {
        let mut half = obb.half_extents;
        half.sort_by(f32::total_cmp);
        half.map(f64::from)
    };
    let (grown, original) = (sorted(parent), sorted(child));
    (0..3).map(|k| grown[k] - original[k]).fold(0.0, f64::max) / original[2]
}
