//! The rotation in a matrix: that which maximises `trace(Rᵀ A)`, after Müller et al. 2016, made safe.
//!
//! The source turns an estimate `R` by the torque `τ = Σ rᵢ × aᵢ` over `|trace|` until the torque vanishes.
//! Departures, each for a failure that the source has:
//!
//! - The matrix is brought near one by a power of two: the source's guard against zero assumes that size.
//! - The torque also vanishes half a turn away from the answer. What resists a turn, `tr(S)·1 − S` with `S` the
//!   symmetric part of `A Rᵀ`, is negative there, which says so and names the axis of the turn back.
//! - The turn is about `(tr(S)·1 − S)⁻¹ τ` (Newton's direction), by the angle that maximises the trace about that axis:
//!   the trace never falls, and two small singular values take a few turns instead of thousands.
//! - The start is the best of five by trace, not the identity.
//! - Rank one leaves the twist about its direction open: the shortest turn is built directly.

use crate::Quaternion;
use crate::eigen::{self, Eigen};
use crate::frame;
use crate::math::atan2;
use crate::round::{U, binade_inverse};
use crate::vector::{self, Vector, add, cross, dot, scale};

/// What an extraction found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extraction {
    /// The rotation, at length one and canonical.
    pub rotation: Quaternion,
    /// How far it can be trusted.
    pub status: Status,
    /// Turns taken.
    pub iterations: usize,
}

/// How far an extracted rotation can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Status {
    /// The one nearest rotation, up to the rounding of `f64` times the first over the two lesser singular values.
    Converged,
    /// The matrix mirrors: a nearest proper rotation, not the only one where the two lesser singular values are equal.
    Reflected,
    /// The matrix has rank one or zero: of the nearest rotations the shortest, none for zero.
    RankDeficient,
    /// Still turning after the last turn allowed, or the matrix is not finite: use something else.
    NotConverged,
}

/// A cap far above what the tests see; three or four turns are usual.
pub const MAX_ITERATIONS: usize = 64;

/// Rounding of a torque or a resistance, relative to the greatest entry of the matrix.
///
/// Each sums six products with entries of `R` of at most one, themselves off by up to five roundings after two products
/// of quaternions: `6 · (6 + 5)`, to the next power of two.
const NOISE: f64 = 64.0 * U;

/// Second singular value over the first, below which rounding alone would decide the twist.
const RANK_ONE: f64 = 64.0 * U;

/// Extracts the rotation from the matrix with these columns in at most `max_iterations` turns. Never makes NaN.
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
            Step::Turn(turn) => rotation = turn.times(rotation).normalized(),
            Step::Settled { mirrors: true } => return found(rotation, Status::Reflected, iteration),
            Step::Settled { mirrors: false } => return found(rotation, Status::Converged, iteration),
        }
    }
    found(rotation, Status::NotConverged, max_iterations)
}

enum Step {
    Turn(Quaternion),
    Settled { mirrors: bool },
}

/// The turn from the estimate with columns `r` towards `a`, until neither torque nor a saddle is left.
fn step(r: [Vector; 3], a: [Vector; 3], noise: f64) -> Step {
    let torque = (0..3).map(|k| cross(r[k], a[k])).fold([0.0; 3], add);
    let product = |i: usize, j: usize| (0..3).map(|k| a[k][i] * r[k][j]).sum::<f64>();
    let mean = |i, j| 0.5 * (product(i, j) + product(j, i));
    let stretch = [product(0, 0), mean(0, 1), mean(0, 2), product(1, 1), mean(1, 2), product(2, 2)];
    let Eigen { values, vectors } = eigen::symmetric(stretch, eigen::FULL_PRECISION);
    // A turn about a principal axis is resisted by the other two values together, least about the first.
    let resistance = [values[1] + values[2], values[0] + values[2], values[0] + values[1]];
    // Away from the answer a resistance may be negative; its size still scales the turn uphill. A torque of noise about
    // an axis without resistance must not turn at all: where many answers are equal it would never rest.
    let newton = (0..3).map(|k| (k, dot(vectors[k], torque))).filter(|(_, along)| along.abs() > noise);
    let newton = newton.map(|(k, along)| scale(vectors[k], along / resistance[k].abs().max(noise))).fold([0.0; 3], add);
    let axis = match vector::normalized(newton) {
        Some(axis) => axis,
        None if resistance[0] < -noise => vectors[0],
        // At the crest the stretch has the singular values, the least one negative for a mirror. The determinant would
        // lose that sign to rounding long before.
        None => return Step::Settled { mirrors: values[2] < -noise },
    };
    // About one axis the trace is a cosine of the angle; this is its crest.
    let along = vectors.map(|v| dot(v, axis));
    let resisted: f64 = (0..3).map(|k| resistance[k] * along[k] * along[k]).sum();
    Step::Turn(Quaternion::from_axis_angle(axis, atan2(dot(torque, axis), resisted)))
}

/// The axes made orthonormal, no turn, or half a turn about one axis: the greatest trace.
fn best_start(a: [Vector; 3]) -> Quaternion {
    let basis = frame::basis(a[0], a[1]);
    let trace = |r: [Vector; 3]| dot(r[0], a[0]) + dot(r[1], a[1]) + dot(r[2], a[2]);
    let half_turns = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let straight = half_turns.map(|[x, y, z]| [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]]);
    let best = straight.into_iter().fold(basis, |best, r| if trace(r) > trace(best) { r } else { best });
    Quaternion::from_columns(best)
}

/// The shortest turn that takes `v` to `u` for the matrix `s · u vᵀ`.
fn of_rank_one(a: [Vector; 3]) -> Quaternion {
    let longest = (1..3).fold(0, |best, k| if dot(a[k], a[k]) > dot(a[best], a[best]) { k } else { best });
    let u = vector::normalized(a[longest]).unwrap_or(IDENTITY_AXIS);
    let v = vector::normalized(a.map(|column| dot(column, u))).unwrap_or(IDENTITY_AXIS);
    if dot(v, u) >= 0.0 {
        return acute_turn(v, u);
    }
    // Near half a turn the cross product is all rounding: first half a turn about what of it is across `v`, if any.
    let [x, y, z] = frame::basis(v, cross(v, u))[1];
    acute_turn(scale(v, -1.0), u).times(Quaternion { w: 0.0, x, y, z })
}

/// The turn by less than a right angle from `v` to `u`, both of length one.
fn acute_turn(v: Vector, u: Vector) -> Quaternion {
    let [x, y, z] = cross(v, u);
    Quaternion { w: 1.0 + dot(v, u), x, y, z }.normalized()
}

const IDENTITY_AXIS: Vector = [1.0, 0.0, 0.0];

fn greatest_entry(columns: [Vector; 3]) -> f64 {
    columns.iter().map(|&column| vector::reach(column)).fold(0.0, f64::max)
}
