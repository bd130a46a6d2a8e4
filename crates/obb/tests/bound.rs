//! Boxes along given axes contain what they bound, by exact arithmetic.

#![allow(clippy::cast_possible_truncation, reason = "test data are rounded on purpose")]

mod common;

use canted_obb::{Aabb, Affine, Enclosure, Frame, Obb, bound, bound_boxes};
use common::clouds::{self, Random};
use common::exact::{self, ExactBox};
use proptest::prelude::*;

/// Rotations, skews, scaled and mirrored axes, and frames that must be refused.
fn frames(random: &mut Random) -> Vec<Frame> {
    let aligned = Obb::IDENTITY_FRAME;
    let rotated = random.frame();
    let sheared = [rotated[0], rotated[1], [0, 1, 2].map(|k| rotated[2][k] + 3.0 * rotated[0][k])];
    let scaled = [rotated[0].map(|x| 1e-12 * x), rotated[1].map(|x| 3e8 * x), rotated[2].map(|x| -x)];
    let needle = [[1.0, 0.0, 0.0], [1.0, 1e-4, 0.0], [0.0, 1.0, 1.0]];
    let singular = [rotated[0], rotated[1], rotated[0]];
    vec![aligned, rotated, random.frame(), sheared, scaled, needle, singular, [[0.0; 3]; 3], [[f32::NAN; 3]; 3]]
}

#[test]
fn every_cloud_in_every_frame_is_contained() {
    let mut random = Random(3);
    for (name, points) in clouds::all() {
        for frame in frames(&mut random) {
            let bounded = bound(frame, points.iter().copied());
            let oracle = ExactBox::of(&bounded);
            for &point in &points {
                assert!(oracle.contains(&exact::exact_point(point)), "{name}: {point:?} outside {bounded:?}");
                assert!(bounded.contains(point), "{name}: the library's test must agree");
            }
        }
    }
}

proptest! {
    #[test]
    fn points_of_any_bits_in_frames_of_any_rotation(
        seed in any::<u64>(),
        bits in prop::collection::vec(prop::array::uniform3(any::<u32>()), 1..12),
    ) {
        let points: Vec<[f32; 3]> = bits.into_iter().map(|p| p.map(f32::from_bits)).collect();
        prop_assume!(points.iter().flatten().all(|x| x.is_finite()));
        let bounded = bound(Random(seed).frame(), points.iter().copied());
        prop_assert!(contains_all(&bounded, &points), "{bounded:?}");
    }
}

#[test]
fn boxes_are_contained_with_their_exact_corners() {
    let mut random = Random(4);
    for (name, points) in clouds::all() {
        let child = bound(random.frame(), points.iter().copied());
        let skewed = Affine { columns: std::array::from_fn(|_| random.vector().map(|x| x as f32)) };
        let sheared = child.transformed(&skewed);
        for frame in frames(&mut random) {
            let parent = bound_boxes(frame, [&child, &sheared]);
            let oracle = ExactBox::of(&parent);
            for corner in exact::corners(&child).iter().chain(&exact::corners(&sheared)) {
                assert!(oracle.contains(corner), "{name}: {child:?} and {sheared:?} in {parent:?}");
            }
        }
    }
}

#[test]
fn aligned_boxes_are_contained() {
    let mut random = Random(5);
    for (name, points) in clouds::all() {
        let aabb = Aabb::from_points(points.iter().copied());
        let aligned = ExactBox::of(&Obb::from_aabb(&aabb));
        let mut enclosure = Enclosure::new(random.frame(), points[0]);
        enclosure.add_aabb(&aabb);
        enclosure.add_aabb(&Aabb::EMPTY);
        let rotated = ExactBox::of(&enclosure.finish());
        for corner in aabb.corners().map(exact::exact_point) {
            assert!(aligned.contains(&corner), "{name}");
            assert!(rotated.contains(&corner), "{name}");
        }
    }
}

/// Whether every point is inside, exactly.
fn contains_all(candidate: &Obb, points: &[[f32; 3]]) -> bool {
    let oracle = ExactBox::of(candidate);
    points.iter().all(|&point| oracle.contains(&exact::exact_point(point)))
}

#[test]
fn a_half_extent_one_unit_in_the_last_place_too_small_is_detected() {
    let mut random = Random(6);
    let unit_cube: Vec<[f32; 3]> = Aabb { min: [-1.0; 3], max: [1.0; 3] }.corners().to_vec();
    let mut n_tight = 0;
    for (_, points) in clouds::all().into_iter().chain([("cube".to_owned(), unit_cube)]) {
        let aligned = Obb::from_aabb(&Aabb::from_points(points.iter().copied()));
        let rotated = bound(random.frame(), points.iter().copied());
        for tight in [aligned, rotated] {
            assert!(contains_all(&tight, &points));
            for k in (0..3).filter(|&k| tight.half_extents[k] > 0.0) {
                let mut shrunk = tight;
                shrunk.half_extents[k] = shrunk.half_extents[k].next_down();
                let lost = !contains_all(&shrunk, &points);
                n_tight += usize::from(lost);
                // The library's own test sees the same loss.
                assert_eq!(lost, points.iter().any(|&point| !shrunk.contains(point)));
            }
        }
    }
    // Not every box is tight to the last place: the pad may reach over a rounding.
    assert!(n_tight > 300, "only {n_tight} shrunk boxes lost a point");
}

#[test]
fn boxes_are_tight() {
    let mut random = Random(7);
    for (name, points) in clouds::all() {
        let frame = random.frame();
        let bounded = bound(frame, points.iter().copied());
        let oracle = ExactBox::of(&bounded);
        for k in 0..3 {
            let reached = points.iter().map(|&p| exact::to_f64(&oracle.coordinates(&exact::exact_point(p))[k]).abs());
            let reached = reached.fold(0.0, f64::max);
            // Rounded up once to f32, after a pad of 17 u · ρ · (D + D'): with rows of at most √3, content of at most six
            // half-extents and the center within √3 of them, below 2⁻⁴⁵ of the greatest half-extent.
            let extent = bounded.half_extents.iter().fold(0.0, |a: f32, &b| a.max(b));
            let limit = (reached + f64::from(extent) / 2.0_f64.powi(45)) as f32;
            assert!(bounded.half_extents[k] <= limit.next_up(), "{name}: {reached:e} {bounded:?}");
        }
    }
}

#[test]
fn points_and_aligned_boxes_get_no_padding() {
    let mut random = Random(8);
    for _ in 0..100 {
        let point = random.vector().map(|x| 1e7 * x as f32);
        let bounded = bound(random.frame(), [point; 5]);
        assert_eq!((bounded.center, bounded.half_extents), (point, [0.0; 3]));
    }
    let wall = Obb::from_aabb(&Aabb { min: [2.5, 0.0, -1.0], max: [2.5, 4.0, 3.0] });
    assert_eq!((wall.center, wall.half_extents), ([2.5, 2.0, 1.0], [0.0, 2.0, 2.0]));
}
