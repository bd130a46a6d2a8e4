//! Extents along fixed directions, against plain loops.

#![allow(clippy::cast_possible_truncation, reason = "test data are rounded on purpose")]

mod common;

use canted_obb::dop::{self, DIRECTIONS, Dop, N_FRAMES};
use canted_obb::{Obb, bound, frame};
use common::clouds::{self, Random};

/// Rounding of a unit direction and a dot product of three terms in `f32`: four roundings to each term, of which the
/// sum of absolute terms is at most √3 times the greatest coordinate.
const ALONG: f64 = 4.0 * 1.733 * f32::EPSILON as f64;

fn unit(k: usize) -> [f64; 3] {
    let direction = DIRECTIONS[k].map(f64::from);
    let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
    direction.map(|x| x / length)
}

#[test]
fn intervals_are_those_of_all_points() {
    for (name, points) in clouds::all() {
        let reach = points.iter().flatten().fold(0.0, |a: f64, &b| a.max(f64::from(b.abs())));
        if !(1e-30..1e37).contains(&reach) {
            continue;
        }
        let dop = Dop::from_points(points.iter().copied());
        for k in 0..DIRECTIONS.len() {
            let along = points.iter().map(|p| (0..3).map(|j| unit(k)[j] * f64::from(p[j])).sum::<f64>());
            let expected = along.fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(x), high.max(x)]);
            let found = dop.interval(k).map(f64::from);
            assert!((0..2).all(|i| (found[i] - expected[i]).abs() <= ALONG * reach), "{name}, direction {k}");
        }
        let (front, back) = points.split_at(points.len() / 2);
        let joined = Dop::from_points(front.iter().copied()).union(&Dop::from_points(back.iter().copied()));
        assert_eq!(joined, dop, "{name}: a union is exactly that of all points");
    }
}

#[test]
fn frames_are_sixteen_rotations_and_the_first_is_the_identity() {
    assert_eq!(dop::frames()[0], Obb::IDENTITY_FRAME);
    for (i, &axes) in dop::frames().iter().enumerate() {
        assert!(frame::is_orthonormal(axes), "{i}");
        assert_eq!(frame::right_handed(axes), axes, "{i}");
        assert!(dop::frames()[..i].iter().all(|&other| other != axes), "{i}");
    }
}

#[test]
fn areas_are_those_of_the_boxes() {
    let mut random = Random(81);
    for _ in 0..50 {
        let scale = random.vector();
        let rotated = random.frame();
        let points: Vec<_> = (0..20).map(|_| clouds::placed(rotated, scale, [0.0; 3], random.vector())).collect();
        let dop = Dop::from_points(points.iter().copied());
        let mut least = f64::MAX;
        for (&axes, area) in dop::frames().iter().zip(dop.areas()) {
            let boxed = bound(axes, points.iter().copied());
            // Six faces, each a product of two extents of up to four.
            assert!((boxed.area() - area).abs() <= 6.0 * 2.0 * 4.0 * 4.0 * ALONG, "{axes:?}");
            least = least.min(area);
        }
        assert_eq!(dop.best().1, least);
    }
}

#[test]
fn empty_sets_and_ties_give_the_identity_frame() {
    assert_eq!(Dop::from_points([[1.0, 2.0, 3.0]]).best(), (Obb::IDENTITY_FRAME, 0.0));
    let dop = Dop::from_points([[1.0, 2.0, 3.0], [2.0, 2.5, 3.5]]);
    assert_eq!(dop.union(&Dop::EMPTY), dop);
    assert_eq!(dop.areas().len(), N_FRAMES);
}

/// Extents of subnormal coordinates underflow; boxes contain their points anyway, decided exactly.
#[test]
fn boxes_of_subnormal_points_contain_them() {
    let mut random = Random(9);
    let mut n_oriented = 0;
    for exponent in [-120, -124, -130, -140, -146, -148] {
        let unit = 2.0_f64.powi(exponent);
        for _ in 0..2_000 {
            // Thin along a diagonal, so that the best frame is not the identity.
            let points: Vec<[f32; 3]> = (0..4)
                .map(|_| {
                    let along = random.signed();
                    [0, 1, 2].map(|_| (unit * (along + 0.05 * random.signed())) as f32)
                })
                .collect();
            let Some(obb) = Dop::from_points(points.iter().copied()).best_box() else { continue };
            n_oriented += 1;
            for &point in &points {
                assert!(obb.contains(point), "2^{exponent}: {obb:?} does not contain {point:?}");
            }
        }
    }
    assert!(n_oriented > 1_000, "{n_oriented}");
}
