//! Eigenvectors, against the definition: residual, orthonormality, order.

mod common;

use canted_obb::eigen::{self, Eigen, FULL_PRECISION, Symmetric};
use common::clouds::Random;

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn times([xx, xy, xz, yy, yz, zz]: Symmetric, v: Vector) -> Vector {
    [dot([xx, xy, xz], v), dot([xy, yy, yz], v), dot([xz, yz, zz], v)]
}

fn greatest(matrix: Symmetric) -> f64 {
    matrix.iter().fold(0.0, |greatest: f64, x| greatest.max(x.abs()))
}

/// Each rotation rounds an entry a few times; six sweeps of three, with a margin of two.
const RESIDUAL: f64 = 128.0 * f64::EPSILON;

#[track_caller]
fn check(matrix: Symmetric) -> Eigen {
    let eigen = eigen::symmetric(matrix, FULL_PRECISION);
    let [x, y, z] = eigen.vectors;
    for (a, b, expected) in [(x, x, 1.0), (y, y, 1.0), (z, z, 1.0), (x, y, 0.0), (y, z, 0.0), (z, x, 0.0)] {
        assert!((dot(a, b) - expected).abs() <= RESIDUAL, "{matrix:?} {eigen:?}");
    }
    assert!(dot(cross(x, y), z) > 0.0, "right-handed: {matrix:?}");
    assert!(eigen.values.is_sorted_by(|a, b| a >= b), "falling: {eigen:?}");
    for (value, vector) in eigen.values.into_iter().zip(eigen.vectors) {
        let image = times(matrix, vector);
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
fn random_matrices() {
    let mut random = Random(61);
    for _ in 0..20_000 {
        check(std::array::from_fn(|_| random.signed()));
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
                let found = check(composed(values.map(|v| v * scale), random.rotation().columns()));
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
        let axes = check(matrix).vectors;
        for exponent in [-900, -3, 1000] {
            assert_eq!(check(matrix.map(|x| x * 2.0_f64.powi(exponent))).vectors, axes);
        }
    }
}

#[test]
fn equal_values_keep_the_axes_of_the_space() {
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    assert_eq!(check([2.0, 0.0, 0.0, 2.0, 0.0, 2.0]).vectors, identity);
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
                let along = |i: usize, j: usize| dot(vectors[i], times(matrix, vectors[j]));
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
    let image = times([3.0, 0.5, 0.25, 2.0, 0.125, 1.0], found.vectors[0]);
    assert!((0..3).any(|k| (image[k] - found.values[0] * found.vectors[0][k]).abs() > RESIDUAL * 3.0));
}
