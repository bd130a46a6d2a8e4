use canted_obb::{Aabb, Obb};

use super::SLABS_PAD;
use crate::rounding::{UNIT_ROUNDOFF_F64, down, lower, nearest, up};
use canted_obb::vector::{cross, dot, length, to_f64};

/// A box for ray tests: all points `x` with `lo[k] <= rows[k]·x <= hi[k]`, in the space of the rays.
///
/// Rows are unit vectors up to the rounding of their components: `|row| <= 1 + 4u`. They need not be orthogonal. An
/// empty box has `lo > hi`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Slabs {
    /// Normals of the three pairs of faces.
    pub rows: [[f32; 3]; 3],
    /// Least projections.
    pub lo: [f32; 3],
    /// Greatest projections.
    pub hi: [f32; 3],
}

/// Rounding of a projected point relative to the greatest coordinate: two sums and the outward step of exact products, whose absolute
/// values sum up to at most √3 times that coordinate; 5.2 roundings, doubled for second-order terms.
const POINT_ERROR: f64 = 12.0 * UNIT_ROUNDOFF_F64;

/// Rounding of a projected box: five roundings reach a term of the radius, two more the ends; doubled likewise.
const BOX_ERROR: f64 = 14.0 * UNIT_ROUNDOFF_F64;

impl Slabs {
    /// The empty box with these rows.
    #[must_use]
    pub fn empty(rows: [[f32; 3]; 3]) -> Self {
        Self { rows, lo: Aabb::EMPTY.min, hi: Aabb::EMPTY.max }
    }

    /// The axis-aligned box, exactly.
    #[must_use]
    pub fn from_aabb(aabb: &Aabb) -> Self {
        Self { rows: Obb::IDENTITY_FRAME, lo: aabb.min, hi: aabb.max }
    }

    /// A box that contains every point of `obb`, tight up to rounding.
    ///
    /// The rows are those of the inverse frame, normalized and rounded. The intervals are computed for the *rounded* rows,
    /// so rounding the rows adds no padding. A direction that a singular frame leaves undefined is replaced by a
    /// coordinate axis.
    #[must_use]
    pub fn from_obb(obb: &Obb) -> Self {
        // The inverse of a rotation is its transpose, so its axes are the rows.
        let rows =
            if canted_obb::frame::is_orthonormal(obb.frame) { obb.frame } else { inverse_rows(obb.frame.map(to_f64)) };
        let mut slabs = Self::empty(rows);
        let (center, frame, half) = (to_f64(obb.center), obb.frame.map(to_f64), to_f64(obb.half_extents));
        for k in 0..3 {
            let row = to_f64(slabs.rows[k]);
            let mid = dot(row, center);
            let radius = dot(frame.map(|axis| dot(row, axis).abs()), half);
            let error = BOX_ERROR * (dot_abs(row, center) + dot(frame.map(|axis| dot_abs(row, axis)), half));
            slabs.lo[k] = down(mid - radius - error);
            slabs.hi[k] = up(mid + radius + error);
        }
        slabs
    }

    /// The smallest box with these rows that contains `points`, rounded outward; empty for none.
    ///
    /// Each row must have a length of at most 1 + 4u, as a unit vector has after rounding.
    #[must_use]
    pub fn from_points(rows: [[f32; 3]; 3], points: impl IntoIterator<Item = [f32; 3]>) -> Self {
        let wide = rows.map(to_f64);
        let (mut lo, mut hi, mut reach) = ([f64::MAX; 3], [f64::MIN; 3], 0.0);
        for point in points {
            let point = to_f64(point);
            for k in 0..3 {
                let (x, size) = (Self::projection(wide[k], point), point[k].abs());
                lo[k] = if x < lo[k] { x } else { lo[k] };
                hi[k] = if x > hi[k] { x } else { hi[k] };
                reach = if size > reach { size } else { reach };
            }
        }
        let [lo, hi] = Self::ends(lo, hi, reach);
        if lo[0] > hi[0] { Self::empty(rows) } else { Self { rows, lo: lo.map(down), hi: hi.map(up) } }
    }

    /// The projection of a point along a row but for roundings, both with coordinates of `f32`; of each, [`Slabs::ends`] includes them.
    #[inline(always)]
    #[must_use]
    pub fn projection(row: [f64; 3], point: [f64; 3]) -> f64 {
        // Products of two f32 are exact.
        (row[0] * point[0] + row[1] * point[1]) + row[2] * point[2]
    }

    /// The ends of a box from the least and the greatest [`Slabs::projection`] along each row, of points whose coordinates are at most
    /// `reach`.
    #[inline(always)]
    #[must_use]
    pub fn ends(mut lo: [f64; 3], mut hi: [f64; 3], reach: f64) -> [[f64; 3]; 2] {
        for k in 0..3 {
            (lo[k], hi[k]) = (lo[k] - POINT_ERROR * reach, hi[k] + POINT_ERROR * reach);
        }
        [lo, hi]
    }

    /// The box enlarged by the part of the padding that depends on its content, for [`SlabRay::new`](crate::SlabRay::new)
    /// with a reach of 0.
    ///
    /// The planes move outward by [`SLABS_PAD`](crate::SLABS_PAD) times `reach`, the greatest absolute coordinate of the
    /// triangles in the box. An empty box must not be padded.
    #[must_use]
    pub fn padded(&self, reach: f32) -> Self {
        let pad = f64::from(SLABS_PAD) * f64::from(reach);
        Self { rows: self.rows, lo: self.lo.map(|x| lower(x, pad)), hi: self.hi.map(|x| -lower(-x, pad)) }
    }

    /// Whether the box contains no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        (0..3).any(|k| self.lo[k] > self.hi[k])
    }
}

/// Sum of the absolute terms of a dot product.
fn dot_abs(a: [f64; 3], b: [f64; 3]) -> f64 {
    dot(a.map(f64::abs), b.map(f64::abs))
}

/// The rows of the inverse of the matrix with these columns, normalized and rounded.
fn inverse_rows(columns: [[f64; 3]; 3]) -> [[f32; 3]; 3] {
    core::array::from_fn(|k| {
        let normal = cross(columns[(k + 1) % 3], columns[(k + 2) % 3]);
        let length = length(normal);
        if length > 0.0 { normal.map(|x| nearest(x / length)) } else { Obb::IDENTITY_FRAME[k] }
    })
}
