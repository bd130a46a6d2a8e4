//! Where a body is.

use canted_obb::Affine;
use canted_obb::vector::{Vector, cross, dot, scale, to_f64};

/// Where a body is: an affine map to the space of a query, in `f64`. It may rotate, scale, mirror and shear.
///
/// # Rounding
/// The identity keeps coordinates as they are. Another pose maps each vertex once, in `f64`: `((a·x + b·y) + c·z) + d` for each coordinate,
/// and queries are answered for these points. A coordinate below 2^-250 in magnitude becomes zero, so that signs of volumes are exact.
///
/// A body under a pose with a number that is not finite, or exceeds 2^200, touches nothing and is infinitely far away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Images of the three axes, then the image of the origin.
    pub columns: [[f64; 3]; 4],
}

/// Coordinates below are zero.
const LEAST: f64 = f64::from_bits((1023 - 250) << 52);

/// Greatest number of a pose.
const GREATEST: f64 = f64::from_bits((1023 + 200) << 52);

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl From<Affine> for Pose {
    fn from(map: Affine) -> Self {
        Self { columns: map.columns.map(to_f64) }
    }
}

impl Pose {
    /// The identity.
    pub const IDENTITY: Self = Self { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]] };

    /// The pose that adds `shift` to points.
    #[must_use]
    pub fn translation(shift: [f64; 3]) -> Self {
        let [x, y, z, _] = Self::IDENTITY.columns;
        Self { columns: [x, y, z, shift] }
    }

    /// The pose with these rows of a 3x4 matrix, the translation last.
    #[must_use]
    pub fn from_rows(rows: [[f64; 4]; 3]) -> Self {
        Self { columns: std::array::from_fn(|j| rows.map(|row| row[j])) }
    }

    /// Whether queries can use it: every number is finite and at most 2^200 in magnitude.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.columns.as_flattened().iter().all(|x| x.abs() <= GREATEST)
    }

    /// Image of a point.
    #[inline]
    #[must_use]
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        if *self == Self::IDENTITY { p } else { self.point_f64(p).map(|x| if x.abs() < LEAST { 0.0 } else { x }) }
    }

    /// Image of a point in `f64`, without the rounding to zero.
    #[inline]
    pub(crate) fn point_f64(&self, p: Vector) -> Vector {
        let linear = self.vector(p);
        std::array::from_fn(|k| linear[k] + self.columns[3][k])
    }

    /// Image of a direction.
    #[inline]
    pub(crate) fn vector(&self, v: Vector) -> Vector {
        let [x, y, z, _] = &self.columns;
        std::array::from_fn(|k| x[k] * v[0] + y[k] * v[1] + z[k] * v[2])
    }

    /// Root of the sum of the squares of the linear part: no direction is stretched by more.
    pub(crate) fn norm(&self) -> f64 {
        let [x, y, z, _] = self.columns;
        (dot(x, x) + dot(y, y) + dot(z, z)).sqrt()
    }

    /// The columns of the linear part over their norm, so that no product overflows; `None` for a map to a point.
    fn scaled(&self) -> Option<([Vector; 3], f64)> {
        let [x, y, z, _] = self.columns;
        let norm = self.norm();
        (norm > 0.0).then(|| ([x, y, z].map(|column| scale(column, 1.0 / norm)), norm))
    }

    /// At most the least stretch of the map; that of a similarity, but for rounding.
    pub(crate) fn least_stretch(&self) -> f64 {
        if *self == Self::IDENTITY {
            return 1.0;
        }
        let Some((columns, norm)) = self.scaled() else { return 0.0 };
        let [x, y, z] = columns;
        // The product of the singular values, over the square of the greatest.
        let stretch = dot(x, cross(y, z)).abs() / squared_norm(&columns);
        stretch * norm
    }

    /// Columns of the matrix that maps normals of planes, divided by a bound of its spectral norm; zero for a map to a line.
    pub(crate) fn of_normals(&self) -> [Vector; 3] {
        let Some(([x, y, z], _)) = self.scaled() else { return [[0.0; 3]; 3] };
        let columns = [cross(y, z), cross(z, x), cross(x, y)];
        let bound = squared_norm(&columns).sqrt() * (1.0 + 64.0 * f64::EPSILON);
        if bound > 0.0 { columns.map(|column| scale(column, 1.0 / bound)) } else { [[0.0; 3]; 3] }
    }
}

/// At least the square of the spectral norm: the greatest row sum of the product with the transpose.
fn squared_norm(columns: &[Vector; 3]) -> f64 {
    let row_sum = |a: Vector| columns.iter().map(|&b| dot(a, b).abs()).sum::<f64>();
    columns.iter().map(|&column| row_sum(column)).fold(0.0, f64::max)
}
