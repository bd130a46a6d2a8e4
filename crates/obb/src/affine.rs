//! Affine maps: constructors, conversions, product and inverse, images of points and directions.

use core::cmp::Ordering;

use crate::vector::{self, add, cross, dot, scale};
use crate::{Quaternion, orient_3d};

/// An affine map `x -> columns[0]·x + columns[1]·y + columns[2]·z + columns[3]`, column vectors.
///
/// Transforms are named by their spaces: `world_from_object` maps object coordinates to world coordinates. Maps are composed in the
/// order in which they act:
///
/// ```
/// use canted_obb::Affine;
///
/// let quarter_turn = Affine::rotation([0.0, 0.0, 1.0], std::f64::consts::FRAC_PI_2);
/// let world_from_object = Affine::scale([2.0; 3]).then(&quarter_turn).then(&Affine::translation([10.0, 0.0, 0.0]));
/// assert_eq!(world_from_object.point([1.0, 0.0, 0.0]), [10.0, 2.0, 0.0]);
/// let object_from_world = world_from_object.inverse().expect("the map is invertible");
/// assert_eq!(object_from_world.point([10.0, 2.0, 0.0]), [1.0, 0.0, 0.0]);
/// ```
///
/// # Other libraries
/// The columns are those of glam: images of x, y and z, then the translation. `a.then(&b)` is `b * a` in glam, nalgebra and cgmath.
/// Any version of a library converts through arrays:
///
/// | from | by |
/// |---|---|
/// | glam `Affine3A` | `Affine::from_columns(map.to_cols_array_2d())` |
/// | glam `Mat4` | `Affine::from(matrix.to_cols_array_2d())` |
/// | nalgebra `Matrix4`, or `Affine3`, `Similarity3`, `Isometry3` by `to_homogeneous()` | `Affine::from(<[[f32; 4]; 4]>::from(matrix))` |
/// | mint `ColumnMatrix4` | `Affine::from(<[[f32; 4]; 4]>::from(matrix))` |
/// | rows of three by four numbers (glTF tools, instances of DXR and Vulkan) | `Affine::from_rows(rows)` |
///
/// ```
/// use canted_obb::Affine;
///
/// let of_glam = glam::Affine3A::from_scale_rotation_translation(
///     glam::vec3(1.0, 2.0, -3.0),
///     glam::Quat::from_rotation_y(0.5),
///     glam::vec3(4.0, 5.0, 6.0),
/// );
/// let ours = Affine::from_columns(of_glam.to_cols_array_2d());
/// assert_eq!(ours.columns[3], [4.0, 5.0, 6.0]);
/// assert_eq!(Affine::from(glam::Mat4::from(of_glam).to_cols_array_2d()), ours);
/// let of_mint = mint::ColumnMatrix4::from(glam::Mat4::from(of_glam).to_cols_array_2d());
/// assert_eq!(Affine::from(<[[f32; 4]; 4]>::from(of_mint)), ours);
/// let back = glam::Affine3A::from_cols_array_2d(&ours.columns);
/// assert_eq!(back, of_glam);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[repr(C)]
pub struct Affine {
    /// Images of the three axes, then the image of the origin.
    pub columns: [[f32; 3]; 4],
}

impl Default for Affine {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl From<[[f32; 3]; 4]> for Affine {
    /// As [`Affine::from_columns`].
    fn from(columns: [[f32; 3]; 4]) -> Self {
        Self { columns }
    }
}

impl From<[[f32; 4]; 4]> for Affine {
    /// The columns of a 4x4 matrix, whose last row is taken as `0, 0, 0, 1`.
    fn from(columns: [[f32; 4]; 4]) -> Self {
        Self { columns: columns.map(|[x, y, z, _]| [x, y, z]) }
    }
}

impl From<Affine> for [[f32; 4]; 4] {
    /// The columns of the 4x4 matrix with the last row `0, 0, 0, 1`.
    fn from(map: Affine) -> Self {
        let [x, y, z, origin] = map.columns;
        let extended = |[x, y, z]: [f32; 3], w: f32| [x, y, z, w];
        [extended(x, 0.0), extended(y, 0.0), extended(z, 0.0), extended(origin, 1.0)]
    }
}

impl Affine {
    /// The identity.
    pub const IDENTITY: Self = Self { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]] };

    /// The map that adds `shift` to points.
    #[must_use]
    pub fn translation(shift: impl Into<[f32; 3]>) -> Self {
        let [x, y, z, _] = Self::IDENTITY.columns;
        Self { columns: [x, y, z, shift.into()] }
    }

    /// The map that multiplies each coordinate by its factor; a negative factor mirrors.
    #[must_use]
    pub fn scale(factors: impl Into<[f32; 3]>) -> Self {
        let [x, y, z] = factors.into();
        Self { columns: [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z], [0.0; 3]] }
    }

    /// The rotation about an axis of any length through the origin, counterclockwise seen from its tip; entries are computed in `f64`
    /// and rounded once. The identity for an axis that is zero or not finite.
    #[must_use]
    pub fn rotation(axis: impl Into<[f32; 3]>, angle_rad: impl Into<f64>) -> Self {
        let Some(axis) = vector::normalized(vector::to_f64(axis.into())) else { return Self::IDENTITY };
        let [x, y, z] = Quaternion::from_axis_angle(axis, angle_rad.into()).frame();
        Self { columns: [x, y, z, [0.0; 3]] }
    }

    /// The map with these images of the three axes, and of the origin.
    #[must_use]
    pub fn from_columns(columns: [impl Into<[f32; 3]>; 4]) -> Self {
        Self { columns: columns.map(Into::into) }
    }

    /// The map with these rows of a 3x4 matrix, the translation last.
    #[must_use]
    pub fn from_rows(rows: [impl Into<[f32; 4]>; 3]) -> Self {
        let rows: [[f32; 4]; 3] = rows.map(Into::into);
        Self { columns: core::array::from_fn(|j| rows.map(|row| row[j])) }
    }

    /// The rows of the 3x4 matrix, the translation last.
    #[must_use]
    pub fn rows(&self) -> [[f32; 4]; 3] {
        core::array::from_fn(|k| self.columns.map(|column| column[k]))
    }

    /// First this map, then `next`: `world_from_object` is `group_from_object.then(&world_from_group)`. Entries are computed in `f64` and
    /// rounded once.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let [x, y, z, origin] = self.columns.map(vector::to_f64);
        let [x, y, z] = [x, y, z].map(|axis| vector::to_f32(next.vector_f64(axis)));
        Self { columns: [x, y, z, vector::to_f32(next.point_f64(origin))] }
    }

    /// The map back; `None` if this one is singular, which is decided exactly, or an entry of the inverse is not finite.
    ///
    /// Entries are computed in `f64`, whose relative error grows with the condition number, and rounded once: below a condition number
    /// of 2^20 they are off by little more than that rounding.
    #[must_use]
    pub fn inverse(&self) -> Option<Self> {
        let [x, y, z, _] = self.columns;
        if !self.is_finite() || orient_3d(x, y, z, [0.0; 3]) == Ordering::Equal {
            return None;
        }
        let [a, b, c, origin] = self.columns.map(vector::to_f64);
        let determinant = self.determinant();
        let rows = [cross(b, c), cross(c, a), cross(a, b)].map(|row| row.map(|entry| entry / determinant));
        let columns: [[f64; 3]; 3] = core::array::from_fn(|j| rows.map(|row| row[j]));
        let [back_x, back_y, back_z] = core::array::from_fn(|k| scale(columns[k], -origin[k]));
        let [x, y, z] = columns.map(vector::to_f32);
        let inverse = Self { columns: [x, y, z, vector::to_f32(add(add(back_x, back_y), back_z))] };
        inverse.is_finite().then_some(inverse)
    }

    /// Image of a point, each coordinate computed in `f64` and rounded once.
    #[must_use]
    pub fn point(&self, p: impl Into<[f32; 3]>) -> [f32; 3] {
        self.point_f64(p.into().map(f64::from)).map(|x| x as f32)
    }

    /// Image of a point in `f64`.
    #[must_use]
    pub fn point_f64(&self, p: [f64; 3]) -> [f64; 3] {
        let linear = self.vector_f64(p);
        core::array::from_fn(|k| linear[k] + f64::from(self.columns[3][k]))
    }

    /// Image of a direction in `f64`: the linear part only.
    #[must_use]
    pub fn vector_f64(&self, v: [f64; 3]) -> [f64; 3] {
        let c = &self.columns;
        core::array::from_fn(|k| f64::from(c[0][k]) * v[0] + f64::from(c[1][k]) * v[1] + f64::from(c[2][k]) * v[2])
    }

    /// Determinant of the linear part; negative for a mirroring map.
    #[must_use]
    pub fn determinant(&self) -> f64 {
        let [a, b, c, _] = self.columns.map(vector::to_f64);
        dot(a, cross(b, c))
    }

    /// Greatest row sum of absolute values of the linear part: its operator norm in the maximum norm.
    #[must_use]
    pub fn row_sum_norm(&self) -> f64 {
        (0..3).map(|k| self.columns[..3].iter().map(|column| f64::from(column[k]).abs()).sum()).fold(0.0, f64::max)
    }

    /// Bound on the reach ([`Aabb::reach`](crate::Aabb::reach)) of the image of points: on its absolute coordinates, if those of
    /// the points do not exceed `reach`.
    #[must_use]
    pub fn reach(&self, reach: f32) -> f64 {
        let [x, y, z, shift] = self.columns.map(|column| column.map(|c| f64::from(c).abs()));
        (0..3).map(|k| f64::from(reach) * (x[k] + y[k] + z[k]) + shift[k]).fold(0.0, f64::max)
    }

    /// Whether every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.columns.iter().flatten().all(|x| x.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reach_is_the_greatest_coordinate_of_a_mapped_cube() {
        let map = Affine { columns: [[1.0, -2.0, 0.5], [4.0, 3.0, 0.0], [-0.25, 0.0, 8.0], [-10.0, 0.0, 1.0]] };
        let corners = (0..8).map(|i| core::array::from_fn(|k| if i >> k & 1 == 0 { -2.0 } else { 2.0 }));
        let images = corners.clone().map(|corner| map.point_f64(corner));
        let greatest = images.flatten().map(f64::abs).fold(0.0, f64::max);
        assert_eq!(map.reach(2.0), greatest);
        let linear = corners.map(|corner| map.vector_f64(corner));
        let greatest = linear.flatten().map(f64::abs).fold(0.0, f64::max);
        assert_eq!(2.0 * map.row_sum_norm(), greatest);
        assert_eq!((Affine::IDENTITY.reach(3.0), Affine::IDENTITY.row_sum_norm()), (3.0, 1.0));
    }

    /// Maps with small integer entries, whose products are exact: rotated, mirrored, stretched and sheared.
    fn exact_maps() -> [Affine; 5] {
        [
            Affine::translation([3.0, -2.0, 7.0]),
            Affine::scale([-1.0, 2.0, 4.0]),
            Affine::from_columns([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [5.0, 0.0, 0.0]]),
            Affine::from_rows([[1.0, 2.0, 0.0, 1.0], [0.0, 1.0, -3.0, 2.0], [0.0, 0.0, 1.0, 3.0]]),
            Affine::from_columns([[1.0, 0.0, 2.0], [1.0, -1.0, 0.0], [0.0, 4.0, -8.0], [0.0, 0.5, -0.25]]),
        ]
    }

    #[test]
    fn the_first_map_acts_first() {
        let shifted_then_scaled = Affine::translation([1.0, 0.0, 0.0]).then(&Affine::scale([2.0; 3]));
        assert_eq!(shifted_then_scaled.point([0.0; 3]), [2.0, 0.0, 0.0]);
        let points = [[1.0, 2.0, 3.0], [-4.0, 0.5, 8.0], [0.0; 3]];
        for a in exact_maps() {
            for b in exact_maps() {
                let both = a.then(&b);
                assert!(points.iter().all(|&p| both.point(p) == b.point(a.point(p))), "{a:?}, then {b:?}");
                assert_eq!(both.determinant(), a.determinant() * b.determinant());
                for c in exact_maps() {
                    assert_eq!(both.then(&c), a.then(&b.then(&c)));
                }
            }
            assert_eq!([a.then(&Affine::IDENTITY), Affine::IDENTITY.then(&a)], [a; 2]);
        }
    }

    #[test]
    fn inverses_undo_mirrored_stretched_and_sheared_maps() {
        for map in exact_maps() {
            let inverse = map.inverse().unwrap();
            assert_eq!([map.then(&inverse), inverse.then(&map)], [Affine::IDENTITY; 2], "{map:?}");
            assert_eq!(inverse.inverse(), Some(map));
        }
        // Rounding of the entries of a map and of its inverse moves a point by at most a few units in the last place of the greatest
        // coordinate times the condition number, which is below 64 here.
        let skewed = Affine::scale([3.0, -0.5, 1.5])
            .then(&Affine::rotation([1.0, 2.0, 3.0], 0.7))
            .then(&Affine::from_rows([[1.0, 0.7, -0.4, 0.3], [0.0, 1.0, 0.9, 0.1], [0.0, 0.0, 1.0, -0.2]]));
        let identity = skewed.then(&skewed.inverse().unwrap());
        let off = identity.columns.iter().flatten().zip(Affine::IDENTITY.columns.iter().flatten());
        assert!(off.clone().all(|(a, b)| (a - b).abs() < 64.0 * f32::EPSILON), "{identity:?}");
        assert!(skewed.determinant() < 0.0);
        for scale in [1e-12, 1e12] {
            let scaled = skewed.then(&Affine::scale([scale; 3]));
            assert!(scaled.inverse().is_some_and(|inverse| inverse.then(&scaled).point([1.0; 3])[0] > 0.9));
        }
    }

    #[test]
    fn singular_maps_have_no_inverse() {
        let x = [0.1, 0.2, 0.3];
        assert_eq!(Affine::from_columns([x, [0.7, 0.11, 0.13], x.map(|x| 2.0 * x), [0.0; 3]]).inverse(), None);
        assert_eq!(Affine::scale([1.0, 0.0, 1.0]).inverse(), None);
        assert_eq!(
            Affine::from_rows([[1.0, 2.0, 3.0, 0.0], [4.0, 5.0, 6.0, 0.0], [7.0, 8.0, 9.0, 0.0]]).inverse(),
            None
        );
        assert_eq!(Affine::scale([f32::NAN, 1.0, 1.0]).inverse(), None);
        assert_eq!(Affine::scale([1e-40; 3]).inverse(), None, "the inverse leaves the range");
    }

    #[test]
    fn rotations_turn_counterclockwise_about_axes_of_any_length() {
        let quarter = core::f64::consts::FRAC_PI_2;
        let turned =
            [[0.0, 0.0, 1e-20], [0.0, 0.0, 5.0]].map(|axis| Affine::rotation(axis, quarter).point([1.0, 0.0, 0.0]));
        for [x, y, z] in turned {
            assert!(x.abs() < 1e-15 && y == 1.0 && z == 0.0);
        }
        assert_eq!(Affine::rotation([0.0; 3], 1.0_f32), Affine::IDENTITY);
        assert_eq!(Affine::rotation([f32::INFINITY, 0.0, 0.0], 1.0), Affine::IDENTITY);
        assert!((Affine::rotation([1.0, -2.0, 0.5], 2.5).determinant() - 1.0).abs() < 4.0 * f64::from(f32::EPSILON));
    }

    #[test]
    fn arrays_convert_both_ways() {
        for map in exact_maps() {
            assert_eq!(Affine::from_rows(map.rows()), map);
            assert_eq!(Affine::from(<[[f32; 4]; 4]>::from(map)), map);
            assert_eq!(Affine::from(map.columns), map);
        }
        assert_eq!(Affine::default(), Affine::IDENTITY);
        assert_eq!(Affine::translation([1.0, 2.0, 3.0]).rows()[1], [0.0, 1.0, 0.0, 2.0]);
    }
}
