//! Bicubic Bézier patches as primitives.
//!
//! # Error
//! Let `S` be the greatest `|x - o|∞` of control points, which is that of the hull; the bounds are those of four quarters of the patch, so a point of the patch is
//! in them but for some 2^-50·S. Let u = 2^-24. The frame of the ray is a shear by at most 1, so extents across the line are at most 4·S. Where
//! Newton's method ends, the point of the patch is off the line by 2^-28·4·S, u/4 of `S`; where halving ends, control points of the smallest parts
//! differ by 6·2^-28 of the extent, 1.5 u of `S`, or 2^-26 of it, along the line by as much times the direction, which is below 2: together below 3.5 u.
//! Rounding `t` adds u·S, hits that share a `t` are moved by up to four roundings of 2 u: less than 13 of the 20 units that are stated.

use canted_obb::{Aabb, Moments};
use canted_trace::{BezierPatch, PatchPoint, ScaledRay};

use super::extents::extent_of_patch;
use super::primitive::{Primitive, PrimitiveHit, SavedPrimitive};

/// `u` and `v` are the parameters of the patch. All hits of a ray are reported one after another, as of other primitives.
impl Primitive for BezierPatch {
    const IS_LOCAL: bool = true;
    const MAX_LEAF: usize = 1;
    const COST: f32 = 20.0;

    fn bounds(&self) -> Aabb {
        if !self.points.as_flattened().as_flattened().iter().all(|x| x.is_finite()) {
            return Aabb { min: [f32::NAN; 3], max: [f32::NAN; 3] };
        }
        let extents =
            [0, 1, 2].map(|axis| self.extent_along(std::array::from_fn(|k| if k == axis { 1.0 } else { 0.0 })));
        Aabb { min: extents.map(|[lo, _]| lo), max: extents.map(|[_, hi]| hi) }
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        extent_of_patch(&self.points, direction)
    }

    fn moments(&self) -> Moments {
        Moments::from_points(self.points.as_flattened().iter().copied())
    }

    #[inline(always)]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let PatchPoint { t, u, v, side } = self.first_scaled(ray, t_max)?;
        Some(PrimitiveHit { t, u, v, side })
    }
}

impl SavedPrimitive for BezierPatch {
    /// The control points, row by row.
    type Data = [[[f32; 3]; 4]; 4];

    fn to_data(&self) -> Self::Data {
        self.points
    }

    fn from_data(data: &Self::Data) -> Self {
        Self { points: *data }
    }
}
