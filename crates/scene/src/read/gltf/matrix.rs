//! Affine transforms in `f64`, so that a chain of nodes is rounded only once.

use canted_obb::Affine;
use canted_obb::vector::{cross, dot};

/// Largest error of the last row of a matrix: 256 roundings of numbers around 1, as chains of products in exporters leave.
const MAX_ROUNDING: f32 = 128.0 * f32::EPSILON;

/// An affine transform as in [`Affine`]: images of the three axes and of the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Matrix {
    pub(super) columns: [[f64; 3]; 4],
}

impl Matrix {
    /// The identity.
    pub(super) const IDENTITY: Self =
        Self { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]] };

    /// From a column-major 4 x 4 matrix; `None` if the last row is not `0 0 0 1` up to the roundings of a product of matrices.
    pub(super) fn from_4x4(numbers: &[f32; 16]) -> Option<Self> {
        let column = |k: usize| std::array::from_fn(|row| f64::from(numbers[4 * k + row]));
        let last_row = [numbers[3], numbers[7], numbers[11], numbers[15]];
        let is_affine = last_row.iter().zip([0.0, 0.0, 0.0, 1.0]).all(|(x, y)| (x - y).abs() <= MAX_ROUNDING);
        is_affine.then(|| Self { columns: std::array::from_fn(column) })
    }

    /// Scale, then rotation by a quaternion `x y z w`, then translation.
    ///
    /// The quaternion is normalized, so that rounded components do not scale.
    pub(super) fn from_parts(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3]) -> Self {
        let [x, y, z, w] = rotation.map(f64::from);
        let twice = 2.0 / (x * x + y * y + z * z + w * w);
        let axes = [
            [1.0 - twice * (y * y + z * z), twice * (x * y + z * w), twice * (x * z - y * w)],
            [twice * (x * y - z * w), 1.0 - twice * (x * x + z * z), twice * (y * z + x * w)],
            [twice * (x * z + y * w), twice * (y * z - x * w), 1.0 - twice * (x * x + y * y)],
        ];
        let [a, b, c] = std::array::from_fn(|k| axes[k].map(|axis: f64| axis * f64::from(scale[k])));
        Self { columns: [a, b, c, translation.map(f64::from)] }
    }

    /// `self * inner`.
    pub(super) fn after(&self, inner: &Self) -> Self {
        let [a, b, c, origin] = inner.columns;
        Self { columns: [self.vector(a), self.vector(b), self.vector(c), self.point(origin)] }
    }

    /// Transforms a point.
    pub(super) fn point(&self, p: [f64; 3]) -> [f64; 3] {
        let linear = self.vector(p);
        std::array::from_fn(|k| linear[k] + self.columns[3][k])
    }

    /// Transforms a vector.
    pub(super) fn vector(&self, v: [f64; 3]) -> [f64; 3] {
        let c = &self.columns;
        std::array::from_fn(|k| c[0][k] * v[0] + c[1][k] * v[1] + c[2][k] * v[2])
    }

    /// Transforms a normal by the cofactor matrix, with the sign of the determinant; not normalized.
    pub(super) fn normal(&self, n: [f64; 3]) -> [f64; 3] {
        let [a, b, c, _] = self.columns;
        let rows = [cross(b, c), cross(c, a), cross(a, b)];
        let sign = self.sign();
        std::array::from_fn(|k| sign * (rows[0][k] * n[0] + rows[1][k] * n[1] + rows[2][k] * n[2]))
    }

    /// Sign of the determinant; -1 for mirroring transforms.
    pub(super) fn sign(&self) -> f64 {
        let [a, b, c, _] = self.columns;
        dot(a, cross(b, c)).signum()
    }

    /// `self + weight * other`, for skinning.
    pub(super) fn add_scaled(&self, weight: f64, other: &Self) -> Self {
        let entry = |k: usize, row: usize| self.columns[k][row] + weight * other.columns[k][row];
        Self { columns: std::array::from_fn(|k| std::array::from_fn(|row| entry(k, row))) }
    }

    /// The transform in single precision; `None` if it is not invertible there.
    ///
    /// Rounding changes each entry by a factor within 1 ± u, and the determinant by at most `((1 + u)³ - 1)` times the
    /// permanent of the absolute entries. Below that bound the exact transform may be singular.
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    pub(super) fn rounded(&self) -> Option<Affine> {
        let affine = Affine { columns: self.columns.map(|column| column.map(|x| x as f32)) };
        let [a, b, c, origin] = affine.columns.map(|column| column.map(f64::from));
        let determinant = dot(a, cross(b, c));
        let permanent = dot(a.map(f64::abs), cross_of_absolutes(b, c));
        let rows = [cross(b, c), cross(c, a), cross(a, b)];
        let largest_of_inverse = rows
            .iter()
            .flat_map(|&row| row.into_iter().chain([dot(row, origin)]))
            .fold(0.0, |most: f64, x| most.max(x.abs()))
            / determinant.abs();
        let has_inverse = affine.is_finite()
            && determinant.abs() > DETERMINANT_ERROR * permanent
            && largest_of_inverse <= f64::from(f32::MAX);
        has_inverse.then_some(affine)
    }
}

/// Error of a 3 x 3 determinant of entries rounded to `f32`, relative to the permanent of the absolute entries.
///
/// Each product has three roundings by u = 2⁻²⁴: `(1 + u)³ - 1 < 3u / (1 - 3u)`. The arithmetic adds at most five roundings
/// by 2⁻⁵³, which the factor 4 covers.
const DETERMINANT_ERROR: f64 = 4.0 * U / (1.0 - 4.0 * U);
/// Unit roundoff of `f32`.
const U: f64 = f32::EPSILON as f64 / 2.0;

/// [`cross`] with sums of absolute products.
fn cross_of_absolutes(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        (a[i] * b[j]).abs() + (a[j] * b[i]).abs()
    })
}

/// Normalizes a vector to single precision; `None` if it has no direction.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
pub(super) fn unit(v: [f64; 3]) -> Option<[f32; 3]> {
    // Divides by the largest component first, so that squares neither overflow nor underflow.
    let largest = v.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let scaled = v.map(|x| x / largest);
    let length = dot(scaled, scaled).sqrt();
    let unit = scaled.map(|x| (x / length) as f32);
    unit.iter().all(|x| x.is_finite()).then_some(unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NO_ROTATION: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

    /// Integers small enough for exact arithmetic.
    fn integers() -> impl Strategy<Value = [f64; 3]> {
        prop::array::uniform3((-9..10_i8).prop_map(f64::from))
    }

    proptest! {
        /// A transformed normal is the normal of transformed edges, up to the sign of the determinant.
        #[test]
        fn transformed_normals_stay_perpendicular(axes in prop::array::uniform3(integers()), u in integers(), v in integers()) {
            let [a, b, c] = axes;
            let determinant = dot(a, cross(b, c));
            prop_assume!(determinant != 0.0);
            let matrix = Matrix { columns: [a, b, c, [0.0; 3]] };
            let want = cross(matrix.vector(u), matrix.vector(v)).map(|x| determinant.signum() * x);
            prop_assert_eq!(matrix.normal(cross(u, v)), want);
        }

        #[test]
        fn composition_applies_inner_first(outer in prop::array::uniform4(integers()), inner in prop::array::uniform4(integers()), p in integers()) {
            let (outer, inner) = (Matrix { columns: outer }, Matrix { columns: inner });
            prop_assert_eq!(outer.after(&inner).point(p), outer.point(inner.point(p)));
        }
    }

    #[test]
    fn normalizes_vectors_of_any_length() {
        for scale in [1.0, 1e-300, 5e-324, 1e300] {
            assert_eq!(unit([0.0, -scale, 0.0]), Some([0.0, -1.0, 0.0]), "{scale:e}");
        }
        for v in [[0.0; 3], [f64::NAN, 1.0, 0.0], [f64::INFINITY, 1.0, 0.0]] {
            assert_eq!(unit(v), None, "{v:?}");
        }
    }

    #[test]
    fn near_singular_transforms_are_rejected_by_the_rounding_bound() {
        let turned = Matrix::from_parts([0.0; 3], [0.0, 0.0, 0.382_683_43, 0.923_879_5], [1.0; 3]);
        assert!(turned.rounded().is_some());
        // Two nearly parallel columns: rounding may change the sign of the determinant.
        let sheared = |angle_rad: f64| {
            let mut flat = Matrix::IDENTITY;
            flat.columns[1] = [1.0, angle_rad, 0.0];
            turned.after(&flat).rounded()
        };
        assert!(sheared(1e-5).is_some());
        assert!(sheared(1e-8).is_none());
        // Short but not parallel columns are fine.
        let thin = Matrix::from_parts([0.0; 3], NO_ROTATION, [1.0, 1e-8, 1.0]);
        assert!(turned.after(&thin).rounded().is_some());
    }

    #[test]
    fn transforms_with_overflowing_inverse_are_rejected() {
        let scaled = |scale: f32| Matrix::from_parts([1.0, 0.0, 0.0], NO_ROTATION, [scale; 3]).rounded();
        assert!(scaled(1e-38).is_some());
        assert!(scaled(1e-39).is_none());
        assert!(scaled(1e38).is_some());
        assert!(scaled(f32::INFINITY).is_none());
    }
}
