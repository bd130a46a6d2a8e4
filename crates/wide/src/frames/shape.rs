//! Primitives of the caller: extents and principal axes as they report them.

use canted_obb::{Moments, eigen};
use glam::Vec3A;

use super::fitted::Fitted;
use super::vector::to_glam;
use crate::item::Placed;
use crate::primitive::{Primitive, extents_within};

/// A primitive and the scale of the scene.
#[derive(Debug)]
pub(crate) struct ScaledShape<'a, P> {
    pub(crate) placed: Placed<'a, P>,
    pub(crate) scale: f32,
}

impl<P: Primitive> Fitted for ScaledShape<'_, P> {
    /// Moments that are not finite or have a negative weight count as none.
    fn moments(&self) -> Moments {
        let moments = self.placed.primitive.moments();
        let mut numbers = moments.mean.iter().chain(&moments.scatter).chain([&moments.weight]);
        if numbers.all(|x| x.is_finite()) && moments.weight >= 0.0 { moments } else { Moments::EMPTY }
    }

    fn own_frame(&self, _: f32) -> Option<[Vec3A; 3]> {
        let rows = to_glam(self.moments().axes(eigen::COARSE));
        rows.iter().all(|row| row.is_finite()).then_some(rows)
    }

    fn other_frames(&self) -> impl Iterator<Item = [Vec3A; 3]> {
        std::iter::empty()
    }

    fn extents<const N: usize>(shapes: &[Self], stride: usize, rows: &[Vec3A; N]) -> [f32; N] {
        let Some(first) = shapes.first() else { return [0.0; N] };
        let primitives = shapes.iter().step_by(stride).map(|shape| shape.placed);
        let [lo, hi] = extents_within(&rows.map(|row| row.to_array()), primitives);
        std::array::from_fn(|k| (hi[k] - lo[k]) * first.scale)
    }
}
