//! Eigenvalues and eigenvectors of symmetric 3x3 matrices.

use crate::{
    round::{U, binade_inverse},
    vector::{self, Vector, sqrt},
};

/// Upper triangle of a symmetric matrix: `xx, xy, xz, yy, yz, zz`.
pub type Symmetric = [f64; 6];

/// The smallest useful tolerance: a rotation for less would change no diagonal entry in `f64`.
pub const FULL_PRECISION: f64 = U;

/// Tolerance for the box of every node of a BVH: much faster than full precision, and the average box area hardly grows
/// (measured in `benches/TRIED.md`, under fitting).
pub const COARSE: f64 = 1e-2;

/// Eigenvalues in descending order, and unit eigenvectors as a right-handed frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eigen {
    /// Eigenvalues, greatest first.
    pub values: [f64; 3],
    /// Eigenvectors of length one, right-handed, in the order of the values.
    pub vectors: [[f64; 3]; 3],
}

/// Maximum number of sweeps. Convergence is quadratic, so it is not reached in practice.
const MAX_SWEEPS: usize = 12;

/// Rounding of an entry in a rotation, relative to the greatest entry: two products, their sum, and cosine and sine.
const NEGLIGIBLE: f64 = 4.0 * U;

/// Eigenvalues and eigenvectors of a symmetric matrix (cyclic Jacobi, 1846).
///
/// Stops once every off-diagonal entry is at most `tolerance` times the geometric mean of the two diagonal entries that
/// it couples. For a scatter matrix that is the remaining correlation of two axes, and about the fraction by which the
/// thinner of the two extents may exceed the optimum; for a positive definite matrix small eigenvalues become as accurate
/// as large ones (Demmel and Veselić 1992). Entries below the rounding of the greatest count as zero.
///
/// Works at any scale up to 1e±300. Axes rotate only to remove an off-diagonal entry, so equal eigenvalues keep the
/// coordinate axes. A zero matrix, or one that is not finite, gives the identity frame and zeros.
#[must_use]
pub fn symmetric(matrix: Symmetric, tolerance: f64) -> Eigen {
    let reach = matrix.iter().fold(0.0, |reach: f64, x| reach.max(x.abs()));
    let mut vectors: [Vector; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    if !(reach > 0.0 && matrix.iter().all(|x| x.is_finite())) {
        return Eigen { values: [0.0; 3], vectors };
    }
    let unit = binade_inverse(reach);
    let [xx, xy, xz, yy, yz, zz] = matrix.map(|x| x * unit);
    let mut diagonal = [xx, yy, zz];
    // Entry k couples the two axes other than k.
    let mut coupling = [yz, xz, xy];
    let floor = NEGLIGIBLE * reach * unit;
    let (square, floor) = (tolerance * tolerance, floor * floor);
    for _ in 0..MAX_SWEEPS {
        let rotated = rotate::<0, 1, 2>(&mut diagonal, &mut coupling, &mut vectors, square, floor)
            | rotate::<0, 2, 1>(&mut diagonal, &mut coupling, &mut vectors, square, floor)
            | rotate::<1, 2, 0>(&mut diagonal, &mut coupling, &mut vectors, square, floor);
        if !rotated {
            break;
        }
    }
    sorted(diagonal.map(|x| x / unit), vectors)
}

/// Rotates axes `P` and `Q` about axis `R` to remove their coupling (one Jacobi rotation).
#[inline]
fn rotate<const P: usize, const Q: usize, const R: usize>(
    diagonal: &mut Vector,
    coupling: &mut Vector,
    vectors: &mut [Vector; 3],
    square: f64,
    floor: f64,
) -> bool {
    let coupled = coupling[R];
    if coupled * coupled <= square * (diagonal[P] * diagonal[Q]).abs() + floor {
        return false;
    }
    // With d the difference of the diagonal and b twice the coupling, tan 2φ = b/d; the smaller of the two angles has
    // the tangent b / (|d| + √(d² + b²)), with the sign of d.
    let difference = diagonal[Q] - diagonal[P];
    let twice = 2.0 * coupled;
    let adjacent = difference.abs() + sqrt(difference * difference + twice * twice);
    let opposite = if difference < 0.0 { -twice } else { twice };
    let reciprocal = 1.0 / sqrt(adjacent * adjacent + opposite * opposite);
    let (cos, sin) = (adjacent * reciprocal, opposite * reciprocal);
    let change = opposite / adjacent * coupled;
    diagonal[P] -= change;
    diagonal[Q] += change;
    coupling[R] = 0.0;
    // The couplings of P and Q with R: entry Q couples P with R.
    let (with_p, with_q) = (coupling[Q], coupling[P]);
    coupling[Q] = cos * with_p - sin * with_q;
    coupling[P] = sin * with_p + cos * with_q;
    let (p, q) = (vectors[P], vectors[Q]);
    for k in 0..3 {
        vectors[P][k] = cos * p[k] - sin * q[k];
        vectors[Q][k] = sin * p[k] + cos * q[k];
    }
    true
}

/// Descending order; equal values keep their order. The frame stays right-handed.
fn sorted(mut values: Vector, mut vectors: [Vector; 3]) -> Eigen {
    for (a, b) in [(0, 1), (1, 2), (0, 1)] {
        if values[a] < values[b] {
            values.swap(a, b);
            vectors.swap(a, b);
            // A swap mirrors the frame; negating one of the two undoes that.
            vectors[b] = vector::scale(vectors[b], -1.0);
        }
    }
    Eigen { values, vectors }
}
