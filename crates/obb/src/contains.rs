use core::cmp::Ordering;

use crate::Obb;
use crate::expansion::ExactSum;
use crate::round::U;
use crate::vector::{self, Vector};

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
