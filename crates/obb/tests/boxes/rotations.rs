//! Rotations out of matrices: the measured failure classes of the source by name, against singular values by Jacobi's method in `f64`.
//! Eigenvectors, against the definition: residual, orthonormality, order.

use canted_obb::vector::{Vector, cross, dot};
use canted_obb::{
    Quaternion,
    eigen::{self, Eigen, FULL_PRECISION, Symmetric},
    rotation::{Extraction, MAX_ITERATIONS, Status, extract},
};
use num_rational::BigRational;
use num_traits::Signed;

use super::common::Random;

type Matrix = [Vector; 3];

/// `a · b`, columns.
fn times(a: Matrix, b: Matrix) -> Matrix {
    b.map(|column| [0, 1, 2].map(|i| (0..3).map(|k| a[k][i] * column[k]).sum()))
}

fn transposed(a: Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|k| a[k][i]))
}

fn diagonal(values: Vector) -> Matrix {
    [[values[0], 0.0, 0.0], [0.0, values[1], 0.0], [0.0, 0.0, values[2]]]
}

/// Trace of `rᵀ a`: what the extraction maximizes.
fn trace(r: Matrix, a: Matrix) -> f64 {
    (0..3).map(|k| dot(r[k], a[k])).sum()
}

/// Whether the matrix mirrors, by exact arithmetic: in `f64` the sign is lost at a condition of 1e8.
fn mirrors(a: Matrix) -> bool {
    let exact = |x: f64| BigRational::from_float(x).expect("a finite number");
    let [x, y, z] = a.map(|column| column.map(exact));
    let minor = |i: usize, j: usize| &x[i] * &y[j] - &x[j] * &y[i];
    (minor(1, 2) * &z[0] + minor(2, 0) * &z[1] + minor(0, 1) * &z[2]).is_negative()
}

/// The greatest trace any rotation has: the singular values' sum, the least one counted negative for a mirror.
///
/// Rotates pairs of columns until all are orthogonal (Hestenes 1958), Jacobi's method on `AᵀA` without squaring.
fn greatest_trace(a: Matrix) -> f64 {
    let mut columns = a;
    for _ in 0..30 {
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let (p, q) = (columns[i], columns[j]);
            let angle = 0.5 * (2.0 * dot(p, q)).atan2(dot(p, p) - dot(q, q));
            let (sin, cos) = angle.sin_cos();
            columns[i] = [0, 1, 2].map(|k| cos * p[k] + sin * q[k]);
            columns[j] = [0, 1, 2].map(|k| cos * q[k] - sin * p[k]);
        }
    }
    let mut values = columns.map(|column| dot(column, column).sqrt());
    values.sort_by(|a, b| b.total_cmp(a));
    values[0] + values[1] + if mirrors(a) { -values[2] } else { values[2] }
}

/// Angle between two rotations, in radians, also where it is small.
fn angle(p: Quaternion, q: Quaternion) -> f64 {
    let rotation = p.conjugate().times(q);
    2.0 * dot([rotation.x, rotation.y, rotation.z], [rotation.x, rotation.y, rotation.z]).sqrt().atan2(rotation.w.abs())
}

/// Noise of torque and trace: the extraction's own, and as much for the oracle.
const NOISE: f64 = 128.0 * f64::EPSILON;

#[track_caller]
fn check(a: Matrix) -> Extraction {
    let found = extract(a, MAX_ITERATIONS);
    let q = found.rotation;
    assert!((q.dot(q) - 1.0).abs() < 8.0 * f64::EPSILON, "{a:?} {found:?}");
    assert_eq!(q, q.canonical());
    assert_ne!(found.status, Status::NotConverged, "{a:?}");
    let greatest = greatest_trace(a);
    let scale = a.iter().flatten().fold(0.0, |s: f64, x| s.max(x.abs()));
    assert!(
        trace(q.columns(), a) >= greatest - NOISE * scale,
        "{a:?} {found:?} lacks {}",
        greatest - trace(q.columns(), a)
    );
    found
}

fn rotations_by_180() -> [Matrix; 4] {
    [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(diagonal)
}

#[test]
fn random_matrices_reach_the_greatest_trace() {
    let mut random = Random(91);
    let mut most = 0;
    for _ in 0..20_000 {
        let found = check([random.vector(), random.vector(), random.vector()]);
        most = most.max(found.iterations);
    }
    assert!(most <= 12, "{most} rotations");
}

#[test]
fn stretched_rotations_are_found_up_to_their_condition() {
    let mut random = Random(92);
    for condition in [1.0_f64, 1e2, 1e4, 1e6, 1e9, 1e12] {
        for values in [
            [1.0, 1.0, 1.0 / condition],
            [1.0, 1.0 / condition, 1.0 / condition],
            [1.0, condition.powf(-0.5), 1.0 / condition],
        ] {
            let mut most = 0;
            for _ in 0..300 {
                let (r, v) = (random.rotation(), random.rotation().columns());
                let a = times(r.columns(), times(v, times(diagonal(values), transposed(v))));
                let found = check(a);
                most = most.max(found.iterations);
                // Noise over the least stiffness, that about the first axis.
                let limit = 8.0 * NOISE / (values[1] + values[2]);
                assert!(angle(found.rotation, r) <= limit, "{values:?}: {} off", angle(found.rotation, r));
                let expected = if mirrors(a) { Status::Reflected } else { Status::Converged };
                assert_eq!(found.status, expected, "{values:?}");
            }
            assert!(most <= 16, "{most} rotations for {values:?}");
        }
    }
}

#[test]
fn every_angle_up_to_180_degrees() {
    let mut random = Random(93);
    for degrees in [0.0_f64, 1e-9, 1.0, 90.0, 120.0, 179.0, 179.999, 180.0 - 1e-9, 180.0] {
        for _ in 0..100 {
            let axis = random.rotation().columns()[0];
            let r = Quaternion::from_axis_angle(axis, degrees.to_radians());
            for stretch in [[1.0; 3], [5.0, 2.0, 0.1]] {
                let found = check(times(r.columns(), diagonal(stretch)));
                assert_eq!(found.status, Status::Converged);
                assert!(angle(found.rotation, r) <= 16.0 * NOISE, "{degrees}° {stretch:?}");
            }
        }
    }
    for rotated_by_180 in rotations_by_180() {
        let found = check(rotated_by_180);
        assert_eq!(found.rotation.columns(), rotated_by_180, "axis-aligned rotations by 180 degrees are exact");
    }
}

#[test]
fn two_frames_nearly_180_degrees_apart() {
    // The matrix of a weighted mean: singular values one and, twice, nearly nothing.
    let mut random = Random(94);
    for short_of_half in [1e-1_f64, 1e-4, 1e-8] {
        for _ in 0..100 {
            let (p, axis) = (random.rotation(), random.rotation().columns()[0]);
            let q = Quaternion::from_axis_angle(axis, std::f64::consts::PI - short_of_half).times(p);
            let halfway = Quaternion::from_axis_angle(axis, 0.5 * (std::f64::consts::PI - short_of_half)).times(p);
            let (a, b) = (p.columns(), q.columns());
            let found = check([0, 1, 2].map(|k| [0, 1, 2].map(|j| 0.5 * (a[k][j] + b[k][j]))));
            assert!(angle(found.rotation, halfway) <= 8.0 * NOISE / short_of_half, "{short_of_half}");
        }
    }
}

#[test]
fn zero_and_rank_one_are_reported() {
    let zero = extract([[0.0; 3]; 3], MAX_ITERATIONS);
    assert_eq!((zero.rotation, zero.status), (Quaternion::IDENTITY, Status::RankDeficient));
    let mut random = Random(95);
    for _ in 0..500 {
        let (u, v) = (random.rotation().columns()[0], random.rotation().columns()[0]);
        for u in [u, v, v.map(|x| -x)] {
            let found = check(v.map(|x| u.map(|y| 3.0 * x * y)));
            assert_eq!(found.status, Status::RankDeficient);
            // The shortest rotation is by the angle between the two directions.
            let shortest = dot(cross(u, v), cross(u, v)).sqrt().atan2(dot(u, v));
            assert!((angle(found.rotation, Quaternion::IDENTITY) - shortest).abs() < NOISE, "{u:?} {v:?}");
        }
    }
}

#[test]
fn rank_two_is_exact() {
    let mut random = Random(96);
    for _ in 0..500 {
        let (u, v) = (random.rotation(), random.rotation());
        let a = times(u.columns(), times(diagonal([2.0, 0.5, 0.0]), transposed(v.columns())));
        let found = check(a);
        // Rounding may leave the third value on either side of zero.
        assert_ne!(found.status, Status::RankDeficient);
        assert!(angle(found.rotation, u.times(v.conjugate())) <= 16.0 * NOISE, "{a:?}");
    }
}

#[test]
fn mirrors_give_proper_rotations() {
    let mut random = Random(97);
    for values in [[3.0, 2.0, -1.0], [1.0, 1.0, -1.0], [1.0, 1.0, -1e-9], [1.0, 1e-9, -1e-9]] {
        for _ in 0..300 {
            let (u, v) = (random.rotation().columns(), random.rotation().columns());
            let found = check(times(u, times(diagonal(values), transposed(v))));
            assert_eq!(found.status, Status::Reflected, "{values:?}");
            assert!(!mirrors(found.rotation.columns()));
        }
    }
}

#[test]
fn scale_changes_no_bit() {
    let mut random = Random(98);
    for _ in 0..300 {
        let a = [random.vector(), random.vector(), random.vector()];
        let found = check(a);
        for exponent in [-300, -40, 40, 300] {
            let scaled = a.map(|column| column.map(|x| x * 2.0_f64.powi(exponent)));
            assert_eq!(extract(scaled, MAX_ITERATIONS), found);
        }
    }
}

#[test]
fn a_rotation_near_the_answer_is_rejected() {
    let mut random = Random(101);
    for _ in 0..100 {
        let a = [random.vector(), random.vector(), random.vector()];
        let nearby = Quaternion::from_axis_angle(random.rotation().columns()[0], 1e-5).times(check(a).rotation);
        assert!(trace(nearby.columns(), a) < greatest_trace(a) - NOISE);
    }
}

#[test]
fn the_iteration_limit_and_non_finite_input_are_reported() {
    let mut random = Random(99);
    let a = [random.vector(), random.vector(), random.vector()];
    assert_eq!(extract(a, 1).status, Status::NotConverged);
    for bad in [f64::NAN, f64::INFINITY] {
        let found = extract([[bad, 0.0, 0.0], [0.0; 3], [0.0; 3]], MAX_ITERATIONS);
        assert_eq!((found.rotation, found.status), (Quaternion::IDENTITY, Status::NotConverged));
    }
}

#[test]
fn quaternions_and_matrices_convert_both_ways() {
    let mut random = Random(100);
    for _ in 0..5_000 {
        let q = random.rotation().canonical();
        let back = Quaternion::from_columns(q.columns());
        assert!(angle(q, back) < 16.0 * f64::EPSILON, "{q:?} {back:?}");
    }
    for [w, x, y, z] in [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [-0.5, 0.5, -0.5, 0.5],
    ] {
        let q = Quaternion { w, x, y, z };
        assert_eq!(Quaternion::from_columns(q.columns()), q.canonical());
    }
}

fn symmetric_times([xx, xy, xz, yy, yz, zz]: Symmetric, v: Vector) -> Vector {
    [dot([xx, xy, xz], v), dot([xy, yy, yz], v), dot([xz, yz, zz], v)]
}

fn greatest(matrix: Symmetric) -> f64 {
    matrix.iter().fold(0.0, |greatest: f64, x| greatest.max(x.abs()))
}

/// Each rotation rounds an entry a few times; six sweeps of three, with a margin of two.
const RESIDUAL: f64 = 128.0 * f64::EPSILON;

#[track_caller]
fn check_eigen(matrix: Symmetric) -> Eigen {
    let eigen = eigen::symmetric(matrix, FULL_PRECISION);
    let [x, y, z] = eigen.vectors;
    for (a, b, expected) in [(x, x, 1.0), (y, y, 1.0), (z, z, 1.0), (x, y, 0.0), (y, z, 0.0), (z, x, 0.0)] {
        assert!((dot(a, b) - expected).abs() <= RESIDUAL, "{matrix:?} {eigen:?}");
    }
    assert!(dot(cross(x, y), z) > 0.0, "right-handed: {matrix:?}");
    assert!(eigen.values.is_sorted_by(|a, b| a >= b), "falling: {eigen:?}");
    for (value, vector) in eigen.values.into_iter().zip(eigen.vectors) {
        let image = symmetric_times(matrix, vector);
        let limit = RESIDUAL * greatest(matrix);
        assert!((0..3).all(|k| (image[k] - value * vector[k]).abs() <= limit), "{matrix:?} {eigen:?}");
    }
    eigen
}

/// `Σ value · axis axisᵀ`.
fn composed(values: Vector, axes: [Vector; 3]) -> Symmetric {
    let entry = |i: usize, j: usize| (0..3).map(|k| values[k] * axes[k][i] * axes[k][j]).sum();
    [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
}

#[test]
fn eigenvectors_of_random_matrices() {
    let mut random = Random(61);
    for _ in 0..20_000 {
        check_eigen(std::array::from_fn(|_| random.signed()));
    }
}

#[test]
fn known_values_are_found_at_any_scale() {
    let mut random = Random(62);
    for values in
        [[3.0, 2.0, 1.0], [1.0, 1e-6, 1e-12], [5.0, 5.0, 1.0], [5.0, 1.0, 1.0], [1.0, 0.0, 0.0], [2.0, 0.0, -3.0]]
    {
        for scale in [1.0, 1e-300, 1e300, 1e-20] {
            for _ in 0..50 {
                let found = check_eigen(composed(values.map(|v| v * scale), random.rotation().columns()));
                let close = |k: usize| (found.values[k] - values[k] * scale).abs() <= RESIDUAL * 5.0 * scale;
                assert!((0..3).all(close), "{values:?} {found:?}");
            }
        }
    }
}

#[test]
fn scale_changes_no_bit_of_the_axes() {
    let mut random = Random(63);
    for _ in 0..200 {
        let matrix: Symmetric = std::array::from_fn(|_| random.signed());
        let axes = check_eigen(matrix).vectors;
        for exponent in [-900, -3, 1000] {
            assert_eq!(check_eigen(matrix.map(|x| x * 2.0_f64.powi(exponent))).vectors, axes);
        }
    }
}

#[test]
fn equal_values_keep_the_axes_of_the_space() {
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    assert_eq!(check_eigen([2.0, 0.0, 0.0, 2.0, 0.0, 2.0]).vectors, identity);
    for empty in [[0.0; 6], [f64::NAN, 0.0, 0.0, 1.0, 0.0, 1.0], [f64::INFINITY; 6]] {
        assert_eq!(eigen::symmetric(empty, FULL_PRECISION), Eigen { values: [0.0; 3], vectors: identity });
    }
}

#[test]
fn tolerance_bounds_the_correlation_left() {
    let mut random = Random(64);
    for tolerance in [0.1, 1e-2, 1e-3, 1e-6, 1e-9] {
        for _ in 0..2_000 {
            let spread = random.vector().map(|x| 10.0_f64.powf(8.0 * x));
            let matrix = composed(spread, random.rotation().columns());
            let Eigen { vectors, .. } = eigen::symmetric(matrix, tolerance);
            for (i, j) in [(0, 1), (0, 2), (1, 2)] {
                let along = |i: usize, j: usize| dot(vectors[i], symmetric_times(matrix, vectors[j]));
                let limit = tolerance * (along(i, i) * along(j, j)).abs().sqrt() + RESIDUAL * greatest(matrix);
                assert!(along(i, j).abs() <= limit, "{tolerance}: {matrix:?}");
            }
        }
    }
}

#[test]
fn a_rotated_eigenvector_is_detected() {
    let mut found = eigen::symmetric([3.0, 0.5, 0.25, 2.0, 0.125, 1.0], FULL_PRECISION);
    found.vectors[0][0] += 1e-12;
    let image = symmetric_times([3.0, 0.5, 0.25, 2.0, 0.125, 1.0], found.vectors[0]);
    assert!((0..3).any(|k| (image[k] - found.values[0] * found.vectors[0][k]).abs() > RESIDUAL * 3.0));
}
