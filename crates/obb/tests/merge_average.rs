//! Averages of two boxes' rotations: signs, symmetries, weights.

#![allow(clippy::cast_possible_truncation, reason = "test data are rounded on purpose")]

mod common;

use canted_obb::merge::{self, Child, Weight};
use canted_obb::{Frame, Obb, Quaternion, frame};
use common::clouds::{Random, placed};
use common::growth::{REFRAMED, assert_contains, growth};

#[test]
fn opposite_quaternions_give_the_same_bits() {
    let mut random = Random(44);
    for _ in 0..500 {
        let (p, q) = (random.rotation(), random.rotation());
        let expected = merge::average_rotations(p, q, [1.0, 3.0]).frame();
        for (p, q) in [(p.scaled(-1.0), q), (p, q.scaled(-1.0)), (p.scaled(-1.0), q.scaled(-1.0))] {
            assert_eq!(merge::average_rotations(p, q, [1.0, 3.0]).frame(), expected);
        }
    }
}

/// The 24 ways to name a box's axes, right-handed, with the half-extents in their order.
fn renamed(obb: &Obb) -> Vec<Obb> {
    let mut all = Vec::new();
    for [x, y, z] in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
        for signs in 0..4 {
            let signed = |k: usize, flip: bool| obb.frame[k].map(|c| if flip { -c } else { c });
            let frame = [signed(x, signs & 1 == 1), signed(y, signs & 2 == 2), obb.frame[z]];
            let third = frame::right_handed(frame);
            all.push(Obb {
                frame: third,
                half_extents: [obb.half_extents[x], obb.half_extents[y], obb.half_extents[z]],
                ..*obb
            });
        }
    }
    all
}

#[test]
fn rotations_by_90_and_180_degrees_are_symmetries() {
    let mut random = Random(45);
    for rotated in [Obb::IDENTITY_FRAME, random.frame(), random.frame(), random.frame()] {
        let obb = Obb { center: [1.0, -2.0, 3.0], frame: rotated, half_extents: [2.0, 0.5, 0.25] };
        let all = renamed(&obb);
        assert_eq!(all.len(), 24);
        for a in &all {
            for b in &all {
                let parent = merge::quaternion(a, b, [1.0, 2.0]);
                assert!(growth(&parent, &obb) <= REFRAMED, "{a:?} and {b:?} to {parent:?}");
            }
        }
        // What averaging without care would make of two such boxes, as a volume.
        let parent = merge::quaternion(&all[0], &all[8], [1.0, 1.0]);
        // Each half-extent may grow by that part of the greatest: the volume by it times 2 · (1/2 + 1/0.5 + 1/0.25).
        assert!((parent.volume() / 2.0 - 1.0).abs() <= 13.0 * REFRAMED, "{}", parent.volume());
    }
}

#[test]
fn the_nearest_symmetry_is_the_nearest_of_all_twenty_four() {
    let mut random = Random(46);
    let all = renamed(&Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [1.0; 3] });
    let symmetries: Vec<Quaternion> = all.iter().map(|obb| Quaternion::from_frame(obb.frame)).collect();
    for _ in 0..2_000 {
        let (p, q) = (random.rotation(), random.rotation());
        let least = symmetries.iter().map(|&g| p.dot(q.times(g)).abs()).fold(0.0, f64::max);
        // Halfway between the two the rotation to either end is half of the least: cos(θ/4) from cos(θ/2).
        let halfway = merge::average_rotations(p, q, [1.0, 1.0]);
        let expected = (0.5 * (1.0 + least)).sqrt();
        assert!((halfway.dot(p) - expected).abs() < 16.0 * f64::EPSILON, "{p:?} {q:?}");
        // No two frames are farther apart than 62.8° once symmetries are counted (Mackenzie 1958).
        assert!(2.0 * least.acos() < 62.81_f64.to_radians());
    }
}

#[test]
fn weights_pull_the_average() {
    let mut random = Random(47);
    for _ in 0..50 {
        let great = Obb { center: [0.0; 3], frame: random.frame(), half_extents: [4.0, 1.0, 0.01] };
        let speck = Obb { center: [1.0, 0.0, 0.0], frame: random.frame(), half_extents: [1e-6; 3] };
        assert!(parallel(merge::average(great.frame, speck.frame, [1e6, 1.0]), great.frame) > 1.0 - 1e-5);
        let evenly = merge::average(great.frame, speck.frame, [0.0, 0.0]);
        assert_eq!(evenly, merge::average(great.frame, speck.frame, [7.0, 7.0]));
        // By area the corners of a speck do not weigh either; by count they rotation the plane towards it.
        let far = Obb { center: placed(great.frame, [1.0; 3], [0.0; 3], [0.0, 3.0, 2.0]), ..speck };
        let axes = |weight| merge::bounded(&Child::Box(great), &Child::Box(far), weight).frame;
        assert!(parallel(axes(Weight::Area), great.frame) > 1.0 - 1e-5);
        assert!(parallel(axes(Weight::Corners), great.frame) < 0.9);
    }
}

/// Least cosine between axes of the same number.
fn parallel(a: Frame, b: Frame) -> f32 {
    (0..3).map(|k| (0..3).map(|j| a[k][j] * b[k][j]).sum::<f32>().abs()).fold(1.0, f32::min)
}

#[test]
fn skewed_and_mirrored_children_merge_by_their_rotations() {
    let mut random = Random(48);
    for _ in 0..50 {
        let [x, y, z] = random.frame();
        let aligned = Obb { center: [0.0; 3], frame: [x, y, z], half_extents: [3.0, 1.0, 0.5] };
        let mirrored = Obb { frame: [x, y, z.map(|c| -c)], ..aligned };
        let stretched = Obb { frame: [x.map(|c| 4.0 * c), y, z], half_extents: [0.75, 1.0, 0.5], ..aligned };
        for other in [mirrored, stretched] {
            let parent = merge::quaternion(&aligned, &other, [1.0, 1.0]);
            assert_contains("skewed", &parent, &[aligned, other]);
            assert!(growth(&parent, &aligned) <= REFRAMED, "{other:?} {parent:?}");
        }
    }
}
