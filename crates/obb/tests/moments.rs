//! Moments, against sums in another form.

#![allow(clippy::cast_possible_truncation, reason = "test data are rounded on purpose")]

mod common;

use canted_obb::{Moments, Obb};
use common::clouds::{self, Random};
use common::exact::{exact, exact_point, to_f64};
use num_rational::BigRational;
use num_traits::Zero;

/// Mean and scatter of points in rational arithmetic.
fn exactly(points: &[[f32; 3]]) -> ([f64; 3], [f64; 6]) {
    let n = exact(points.len() as f32);
    let points: Vec<_> = points.iter().map(|&p| exact_point(p)).collect();
    let mean: [BigRational; 3] = std::array::from_fn(|k| points.iter().map(|p| &p[k]).sum::<BigRational>() / &n);
    let entry = |i: usize, j: usize| {
        let sum = points.iter().fold(BigRational::zero(), |sum, p| sum + (&p[i] - &mean[i]) * (&p[j] - &mean[j]));
        to_f64(&sum)
    };
    let scatter = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
    (mean.map(|x| to_f64(&x)), scatter)
}

/// Differences relative to the greatest entry, or to the square of the rounding of coordinates where that is more.
#[track_caller]
fn assert_close(name: &str, found: &Moments, mean: [f64; 3], scatter: [f64; 6]) {
    let reach = mean.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let spread = scatter.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    // One rounding a point for the mean and a few for the scatter; the mean's own rounding enters by its product with
    // the spread.
    let n = found.weight;
    let coordinate = (n + 8.0) * f64::EPSILON * (reach + (spread / n).sqrt());
    let limit = (n + 8.0) * 4.0 * f64::EPSILON * spread + 4.0 * coordinate * (n * spread).sqrt();
    assert!((0..3).all(|k| (found.mean[k] - mean[k]).abs() <= coordinate), "{name}: {found:?} {mean:?}");
    assert!((0..6).all(|k| (found.scatter[k] - scatter[k]).abs() <= limit), "{name}: {found:?} {scatter:?}");
}

#[test]
fn points_in_any_order_of_merging() {
    for (name, points) in clouds::all() {
        if points.iter().flatten().any(|x| x.abs() > 1e30) {
            continue;
        }
        let (mean, scatter) = exactly(&points);
        assert_close(&name, &Moments::from_points(points.iter().copied()), mean, scatter);
        let mut parts: Vec<Moments> = points.iter().map(|&p| Moments::from_point(p)).collect();
        while parts.len() > 1 {
            parts = parts.chunks(2).map(|pair| pair[1..].iter().fold(pair[0], |a, b| a.merged(b))).collect();
        }
        assert_close(&name, &parts[0], mean, scatter);
    }
}

#[test]
fn a_triangle_equals_the_quadrature_of_its_midpoints() {
    let mut random = Random(71);
    for _ in 0..200 {
        let corners: [[f32; 3]; 3] = std::array::from_fn(|_| random.vector().map(|x| x as f32));
        let found = Moments::from_triangle(corners);
        let [a, b, c] = corners.map(|p| p.map(f64::from));
        // The rule of three edge midpoints, each a third of the area, is exact for polynomials of degree two.
        let midpoints = [(a, b), (b, c), (c, a)].map(|(p, q)| [0, 1, 2].map(|k| 0.5 * (p[k] + q[k])));
        let mean = [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0);
        let entry = |i: usize, j: usize| {
            midpoints.iter().map(|m| (m[i] - mean[i]) * (m[j] - mean[j])).sum::<f64>() * found.weight / 3.0
        };
        let scatter = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
        let heron = {
            let side = |p: [f64; 3], q: [f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
            let (x, y, z) = (side(a, b), side(b, c), side(c, a));
            ((x + y + z) * (x + y - z) * (y + z - x) * (z + x - y)).sqrt() / 4.0
        };
        assert!((found.weight - heron).abs() < 1e-9, "{corners:?}");
        assert!((0..3).all(|k| (found.mean[k] - mean[k]).abs() <= 4.0 * f64::EPSILON), "{corners:?}");
        assert!((0..6).all(|k| (found.scatter[k] - scatter[k]).abs() <= 32.0 * f64::EPSILON), "{corners:?}");
    }
}

#[test]
fn corners_of_a_box_in_closed_form() {
    let mut random = Random(72);
    for _ in 0..100 {
        let obb = Obb {
            center: [1.0, 2.0, -3.0],
            frame: random.frame(),
            half_extents: random.vector().map(|x| x.abs() as f32),
        };
        let found = Moments::from_box_corners(&obb, 8.0);
        let corners = obb.corners();
        let entry =
            |i: usize, j: usize| corners.iter().map(|c| (c[i] - found.mean[i]) * (c[j] - found.mean[j])).sum::<f64>();
        let scatter = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
        assert!((0..6).all(|k| (found.scatter[k] - scatter[k]).abs() <= 64.0 * f64::EPSILON), "{obb:?}");
    }
}

#[test]
fn no_points_have_weight_zero() {
    let point = Moments::from_point([1.0, 2.0, 3.0]);
    let needle = Moments::from_triangle([[0.0; 3], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]]);
    assert_eq!(needle.weight, 0.0);
    for nothing in [Moments::EMPTY, needle] {
        assert_eq!(point.merged(&nothing), point);
        assert_eq!(nothing.merged(&point), point);
    }
    assert_eq!(Moments::EMPTY.axes(1e-6), Obb::IDENTITY_FRAME);
}
