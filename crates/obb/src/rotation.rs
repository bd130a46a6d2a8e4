//! Extracts the rotation from a matrix: the one that maximizes `trace(Rᵀ A)`, after Müller et al. 2016, for any matrix.
//!
//! The source rotates an estimate `R` by the torque `τ = Σ rᵢ × aᵢ` over `|trace|` until the torque vanishes. This
//! implementation differs where the source fails:
//!
//! - The matrix is first scaled to about one by a power of two; the source's guard against zero assumes that size.
//! - The torque also vanishes at 180 degrees from the answer. There `tr(S)·1 − S`, with `S` the symmetric part of `A Rᵀ`,
//!   has a negative eigenvalue; its eigenvector is the axis to rotate about.
//! - Each step rotates about Newton's direction `(tr(S)·1 − S)⁻¹ τ`, by the angle that maximizes the trace about that axis.
//!   The trace never decreases, and two small singular values take a few steps instead of thousands.
//! - The start is the best of five candidates by trace instead of the identity.
//! - A matrix of rank one leaves the rotation about its direction undetermined; the shortest rotation is built directly.

use crate::{
    Quaternion,
    eigen::{self, Eigen},
    frame,
    round::{U, binade_inverse},
    vector::{self, Vector, add, atan2, cross, dot, scale},
};

/// Result of [`extract`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extraction {
    /// The rotation, as a canonical unit quaternion.
    pub rotation: Quaternion,
    /// How accurate it is.
    pub status: Status,
    /// Number of steps.
    pub iterations: usize,
}

/// Accuracy of an extracted rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Status {
    /// The unique nearest rotation, up to `f64` rounding times the ratio of the first to the two smaller singular values.
    Converged,
    /// The matrix mirrors: a nearest proper rotation, not unique where the two smaller singular values are equal.
    Reflected,
    /// The matrix has rank one or zero: the shortest of the nearest rotations; the identity for rank zero.
    RankDeficient,
    /// The iteration limit was reached, or the matrix is not finite: do not use the rotation.
    NotConverged,
}

/// Iteration limit far above what the tests reach; three or four steps are usual.
pub const MAX_ITERATIONS: usize = 64;

/// Rounding of a torque or a stiffness, relative to the greatest entry of the matrix.
///
/// Each sums six products with entries of `R` of at most one, themselves off by up to five roundings after two products
/// of quaternions: `6 · (6 + 5)`, to the next power of two.
const NOISE: f64 = 64.0 * U;

/// Ratio of the second to the first singular value below which rounding decides the rotation about the first axis.
const RANK_ONE: f64 = 64.0 * U;

/// Extracts the rotation from the matrix with these columns in at most `max_iterations` steps. Never returns NaN.
#[must_use]
pub fn extract(columns: [[f64; 3]; 3], max_iterations: usize) -> Extraction {
    let found =
        |rotation: Quaternion, status, iterations| Extraction { rotation: rotation.canonical(), status, iterations };
    if columns.iter().flatten().any(|x| !x.is_finite()) {
        return found(Quaternion::IDENTITY, Status::NotConverged, 0);
    }
    let reach = greatest_entry(columns);
    if reach == 0.0 {
        return found(Quaternion::IDENTITY, Status::RankDeficient, 0);
    }
    let a = columns.map(|column| scale(column, binade_inverse(reach)));
    let cofactors = [cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1])];
    let greatest = greatest_entry(a);
    if greatest_entry(cofactors) <= RANK_ONE * greatest * greatest {
        return found(of_rank_one(a), Status::RankDeficient, 0);
    }
    let noise = NOISE * greatest;
    let mut rotation = best_start(a);
    for iteration in 0..max_iterations {
        match step(rotation.columns(), a, noise) {
            Step::Rotate(step) => rotation = step.times(rotation).normalized(),
            Step::Converged { mirrors: true } => return found(rotation, Status::Reflected, iteration),
            Step::Converged { mirrors: false } => return found(rotation, Status::Converged, iteration),
        }
    }
    found(rotation, Status::NotConverged, max_iterations)
}

enum Step {
    Rotate(Quaternion),
    Converged { mirrors: bool },
}

/// The step from the estimate with columns `r` towards `a`; converged where neither torque nor a saddle remains.
fn step(r: [Vector; 3], a: [Vector; 3], noise: f64) -> Step {
    let torque = (0..3).map(|k| cross(r[k], a[k])).fold([0.0; 3], add);
    let product = |i: usize, j: usize| (0..3).map(|k| a[k][i] * r[k][j]).sum::<f64>();
    let mean = |i, j| 0.5 * (product(i, j) + product(j, i));
    let stretch = [product(0, 0), mean(0, 1), mean(0, 2), product(1, 1), mean(1, 2), product(2, 2)];
    let Eigen { values, vectors } = eigen::symmetric(stretch, eigen::FULL_PRECISION);
    // The stiffness of a rotation about a principal axis is the sum of the other two values, least about the first.
    let stiffness = [values[1] + values[2], values[0] + values[2], values[0] + values[1]];
    // Away from the answer a stiffness may be negative; its absolute value still scales a step uphill. A torque within
    // noise about an axis of zero stiffness is ignored: with many equal answers the iteration would not converge.
    let newton = (0..3).map(|k| (k, dot(vectors[k], torque))).filter(|(_, along)| along.abs() > noise);
    let newton = newton.map(|(k, along)| scale(vectors[k], along / stiffness[k].abs().max(noise))).fold([0.0; 3], add);
    let axis = match vector::normalized(newton) {
        Some(axis) => axis,
        None if stiffness[0] < -noise => vectors[0],
        // At the maximum the stretch has the singular values, the least one negative for a mirroring matrix. The
        // determinant would lose that sign to rounding much earlier.
        None => return Step::Converged { mirrors: values[2] < -noise },
    };
    // About one axis the trace is a cosine of the angle; this is its maximum.
    let along = vectors.map(|v| dot(v, axis));
    let stiffness_along: f64 = (0..3).map(|k| stiffness[k] * along[k] * along[k]).sum();
    Step::Rotate(Quaternion::from_axis_angle(axis, atan2(dot(torque, axis), stiffness_along)))
}

/// The orthonormalized axes, the identity, or 180 degrees about one axis: the greatest trace.
fn best_start(a: [Vector; 3]) -> Quaternion {
    let basis = frame::basis(a[0], a[1]);
    let trace = |r: [Vector; 3]| dot(r[0], a[0]) + dot(r[1], a[1]) + dot(r[2], a[2]);
    let half_turns = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let diagonal = half_turns.map(|[x, y, z]| [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]]);
    let best = diagonal.into_iter().fold(basis, |best, r| if trace(r) > trace(best) { r } else { best });
    Quaternion::from_columns(best)
}

/// The shortest rotation that takes `v` to `u`, for the matrix `s · u vᵀ`.
fn of_rank_one(a: [Vector; 3]) -> Quaternion {
    let longest = (1..3).fold(0, |best, k| if dot(a[k], a[k]) > dot(a[best], a[best]) { k } else { best });
    let u = vector::normalized(a[longest]).unwrap_or(IDENTITY_AXIS);
    let v = vector::normalized(a.map(|column| dot(column, u))).unwrap_or(IDENTITY_AXIS);
    if dot(v, u) >= 0.0 {
        return acute_rotation(v, u);
    }
    // Near 180 degrees the cross product is mostly rounding: first rotate by 180 degrees about its part perpendicular
    // to `v`, if there is one.
    let [x, y, z] = frame::basis(v, cross(v, u))[1];
    acute_rotation(scale(v, -1.0), u).times(Quaternion { w: 0.0, x, y, z })
}

/// The rotation by less than 90 degrees from `v` to `u`, both unit vectors.
fn acute_rotation(v: Vector, u: Vector) -> Quaternion {
    let [x, y, z] = cross(v, u);
    Quaternion { w: 1.0 + dot(v, u), x, y, z }.normalized()
}

const IDENTITY_AXIS: Vector = [1.0, 0.0, 0.0];

fn greatest_entry(columns: [Vector; 3]) -> f64 {
    columns.iter().map(|&column| vector::reach(column)).fold(0.0, f64::max)
}
