//! Bounds of the inverse of a map that changes linearly, over an interval of times.
//!
//! Between two maps `P` and `Q`, `M = (1 - τ)·P + τ·Q`. A cofactor of `M` is a polynomial of degree two in τ, the determinant one of
//! degree three. In the Bernstein basis their coefficients are the multilinear forms themselves, with columns taken from
//! `P` and `Q` and averaged, and a polynomial lies between its least and its greatest coefficient (Farin 2002, chapter 5). They are
//! computed from the maps at both ends of the interval, so that rounding is relative to the entries there.

use canted_obb::round::U as U64;

use crate::matrix::Columns;

/// Rounding of a determinant of three columns, and the average of three such, relative to the cube of the greatest entry: 36 of
/// 2⁻⁵³ in the determinant (see `Motion::residual`) and four in the average of terms of at most 6.
const DETERMINANT_ERROR: f64 = 64.0 * U64;

/// Rounding of a cofactor, and the average of two such, relative to the square of the greatest entry.
const COFACTOR_ERROR: f64 = 16.0 * U64;

/// Two maps, and all between them.
pub(super) struct Interval<'a> {
    ends: [&'a Columns; 2],
    /// Greatest entry of the linear parts of both.
    greatest: f64,
}

impl<'a> Interval<'a> {
    pub(super) fn new(start: &'a Columns, end: &'a Columns) -> Self {
        let entries = [start, end].into_iter().flat_map(|map| map[..3].as_flattened());
        Self { ends: [start, end], greatest: entries.fold(0.0, |most, x| most.max(x.abs())) }
    }

    /// A bound of the greatest row sum of the inverse of every map between; infinite where the determinant may be zero.
    ///
    /// `M⁻¹ = adj(M)/det(M)`: the greatest absolute coefficients of the cofactors over the least absolute one of the determinant.
    pub(super) fn bound(&self) -> f64 {
        let greatest = self.greatest;
        let determinants = self.determinants();
        let (least, most) = determinants.iter().fold((f64::MAX, f64::MIN), |(lo, hi), &x| (lo.min(x), hi.max(x)));
        let error = DETERMINANT_ERROR * greatest * greatest * greatest;
        let determinant = least.max(-most) - error;
        if determinant.is_nan() || determinant <= 0.0 {
            return f64::INFINITY;
        }
        let error = COFACTOR_ERROR * greatest * greatest;
        let row = |i: usize| -> f64 { self.cofactors((i + 1) % 3, (i + 2) % 3).iter().map(|x| x + error).sum() };
        // The sums and the quotient take fewer than eight roundings.
        row(0).max(row(1)).max(row(2)) / determinant * (1.0 + 8.0 * U64)
    }

    /// The Bernstein coefficients of the determinant.
    fn determinants(&self) -> [f64; 4] {
        let determinant = |x: usize, y: usize, z: usize| {
            let [a, b, c] = [self.ends[x][0], self.ends[y][1], self.ends[z][2]];
            let normal = cross(b, c);
            a[0] * normal[0] + a[1] * normal[1] + a[2] * normal[2]
        };
        [
            determinant(0, 0, 0),
            (determinant(1, 0, 0) + determinant(0, 1, 0) + determinant(0, 0, 1)) / 3.0,
            (determinant(0, 1, 1) + determinant(1, 0, 1) + determinant(1, 1, 0)) / 3.0,
            determinant(1, 1, 1),
        ]
    }

    /// The greatest absolute Bernstein coefficient of each component of the cross product of two columns: a row of the adjugate.
    fn cofactors(&self, i: usize, j: usize) -> [f64; 3] {
        let [p, q] = self.ends;
        let (first, last) = (cross(p[i], p[j]), cross(q[i], q[j]));
        let (a, b) = (cross(p[i], q[j]), cross(q[i], p[j]));
        std::array::from_fn(|k| first[k].abs().max(last[k].abs()).max((0.5 * (a[k] + b[k])).abs()))
    }
}

fn cross(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
}
