use crate::Obb;
use crate::eigen::{self, Symmetric};
use crate::frame::Frame;
use crate::vector::{self, Vector, cross, sub};

/// Weight, mean and scatter matrix of points or surfaces, for principal component analysis; merged in constant time.
///
/// The scatter is measured about the mean, so it stays accurate far from the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    /// Number of points, or area in square scene units.
    pub weight: f64,
    /// Weighted mean, in the space of the points.
    pub mean: [f64; 3],
    /// Weighted sum of `(x − mean)(x − mean)ᵀ`.
    pub scatter: Symmetric,
}

impl Moments {
    /// No points, the identity of [`Moments::merged`].
    pub const EMPTY: Self = Self { weight: 0.0, mean: [0.0; 3], scatter: [0.0; 6] };

    /// A point of weight one.
    #[inline]
    #[must_use]
    pub fn from_point(point: impl Into<[f32; 3]>) -> Self {
        Self { weight: 1.0, mean: vector::to_f64(point.into()), scatter: [0.0; 6] }
    }

    /// Points of weight one each, in one pass (Welford 1962).
    #[must_use]
    pub fn from_points(points: impl IntoIterator<Item = impl Into<[f32; 3]>>) -> Self {
        points.into_iter().fold(Self::EMPTY, |moments, point| moments.merged(&Self::from_point(point)))
    }

    /// A triangle's surface, weighted by its area (Gottschalk et al. 1996, with the authors' errata).
    ///
    /// The second moment of a triangle about its mean is a twelfth of its area times the sum over its three corners. A
    /// degenerate triangle has weight zero.
    #[inline]
    #[must_use]
    pub fn from_triangle(corners: [[f32; 3]; 3]) -> Self {
        let [a, b, c] = corners.map(vector::to_f64);
        let (ab, ac) = (sub(b, a), sub(c, a));
        let weight = 0.5 * vector::length(cross(ab, ac));
        // Measured from the first corner, the mean is a third of the two edges.
        let to_mean = vector::scale(vector::add(ab, ac), 1.0 / 3.0);
        let mut scatter = [0.0; 6];
        for corner in [[0.0; 3], ab, ac] {
            add_square(&mut scatter, sub(corner, to_mean), weight / 12.0);
        }
        Self { weight, mean: vector::add(a, to_mean), scatter }
    }

    /// The eight corners of a box with a total of `weight`, in closed form.
    #[inline]
    #[must_use]
    pub fn from_box_corners(corners: &Obb, weight: f64) -> Self {
        let mut scatter = [0.0; 6];
        for k in 0..3 {
            let side = vector::scale(vector::to_f64(corners.frame[k]), f64::from(corners.half_extents[k]));
            add_square(&mut scatter, side, weight);
        }
        Self { weight, mean: vector::to_f64(corners.center), scatter }
    }

    /// Moments of both sets together, by the parallel-axis theorem (Chan, Golub, LeVeque 1979). A set of weight zero
    /// changes nothing.
    #[inline]
    #[must_use]
    pub fn merged(&self, other: &Self) -> Self {
        if other.weight == 0.0 {
            return *self;
        }
        if self.weight == 0.0 {
            return *other;
        }
        let weight = self.weight + other.weight;
        let fraction = other.weight / weight;
        let apart = sub(other.mean, self.mean);
        let mut scatter: Symmetric = core::array::from_fn(|i| self.scatter[i] + other.scatter[i]);
        add_square(&mut scatter, apart, self.weight * fraction);
        Self { weight, mean: vector::add(self.mean, vector::scale(apart, fraction)), scatter }
    }

    /// Principal axes, longest first, orthonormal and right-handed; `tolerance` as in [`eigen::symmetric`].
    #[inline]
    #[must_use]
    pub fn axes(&self, tolerance: f64) -> Frame {
        eigen::symmetric(self.scatter, tolerance).vectors.map(vector::to_f32)
    }
}

/// `scatter += weight · v vᵀ`.
#[inline]
fn add_square(scatter: &mut Symmetric, v: Vector, weight: f64) {
    let [x, y, z] = vector::scale(v, weight);
    let square = [x * v[0], x * v[1], x * v[2], y * v[1], y * v[2], z * v[2]];
    for (sum, term) in scatter.iter_mut().zip(square) {
        *sum += term;
    }
}
