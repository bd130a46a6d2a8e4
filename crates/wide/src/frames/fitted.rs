//! What frames are fitted to.

use canted_obb::Moments;
use glam::Vec3A;

/// A primitive, scaled so that the largest extent of the scene is about one.
pub(crate) trait Fitted: Send + Sync + Sized {
    /// Weight, mean and scatter, for principal axes.
    fn moments(&self) -> Moments;

    /// A frame of its own that may have a smaller box than `most`, half of a surface area; `None` where none has.
    fn own_frame(&self, most: f32) -> Option<[Vec3A; 3]>;

    /// Other frames of its own, worth trying for the few primitives around the largest one.
    fn other_frames(&self) -> impl Iterator<Item = [Vec3A; 3]>;

    /// Extents of every `stride`-th of some primitives along `N` rows; zeros for none.
    fn extents<const N: usize>(items: &[Self], stride: usize, rows: &[Vec3A; N]) -> [f32; N];
}

/// Half of the surface area of a box with these sides.
#[inline]
pub(super) fn half_area([x, y, z]: [f32; 3]) -> f32 {
    (x + z) * y + z * x
}
