use crate::round::{U, difference_up, up};
use crate::vector::{self, Vector};
use crate::{Aabb, Affine, Enclosure, contains, frame};

/// A box that may lean: all points `center + frame · q` with `|q[k]| <= half[k]`.
///
/// `frame[k]` is the direction of axis `k` (a column of the matrix). It is orthonormal up to rounding after a fit and
/// skewed after a shear: an affine image of a box stays exact. `half >= 0`; zero is legal. Fifteen floats without
/// padding, in this order, on every device.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Obb {
    /// Midpoint, in the space of the points.
    pub center: [f32; 3],
    /// Directions of the three axes, invertible as a matrix.
    pub frame: [[f32; 3]; 3],
    /// Half-extents along the axes, in units of the axes' lengths.
    pub half_extents: [f32; 3],
}

impl Obb {
    /// The unrotated frame.
    pub const IDENTITY_FRAME: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// The axis-parallel box that contains `aabb` exactly; the half-extents cover the rounding of the midpoint.
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

    /// The image of the unit cube `[-1/2, 1/2]³`, exactly: the columns are the frame and no number is rounded.
    ///
    /// A column of zeros becomes an axis of extent zero across the others. Where the other columns are linearly
    /// dependent no frame can carry the image, and the axis-parallel box around it is returned.
    #[must_use]
    pub fn from_affine(space_from_cube: &Affine) -> Self {
        let cube = Self { center: [0.0; 3], frame: Self::IDENTITY_FRAME, half_extents: [0.5; 3] };
        let [x, y, z, center] = space_from_cube.columns;
        let completed = frame::complete([x, y, z].map(vector::to_f64));
        let (mut exact, flat) = (Self { center, frame: [x, y, z], half_extents: [0.5; 3] }, [0.0; 3]);
        for k in (0..3).filter(|&k| space_from_cube.columns[k] == flat) {
            exact.frame[k] = completed[k];
            exact.half_extents[k] = 0.0;
        }
        if contains::is_singular(&exact) { cube.transformed(space_from_cube) } else { exact }
    }

    /// The map that takes the unit cube `[-1/2, 1/2]³` to this box (Sabino 2020, 3.1.1), columns of *full* length.
    ///
    /// Each number is rounded to nearest, so the image may lack what the box contains by a rounding; a flat box gives
    /// a singular map.
    #[must_use]
    pub fn to_affine(&self) -> Affine {
        let [x, y, z] = core::array::from_fn(|a| {
            vector::to_f32(vector::scale(vector::to_f64(self.frame[a]), 2.0 * f64::from(self.half_extents[a])))
        });
        Affine { columns: [x, y, z, self.center] }
    }

    /// A box that contains the exact image of this one; its axes are the images of the axes, skewed where the map
    /// shears.
    ///
    /// Axes come back at lengths between one and four. An axis that the map flattens to a point is replaced by one
    /// across the others; where the map makes the axes dependent the axis-parallel box around the image is returned.
    #[must_use]
    pub fn transformed(&self, to_from_self: &Affine) -> Self {
        let center = to_from_self.point_f64(vector::to_f64(self.center));
        let directions = self.frame.map(|axis| to_from_self.vector_f64(vector::to_f64(axis)));
        let sides: [Vector; 3] =
            core::array::from_fn(|a| vector::scale(directions[a], f64::from(self.half_extents[a])));
        // Products of two f32 are exact in f64. A coordinate of the centre then takes three roundings, one of a side
        // two and a third for its half-extent, each relative to the sum of absolute terms; the fourth unit covers the
        // sum itself.
        let reach: Vector = core::array::from_fn(|k| {
            let sides = (0..3).map(|a| f64::from(self.frame[a][k].abs()) * f64::from(self.half_extents[a]));
            f64::from(self.center[k].abs()) + sides.sum::<f64>()
        });
        let magnitude: Vector = core::array::from_fn(|k| {
            let linear = (0..3).map(|j| f64::from(to_from_self.columns[j][k].abs()) * reach[j]);
            f64::from(to_from_self.columns[3][k].abs()) + linear.sum::<f64>()
        });
        let limit = f64::from(f32::MAX);
        let origin = vector::to_f32(center.map(|x| x.clamp(-limit, limit)));
        let mut enclosure = Enclosure::new(frame::complete(directions), origin);
        enclosure.add_parallelepiped(center, sides, 4.0 * U * vector::reach(magnitude));
        enclosure.finish()
    }

    /// This box, or the axis-parallel one around `content` where that has no more area.
    ///
    /// `content` is the true bound of what the box contains, not of its corners (Sabino 2020, 3.5, but by area: flat
    /// boxes have no volume).
    #[inline]
    #[must_use]
    pub fn or_aabb(self, content: &Aabb) -> Self {
        if content.area() <= self.area() { Self::from_aabb(content) } else { self }
    }

    /// Whether `point` lies inside or on the boundary: exactly, by the definition of the type.
    ///
    /// A singular frame contains nothing.
    #[must_use]
    pub fn contains(&self, point: impl Into<[f32; 3]>) -> bool {
        contains::contains(self, point.into())
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

    /// Smallest axis-aligned box around the eight real corners, rounded outward; infinite where a corner lies beyond the
    /// range of `f32`.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        let mut aabb = Aabb::EMPTY;
        for k in 0..3 {
            let center = f64::from(self.center[k]);
            let support: f64 =
                (0..3).map(|a| f64::from(self.frame[a][k].abs()) * f64::from(self.half_extents[a])).sum();
            // The products are exact; two sums and the last difference round, relative to what they add up.
            let error = 4.0 * U * (center.abs() + support);
            aabb.min[k] = -up(-(center - support - error));
            aabb.max[k] = up(center + support + error);
        }
        aabb
    }
}
