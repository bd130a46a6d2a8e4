//! Intervals that contain projections, rounded outward.
//!
//! # Error
//! Let u = 2^-53. Products of two f32 are exact in f64. The sum of three is off by at most 2.01 u·Σ|terms|, the length of a
//! direction by 2.1 u, its product with a radius by 3.2 u, and the end of the interval by one more rounding: in all less
//! than 4.3 u·(Σ|terms| + r·|d|), so [`EXTENT_ERROR`] covers it, its own rounding and that of its subtraction.

use canted_obb::Aabb;
use canted_obb::round::{down, up};
use canted_trace::ReferencePoint;

/// See the module.
pub(super) const EXTENT_ERROR: f64 = 4.0 * f64::EPSILON;

/// The interval of `direction·x` over all points within `radius` of `points`, of their convex hull too; rounded outward.
///
/// One point makes a sphere, two a capsule, four a flat or solid shape. No points give the empty interval.
#[must_use]
pub fn extent_of_points(points: impl IntoIterator<Item = [f32; 3]>, radius: f32, direction: [f32; 3]) -> [f32; 2] {
    let d = direction.map(f64::from);
    let reach = f64::from(radius) * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
    let (mut lo, mut hi) = (f64::MAX, f64::MIN);
    for point in points {
        let terms: [f64; 3] = std::array::from_fn(|k| d[k] * f64::from(point[k]));
        let at = terms[0] + terms[1] + terms[2];
        let error = EXTENT_ERROR * (terms[0].abs() + terms[1].abs() + terms[2].abs() + reach);
        lo = lo.min(at - reach - error);
        hi = hi.max(at + reach + error);
    }
    [down(lo), up(hi)]
}

/// As [`extent_of_points`], over balls of different radii (center and radius) and their convex hull. Centers may be off by
/// three roundings of f64, which the error covers four times over.
#[inline]
pub(super) fn extent_of_balls<const N: usize>(balls: &[[f64; 4]; N], direction: [f32; 3]) -> [f32; 2] {
    let Projected { at, reach, size } = Projected::of(balls, direction);
    let (mut lo, mut hi) = (f64::MAX, f64::MIN);
    for i in 0..N {
        let error = 4.0 * EXTENT_ERROR * size[i];
        lo = lo.min(at[i] - reach[i] - error);
        hi = hi.max(at[i] + reach[i] + error);
    }
    [down(lo), up(hi)]
}

/// Centers and radii as [`extent_of_balls`] takes them.
#[inline]
pub(super) fn balls_of<const N: usize>(centers: &[[f32; 3]; N], radii: &[f32; N]) -> [[f64; 4]; N] {
    let mut balls = [[0.0; 4]; N];
    for (ball, (&[x, y, z], &radius)) in balls.iter_mut().zip(centers.iter().zip(radii)) {
        *ball = [f64::from(x), f64::from(y), f64::from(z), f64::from(radius)];
    }
    balls
}

/// Balls along a direction, in arrays, which compilers put into lanes.
struct Projected<const N: usize> {
    at: [f64; N],
    reach: [f64; N],
    /// Sums of absolute terms, the reach too.
    size: [f64; N],
}

impl<const N: usize> Projected<N> {
    #[inline]
    fn of(balls: &[[f64; 4]; N], direction: [f32; 3]) -> Self {
        let [a, b, c] = direction;
        let d = [f64::from(a), f64::from(b), f64::from(c)];
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        let mut projected = Self { at: [0.0; N], reach: [0.0; N], size: [0.0; N] };
        for (i, [x, y, z, radius]) in balls.iter().enumerate() {
            let (terms, reach) = ([d[0] * x, d[1] * y, d[2] * z], radius * length);
            projected.at[i] = terms[0] + terms[1] + terms[2];
            projected.reach[i] = reach;
            projected.size[i] = terms[0].abs() + terms[1].abs() + terms[2].abs() + reach;
        }
        projected
    }
}

/// As [`extent_of_points`], over the balls of a cubic curve, given its control balls (center and radius): of the four quarters of the curve, whose
/// hulls are tighter than that of its own. Both ends of the interval of a ball are cubic polynomials of its parameter.
///
/// Six means follow one another, each with a rounding: the error covers them, too.
pub(super) fn extent_of_cubic(balls: &[[f64; 4]; 4], direction: [f32; 3]) -> [f32; 2] {
    let Projected { at, reach, size } = Projected::of(balls, direction);
    let (mut ends, mut greatest) = ([[0.0; 2]; 4], 0.0_f64);
    for i in 0..4 {
        ends[i] = [reach[i] - at[i], at[i] + reach[i]];
        greatest = greatest.max(size[i]);
    }
    let error = 4.0 * EXTENT_ERROR * greatest;
    let [low, high] = greatest_of_quarters(ends);
    [down(-low - error), up(high + error)]
}

/// The greatest control values of the quarters of two cubic polynomials with these.
#[inline]
fn greatest_of_quarters(whole: [[f64; 2]; 4]) -> [f64; 2] {
    // As one instruction, without a rule for NaN.
    let either = |a: f64, b: f64| if a > b { a } else { b };
    let greater = |a: [f64; 2], b: [f64; 2]| [either(a[0], b[0]), either(a[1], b[1])];
    let mid = |a: [f64; 2], b: [f64; 2]| [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
    // What is new in the halves.
    let inner = |[a, b, c, d]: [[f64; 2]; 4]| {
        let (ab, bc, cd) = (mid(a, b), mid(b, c), mid(c, d));
        let (abc, bcd) = (mid(ab, bc), mid(bc, cd));
        [ab, abc, mid(abc, bcd), bcd, cd]
    };
    let [a, b, c, d] = whole;
    let (ends, within) = (greater(a, d), greater(b, c));
    // Along most directions a curve reaches farthest at an end. No mean of these is greater than all of them, since rounding is monotonic.
    if within[0] <= ends[0] && within[1] <= ends[1] {
        return ends;
    }
    let [ab, abc, middle, bcd, cd] = inner(whole);
    let mut greatest = greater(ends, middle);
    for half in [[a, ab, abc, middle], [middle, bcd, cd, d]] {
        for value in inner(half) {
            greatest = greater(greatest, value);
        }
    }
    greatest
}

/// The interval of `direction·x` over a box, rounded outward.
#[must_use]
pub fn extent_of_box(aabb: &Aabb, direction: [f32; 3]) -> [f32; 2] {
    let [lo, hi] = unrounded_extent_of_box(aabb, direction);
    [down(lo), up(hi)]
}

/// As [`extent_of_box`], not rounded to f32 yet.
#[inline]
pub(super) fn unrounded_extent_of_box(aabb: &Aabb, direction: [f32; 3]) -> [f64; 2] {
    let (mut lo, mut hi, mut size) = ([0.0; 3], [0.0; 3], 0.0);
    for k in 0..3 {
        let [a, b] = [aabb.min[k], aabb.max[k]].map(|x| f64::from(direction[k]) * f64::from(x));
        (lo[k], hi[k]) = if b < a { (b, a) } else { (a, b) };
        size += a.abs().max(b.abs());
    }
    let error = EXTENT_ERROR * size;
    [lo[0] + lo[1] + lo[2] - error, hi[0] + hi[1] + hi[2] + error]
}

/// The box around all points within `radius` of `points`, rounded outward; [`Aabb::EMPTY`] for none, and NaN, which builds
/// reject, where a coordinate is NaN.
#[must_use]
pub fn bounds_of_points(points: impl IntoIterator<Item = [f32; 3]>, radius: f32) -> Aabb {
    let mut has_nan = false;
    let aabb = Aabb::from_points(points.into_iter().inspect(|point| has_nan |= point.iter().any(|x| x.is_nan())));
    if has_nan {
        return Aabb { min: [f32::NAN; 3], max: [f32::NAN; 3] };
    }
    if aabb.is_empty() {
        return aabb;
    }
    Aabb { min: aabb.min.map(|x| -sum_up(-x, radius)), max: aabb.max.map(|x| sum_up(x, radius)) }
}

/// An interval along `direction`, relative to a point; rounded outward.
pub(super) fn moved_extent([lo, hi]: [f32; 2], direction: [f32; 3], reference: ReferencePoint) -> [f32; 2] {
    if reference.is_origin() {
        return [lo, hi];
    }
    let terms: [f64; 3] = std::array::from_fn(|k| f64::from(direction[k]) * f64::from(reference.point()[k]));
    let at = terms[0] + terms[1] + terms[2];
    let (lo, hi) = (f64::from(lo), f64::from(hi));
    let error = EXTENT_ERROR * (terms[0].abs() + terms[1].abs() + terms[2].abs() + lo.abs().max(hi.abs()));
    [down(lo - at - error), up(hi - at + error)]
}

/// An f32 that is not below the real number `a + b`.
fn sum_up(a: f32, b: f32) -> f32 {
    let (a, b) = (f64::from(a), f64::from(b));
    let sum = a + b;
    // The rounding error of the sum (Knuth 1969).
    let b_part = sum - a;
    let error = (a - (sum - b_part)) + (b - b_part);
    up(if error > 0.0 { sum.next_up() } else { sum })
}
