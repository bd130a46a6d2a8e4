//! Bicubic Bézier patches as primitives.
//!
//! # Error
//! Let `S` be the greatest `|x - o|∞` of points of the bounds, `C` that of control points, and u = 2^-24. The bounds are those of the
//! control points of four quarters; a control value of a cubic polynomial is at most 3 times as large as those of its halves (`2·l1 - l0`
//! of the lower one), so `C` is at most 9·S. A point of the patch is in the bounds but for some 2^-50·C.
//!
//! The frame of the ray is a shear by at most 1, so extents across the line are at most 4·C. Where Newton's method ends, the point of
//! the patch is off the line by 2^-28·4·C, u/4 of `C`. Where halving ends, control points of the smallest parts differ by at most
//! 6·2^-30 of the extent, 3/8 u of `C`, and their middle along the line is off by half of that times the direction, which is below 2:
//! together 3/4 u of `C`, 7 u of `S`. Rounding `t` adds u·S, hits that share a `t` are moved by up to four roundings of 2 u: less than
//! 16 of the 20 units that are stated.

use canted_obb::round::{down, up};
use canted_obb::{Aabb, Moments};
use canted_trace::{BezierPatch, PatchPoint, ScaledRay};

use super::extents::EXTENT_ERROR;
use super::primitive::{Primitive, PrimitiveHit, SavedPrimitive};

/// As [`extent_of_points`](super::extents::extent_of_points), over a bicubic patch, given its control points: of the four quarters
/// of the patch, whose hulls are tighter than that of its own.
///
/// Six means follow one another, each with a rounding: the error covers them, too.
fn extent_of_patch(points: &[[[f32; 3]; 4]; 4], direction: [f32; 3]) -> [f32; 2] {
    let d = direction.map(f64::from);
    let (mut heights, mut size) = ([[0.0; 4]; 4], 0.0_f64);
    for i in 0..4 {
        for j in 0..4 {
            let terms: [f64; 3] = std::array::from_fn(|k| d[k] * f64::from(points[i][j][k]));
            heights[i][j] = terms[0] + terms[1] + terms[2];
            size = size.max(terms[0].abs() + terms[1].abs() + terms[2].abs());
        }
    }
    let error = 4.0 * EXTENT_ERROR * size;
    let (mut lo, mut hi) = (f64::MAX, f64::MIN);
    // Seven columns of both halves along one parameter, of which the middle one is in both.
    let rows = heights.map(both_halves);
    for j in 0..7 {
        for height in both_halves(rows.map(|row| row[j])) {
            lo = lo.min(height);
            hi = hi.max(height);
        }
    }
    [down(lo - error), up(hi + error)]
}

/// The control values of both halves of a cubic polynomial; the one in the middle is in both.
fn both_halves([a, b, c, d]: [f64; 4]) -> [f64; 7] {
    let mid = |a: f64, b: f64| 0.5 * (a + b);
    let (ab, bc, cd) = (mid(a, b), mid(b, c), mid(c, d));
    let (abc, bcd) = (mid(ab, bc), mid(bc, cd));
    [a, ab, abc, mid(abc, bcd), bcd, cd, d]
}

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
