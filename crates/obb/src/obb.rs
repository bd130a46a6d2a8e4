//! The oriented box: its corners and areas, and exact containment.

use core::cmp::Ordering;

use crate::{
    Aabb, frame,
    orientation::ExactSum,
    round::{U, difference_up, up},
    vector::{self, Vector},
};

/// An oriented box: all points `center + frame · q` with `|q[k]| <= half_extents[k]`.
///
/// `frame[k]` is the direction of axis `k` (a column of the matrix). It is orthonormal up to rounding after a fit and
/// skewed after a shear, so that an affine image of a box stays exact. Half-extents are not negative; zero is valid. The
/// layout is fifteen floats without padding, in this order, on CPU and GPU.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[repr(C)]
pub struct Obb {
    /// Center, in the space of the points.
    pub center: [f32; 3],
    /// Directions of the three axes, invertible as a matrix.
    pub frame: [[f32; 3]; 3],
    /// Half-extents on the axes, in units of the axes' lengths.
    pub half_extents: [f32; 3],
}

impl Obb {
    /// The unrotated frame.
    pub const IDENTITY_FRAME: [[f32; 3]; 3] = frame::IDENTITY;

    /// The box with the identity frame that contains `aabb` exactly; the half-extents cover the rounding of the center.
    ///
    /// The empty box becomes a point at the origin.
    #[must_use]
    pub fn from_aabb(aabb: &Aabb) -> Self {
        if aabb.is_empty() {
            return Self { center: [0.0; 3], frame: Self::IDENTITY_FRAME, half_extents: [0.0; 3] };
        }
        let center = vector::to_f32(aabb.center());
        let half =
            core::array::from_fn(|k| difference_up(aabb.max[k], center[k]).max(difference_up(center[k], aabb.min[k])));
        Self { center, frame: Self::IDENTITY_FRAME, half_extents: half }
    }

    /// The box of all points `p` with `lower[k] <= rows[k] · p <= upper[k]`, up to the rounding of center, axes and half-extents; `None`
    /// where the rows are dependent, or an interval is empty or not finite.
    #[must_use]
    pub fn from_slabs(rows: [[f32; 3]; 3], lower: [f32; 3], upper: [f32; 3]) -> Option<Self> {
        let rows = rows.map(vector::to_f64);
        // Axis k is perpendicular to the other two rows, and advances by one along its own.
        let cofactors = core::array::from_fn::<Vector, 3, _>(|k| vector::cross(rows[(k + 1) % 3], rows[(k + 2) % 3]));
        let determinant = vector::dot(rows[0], cofactors[0]);
        let axes = cofactors.map(|axis| vector::scale(axis, 1.0 / determinant));
        let intervals: [[f64; 2]; 3] =
            core::array::from_fn(|k| [lower[k], upper[k]].map(|plane| 0.5 * f64::from(plane)));
        let center = (0..3).fold([0.0; 3], |sum: Vector, k| {
            let [below, above] = intervals[k];
            vector::add(sum, vector::scale(axes[k], below + above))
        });
        let half_extents = vector::to_f32(intervals.map(|[below, above]| above - below));
        let obb = Self { center: vector::to_f32(center), frame: axes.map(vector::to_f32), half_extents };
        let is_finite = obb.center.iter().chain(obb.frame.iter().flatten()).all(|x| x.is_finite());
        let is_extent = |x: &f32| *x >= 0.0 && x.is_finite();
        (is_finite && obb.half_extents.iter().all(is_extent)).then_some(obb)
    }

    /// This box, or the axis-aligned box `content` where that has no more area.
    ///
    /// `content` bounds what the box contains, not the corners of the box (Sabino 2020, 3.5, but by area, since flat
    /// boxes have no volume).
    #[inline]
    #[must_use]
    pub fn or_aabb(self, content: &Aabb) -> Self {
        if content.area() <= self.area() { Self::from_aabb(content) } else { self }
    }

    /// The eight corners in `f64`; bit `k` of the index chooses the positive side of axis `k`.
    #[must_use]
    pub fn corners(&self) -> [[f64; 3]; 8] {
        core::array::from_fn(|i| {
            core::array::from_fn(|k| {
                (0..3).fold(f64::from(self.center[k]), |sum, a| {
                    let side = f64::from(self.frame[a][k]) * f64::from(self.half_extents[a]);
                    if i >> a & 1 == 1 { sum + side } else { sum - side }
                })
            })
        })
    }

    /// Surface area in square scene units, exact for skewed frames too.
    #[must_use]
    pub fn area(&self) -> f64 {
        let [x, y, z] = self.edges();
        let face = |a, b| vector::length(vector::cross(a, b));
        2.0 * (face(x, y) + face(y, z) + face(z, x))
    }

    /// Volume in cubic scene units.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let [x, y, z] = self.edges();
        vector::dot(x, vector::cross(y, z)).abs()
    }

    /// The three edges from a corner, at full length.
    fn edges(&self) -> [Vector; 3] {
        core::array::from_fn(|a| vector::scale(vector::to_f64(self.frame[a]), 2.0 * f64::from(self.half_extents[a])))
    }

    /// Smallest axis-aligned box that contains the eight exact corners, rounded outward; infinite where a corner exceeds
    /// the range of `f32`.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        let mut aabb = Aabb::EMPTY;
        for k in 0..3 {
            let center = f64::from(self.center[k]);
            let support: f64 =
                (0..3).map(|a| f64::from(self.frame[a][k].abs()) * f64::from(self.half_extents[a])).sum();
            // The products are exact; two sums and the last difference round, relative to the sum of the absolute terms.
            let error = 4.0 * U * (center.abs() + support);
            aabb.min[k] = -up(-(center - support - error));
            aabb.max[k] = up(center + support + error);
        }
        aabb
    }
}

/// Roundings in the filter's two sums and their difference, relative to the sum of their absolute terms.
///
/// A cofactor takes one rounding, the difference `p - c` one, their product and sum three, `half · |det|` one more than
/// that, and the final difference one: at most seven roundings per term. The eighth covers the rounding of the sum of
/// absolute terms.
const FILTER_ERROR: f64 = 8.0 * U;

/// Two parts for each product: twelve products with the point, six in the determinant.
const PARTS: usize = 2 * (12 + 6);

impl Obb {
    /// Whether `point` lies inside or on the boundary, decided exactly: whether it is `center + frame · q` with
    /// `|q[k]| <= half_extents[k]`.
    ///
    /// A box with a singular frame contains nothing. By Cramer's rule `q[k] = cofactor[k] · (p − c) / det`, so each axis
    /// needs the sign of `half · |det| − |cofactor · (p − c)|`: computed in `f64` with an error bound, and exactly where
    /// the bound does not decide.
    #[must_use]
    pub fn contains(&self, point: impl Into<[f32; 3]>) -> bool {
        let point = point.into();
        let frame = self.frame.map(vector::to_f64);
        let difference = vector::sub(vector::to_f64(point), vector::to_f64(self.center));
        let determinant = determinant_sign(frame);
        determinant != Ordering::Equal
            && (0..3).all(|k| {
                let (a, b) = (frame[(k + 1) % 3], frame[(k + 2) % 3]);
                let half = f64::from(self.half_extents[k]);
                within(half, frame, [a, b], difference)
                    .unwrap_or_else(|| within_exactly(self, point, k, determinant == Ordering::Less))
            })
    }
}

/// The filter: `None` where rounding in `f64` could decide.
fn within(half: f64, frame: [Vector; 3], [a, b]: [Vector; 2], difference: Vector) -> Option<bool> {
    let cofactor = vector::cross(a, b);
    let bound = half * vector::dot(frame[0], vector::cross(frame[1], frame[2])).abs();
    let value = vector::dot(cofactor, difference).abs();
    let terms = half * permanent(frame[0], frame[1], frame[2]) + permanent(difference, a, b);
    let error = FILTER_ERROR * terms;
    let margin = bound - value;
    if margin > error {
        Some(true)
    } else if margin < -error {
        Some(false)
    } else {
        None
    }
}

/// Sum of the absolute terms of the determinant.
fn permanent(a: Vector, b: Vector, c: Vector) -> f64 {
    let [a, b, c] = [a, b, c].map(|v| v.map(f64::abs));
    a[0] * (b[1] * c[2] + b[2] * c[1]) + a[1] * (b[2] * c[0] + b[0] * c[2]) + a[2] * (b[0] * c[1] + b[1] * c[0])
}

/// The exact decision for axis `k`; `mirrored` is the sign of the determinant.
fn within_exactly(obb: &Obb, point: [f32; 3], k: usize, mirrored: bool) -> bool {
    let frame = obb.frame.map(vector::to_f64);
    let (a, b) = (frame[(k + 1) % 3], frame[(k + 2) % 3]);
    let half = f64::from(if mirrored { -obb.half_extents[k] } else { obb.half_extents[k] });
    [1.0, -1.0].into_iter().all(|side| {
        let mut margin = ExactSum::<PARTS>::new();
        for [x, y, z] in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
            for (y, z, sign) in [(y, z, 1.0), (z, y, -1.0)] {
                // Products of two f32 are exact in f64, and so are their negatives.
                margin.add_product(frame[1][y] * frame[2][z], sign * half * frame[0][x]);
                let cofactor_term = side * sign * a[y] * b[z];
                margin.add_product(cofactor_term, -f64::from(point[x]));
                margin.add_product(cofactor_term, f64::from(obb.center[x]));
            }
        }
        margin.sign() != Ordering::Less
    })
}

/// Exact sign of the determinant.
fn determinant_sign(frame: [Vector; 3]) -> Ordering {
    let determinant = vector::dot(frame[0], vector::cross(frame[1], frame[2]));
    let error = FILTER_ERROR * permanent(frame[0], frame[1], frame[2]);
    if determinant.abs() > error {
        return determinant.total_cmp(&0.0);
    }
    let mut exact = ExactSum::<12>::new();
    for [x, y, z] in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
        for (y, z, sign) in [(y, z, 1.0), (z, y, -1.0)] {
            exact.add_product(frame[1][y] * frame[2][z], sign * frame[0][x]);
        }
    }
    exact.sign()
}
