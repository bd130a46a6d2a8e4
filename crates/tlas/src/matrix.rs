//! Affine maps in `f64`: inverses, norms and condition numbers.

/// Greatest supported condition number of a transform: 2^20 leaves four of the 24 bits of an `f32` coordinate.
pub const MAX_CONDITION: f64 = 1_048_576.0;

/// Columns of an affine map.
pub(crate) type Columns = [[f64; 3]; 4];

/// Rows of an affine map, each with its translation last.
pub(crate) type Rows = [[f64; 4]; 3];

/// ‖M‖·‖M⁻¹‖; infinite if the inverse is not finite.
pub(crate) fn condition(forward: f64, backward: f64) -> f64 {
    if backward.is_finite() { forward * backward } else { f64::INFINITY }
}

/// Greatest row sum of absolute values of the linear part of an affine map, given by its rows with the translation last.
/// Infinite if an entry is not finite.
#[must_use]
pub fn row_sum_norm(rows: &[[f64; 4]; 3]) -> f64 {
    // The computed inverse of a matrix of rank one is all NaN, and `f64::max` ignores NaN.
    if !rows.iter().flatten().all(|x| x.is_finite()) {
        return f64::INFINITY;
    }
    rows.iter().map(|row| row[..3].iter().map(|x| x.abs()).sum()).fold(0.0, f64::max)
}

/// Rows of the inverse map, by cofactors in `f64`; not finite if the matrix is singular.
#[inline]
pub(crate) fn invert(columns: &Columns) -> Rows {
    let [a, b, c, origin] = *columns;
    let cross =
        |p: [f64; 3], q: [f64; 3]| [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let reciprocal = 1.0 / dot(a, cross(b, c));
    [cross(b, c), cross(c, a), cross(a, b)].map(|row| {
        let row = row.map(|x| x * reciprocal);
        [row[0], row[1], row[2], -dot(row, origin)]
    })
}
