//! Boxes in rational arithmetic: every finite float is a fraction.

use canted_obb::{Affine, Obb};
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};

pub(crate) type Point = [BigRational; 3];

pub(crate) fn exact(x: f32) -> BigRational {
    BigRational::from_float(x).expect("a finite number")
}

pub(crate) fn exact_point(p: [f32; 3]) -> Point {
    p.map(exact)
}

/// Nearest `f64`, for reports and bounds on sizes.
pub(crate) fn to_f64(x: &BigRational) -> f64 {
    x.to_f64().expect("rationals round to f64")
}

/// A box with the inverse of its frame, by elimination; the library never divides like this.
pub(crate) struct ExactBox {
    center: Point,
    inverse: [[BigRational; 3]; 3],
    half: Point,
}

impl ExactBox {
    pub(crate) fn of(obb: &Obb) -> Self {
        let frame = obb.frame.map(exact_point);
        // Row k of the matrix holds coordinate k of each axis.
        let rows = std::array::from_fn(|k| std::array::from_fn(|a| frame[a][k].clone()));
        Self { center: exact_point(obb.center), inverse: inverted(rows), half: exact_point(obb.half_extents) }
    }

    pub(crate) fn coordinates(&self, p: &Point) -> Point {
        let d: Point = std::array::from_fn(|j| &p[j] - &self.center[j]);
        std::array::from_fn(|k| (0..3).map(|j| &self.inverse[k][j] * &d[j]).sum())
    }

    pub(crate) fn contains(&self, p: &Point) -> bool {
        self.coordinates(p).iter().zip(&self.half).all(|(q, half)| q.abs() <= *half)
    }
}

/// The eight exact corners.
pub(crate) fn corners(obb: &Obb) -> Vec<Point> {
    let frame = obb.frame.map(exact_point);
    (0..8)
        .map(|i| {
            std::array::from_fn(|k| {
                (0..3).fold(exact(obb.center[k]), |sum, a| {
                    let side = &frame[a][k] * exact(obb.half_extents[a]);
                    if i >> a & 1 == 1 { sum + side } else { sum - side }
                })
            })
        })
        .collect()
}

/// The real image of a point.
pub(crate) fn image(map: &Affine, p: &Point) -> Point {
    std::array::from_fn(|k| {
        (0..3).map(|j| exact(map.columns[j][k]) * &p[j]).fold(exact(map.columns[3][k]), |sum, x| sum + x)
    })
}

/// Gauss and Jordan; panics on a singular matrix.
fn inverted(mut rows: [[BigRational; 3]; 3]) -> [[BigRational; 3]; 3] {
    let one = || BigRational::from_integer(BigInt::from(1));
    let mut inverse: [[BigRational; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| if i == j { one() } else { BigRational::zero() }));
    for column in 0..3 {
        let pivot = (column..3).find(|&row| !rows[row][column].is_zero()).expect("an invertible frame");
        rows.swap(column, pivot);
        inverse.swap(column, pivot);
        let scale = one() / &rows[column][column];
        for k in 0..3 {
            rows[column][k] *= &scale;
            inverse[column][k] *= &scale;
        }
        for row in (0..3).filter(|&row| row != column) {
            let factor = rows[row][column].clone();
            for k in 0..3 {
                let (a, b) = (&rows[column][k] * &factor, &inverse[column][k] * &factor);
                rows[row][k] -= a;
                inverse[row][k] -= b;
            }
        }
    }
    inverse
}
