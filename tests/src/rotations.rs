//! Independent rotation extraction: the paper's listing, and singular values.

use canted_obb::{
    Quaternion,
    vector::{Vector, cross, dot},
};
use num_rational::BigRational;
use num_traits::Signed;

/// A matrix by columns.
pub type Matrix = [Vector; 3];

/// `a · b`.
#[must_use]
pub fn times(a: Matrix, b: Matrix) -> Matrix {
    b.map(|column| [0, 1, 2].map(|i| (0..3).map(|k| a[k][i] * column[k]).sum()))
}

/// Rows as columns.
#[must_use]
pub fn transposed(a: Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|k| a[k][i]))
}

/// The matrix with these values on its diagonal.
#[must_use]
pub fn diagonal([x, y, z]: Vector) -> Matrix {
    [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]]
}

/// Angle between two rotations, in radians, also where it is small.
#[must_use]
pub fn angle_rad(p: Quaternion, q: Quaternion) -> f64 {
    let turn = p.conjugate().times(q);
    2.0 * dot([turn.x, turn.y, turn.z], [turn.x, turn.y, turn.z]).sqrt().atan2(turn.w.abs())
}

/// The guard of the listing's division by the trace, and the angle in radians at which it stops.
const GUARD: f64 = 1e-9;

/// The iteration of Müller et al. 2016: starts with the identity and rotates by `τ / (|trace| + 1e-9)` until that is shorter
/// than 1e-9 or `most` iterations are done. Returns the rotation and the number of iterations.
///
/// Listings differ in the position of the guard. In the denominator it dominates the trace of a matrix below about 1e-12,
/// whose steps are then too short; see [`as_copied`].
#[must_use]
pub fn as_listed(a: Matrix, most: usize) -> (Quaternion, usize) {
    listed(a, most, |trace| 1.0 / (trace + GUARD))
}

/// [`as_listed`] as in copies of the paper's code: the step is `τ · (1 / |trace| + 1e-9)`.
///
/// That divides by a zero trace, and makes steps too long for a matrix above about 1e12.
#[must_use]
pub fn as_copied(a: Matrix, most: usize) -> (Quaternion, usize) {
    listed(a, most, |trace| 1.0 / trace + GUARD)
}

/// The iteration with either guard.
fn listed(a: Matrix, most: usize, reciprocal: fn(f64) -> f64) -> (Quaternion, usize) {
    let mut q = Quaternion::IDENTITY;
    for turns in 0..most {
        let r = q.columns();
        let torque = (0..3).map(|k| cross(r[k], a[k])).fold([0.0; 3], |sum, x| [0, 1, 2].map(|k| sum[k] + x[k]));
        let trace: f64 = (0..3).map(|k| dot(r[k], a[k])).sum();
        let omega = torque.map(|x| x * reciprocal(trace.abs()));
        let angle = dot(omega, omega).sqrt();
        if angle < GUARD {
            return (q, turns);
        }
        q = Quaternion::from_axis_angle(omega.map(|x| x / angle), angle).times(q).normalized();
    }
    (q, most)
}

/// Sweeps of [`svd`]: three suffice for full precision unless values differ by many orders of magnitude.
const SWEEPS: usize = 30;

/// The polar rotation `U Vᵀ`; for a reflection, with the least singular direction reversed.
#[must_use]
pub fn svd_polar(a: Matrix) -> Quaternion {
    svd(a).0
}

/// The greatest `trace(Rᵀ a)` of any rotation: the sum of the singular values, with the least one negated for a reflection.
#[must_use]
pub fn greatest_trace(a: Matrix) -> f64 {
    let [first, second, third] = svd(a).1;
    first + second + if mirrors(a) { -third } else { third }
}

/// The polar rotation and the singular values, descending, by rotating pairs of columns until all are orthogonal (Hestenes
/// 1958): Jacobi's method on `AᵀA` without squaring.
fn svd(a: Matrix) -> (Quaternion, Vector) {
    let (mut columns, mut v) = (a, diagonal([1.0; 3]));
    for _ in 0..SWEEPS {
        let mut is_done = true;
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let (p, q) = (columns[i], columns[j]);
            let (pq, pp, qq) = (dot(p, q), dot(p, p), dot(q, q));
            // Dot products of three terms are no more accurate.
            if pq.abs() <= 4.0 * f64::EPSILON * (pp * qq).sqrt() {
                continue;
            }
            is_done = false;
            let (sin, cos) = (0.5 * (2.0 * pq).atan2(pp - qq)).sin_cos();
            let turn = |m: &mut Matrix| {
                let (p, q) = (m[i], m[j]);
                m[i] = [0, 1, 2].map(|k| cos * p[k] + sin * q[k]);
                m[j] = [0, 1, 2].map(|k| cos * q[k] - sin * p[k]);
            };
            turn(&mut columns);
            turn(&mut v);
        }
        if is_done {
            break;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| dot(columns[j], columns[j]).total_cmp(&dot(columns[i], columns[i])));
    let values = order.map(|k| dot(columns[k], columns[k]).sqrt());
    let [first, second, _] = order;
    let unit = |x: Vector| x.map(|component| component / dot(x, x).sqrt());
    // Only the sign of the third direction is open, and a proper rotation determines it.
    let (u_0, u_1) = (unit(columns[first]), unit(columns[second]));
    let u = [u_0, u_1, cross(u_0, u_1)];
    let v = [v[first], v[second], cross(v[first], v[second])];
    (Quaternion::from_columns(times(u, transposed(v))), values)
}

/// Whether a matrix is a reflection, in exact arithmetic: in `f64` the sign is lost at a condition of 1e8.
#[must_use]
pub fn mirrors(a: Matrix) -> bool {
    let exact = |x: f64| BigRational::from_float(x).expect("a finite number");
    let [x, y, z] = a.map(|column| column.map(exact));
    let minor = |i: usize, j: usize| &x[i] * &y[j] - &x[j] * &y[i];
    (minor(1, 2) * &z[0] + minor(2, 0) * &z[1] + minor(0, 1) * &z[2]).is_negative()
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;

    use super::*;
    use crate::clouds::random_rotation;

    #[test]
    fn both_recover_the_rotation_of_a_stretched_matrix() {
        let mut rng = SplitMix64::new(1);
        for _ in 0..200 {
            let turn = Quaternion::from_axis_angle(random_rotation(&mut rng).columns()[0], 2.0 * rng.unit());
            let v = random_rotation(&mut rng).columns();
            let a = times(turn.columns(), times(v, times(diagonal([3.0, 2.0, 1.0]), transposed(v))));
            let (polar, trace) = (svd_polar(a), greatest_trace(a));
            assert!(angle_rad(polar, turn) < 1e-14 && (trace - 6.0).abs() < 1e-13, "{a:?}");
            assert!(angle_rad(as_listed(a, 1000).0, turn) < 1e-8, "{a:?}");
            assert!(angle_rad(as_copied(a, 1000).0, turn) < 1e-8, "{a:?}");
        }
    }

    #[test]
    fn each_guard_fails_at_a_different_scale() {
        let turn = Quaternion::from_axis_angle([0.0, 0.6, 0.8], 1.0);
        let scaled = |exponent: i32| {
            let scale = 2.0f64.powi(exponent);
            turn.columns().map(|column| column.map(|x| scale * x))
        };
        let error = |iterate: fn(Matrix, usize) -> (Quaternion, usize), exponent| {
            angle_rad(iterate(scaled(exponent), 1000).0, turn)
        };
        assert!(error(as_listed, -300) > 0.9 && error(as_listed, 300) < 1e-8);
        let too_far = error(as_copied, 300);
        assert!(error(as_copied, -300) < 1e-8 && (too_far.is_nan() || too_far > 0.1));
        assert!(as_copied(diagonal([0.0; 3]), 1000).0.w.is_nan());
    }

    #[test]
    fn the_listing_stops_early_at_a_half_turn() {
        let half = diagonal([1.0, -1.0, -1.0]);
        let (q, turns) = as_listed(half, 1000);
        assert_eq!((q, turns), (Quaternion::IDENTITY, 0));
        assert!(angle_rad(svd_polar(half), Quaternion { w: 0.0, x: 1.0, y: 0.0, z: 0.0 }) < 1e-15);
    }
}
