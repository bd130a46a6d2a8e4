use crate::round::{U, difference_up, up};
use crate::vector::{self, Vector};
use crate::{Aabb, frame};

/// An oriented box: all points `center + frame · q` with `|q[k]| <= half_extents[k]`.
///
/// `frame[k]` is the direction of axis `k` (a column of the matrix). It is orthonormal up to rounding after a fit and
/// skewed after a shear, so that an affine image of a box stays exact. Half-extents are not negative; zero is valid. The
/// layout is fifteen floats without padding, in this order, on CPU and GPU.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
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
