//! Boxes as a type: exact membership, affine images, sizes. Boxes along given axes contain what they bound, by exact arithmetic.

use canted_obb::{Aabb, Affine, Enclosure, Frame, Obb, bound, bound_boxes};
use proptest::prelude::*;

use super::common::{self, ExactBox, Random, all_clouds, corners, exact_point, to_f64};

fn any_finite() -> impl Strategy<Value = f32> {
    any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |x| x.is_finite())
}

fn near_one() -> impl Strategy<Value = f32> {
    prop_oneof![-2.0_f32..2.0, (-3_i8..4).prop_map(f32::from)]
}

proptest! {
    #[test]
    fn membership_is_exact_for_any_bits(bits in prop::array::uniform18(any_finite())) {
        agrees(&bits)?;
    }

    #[test]
    fn membership_is_exact_for_small_integers_and_fractions(bits in prop::array::uniform18(near_one())) {
        agrees(&bits)?;
    }
}

/// Center, frame, half-extents and point from eighteen numbers.
fn agrees(x: &[f32; 18]) -> Result<(), TestCaseError> {
    let triple = |i: usize| [x[i], x[i + 1], x[i + 2]];
    let obb =
        Obb { center: triple(0), frame: [triple(3), triple(6), triple(9)], half_extents: triple(12).map(f32::abs) };
    let frame = obb.frame.map(exact_point);
    let minor = |a: usize, b: usize| &frame[1][a] * &frame[2][b] - &frame[1][b] * &frame[2][a];
    let determinant = &frame[0][0] * minor(1, 2) + &frame[0][1] * minor(2, 0) + &frame[0][2] * minor(0, 1);
    let singular = determinant == common::exact(0.0);
    let expected = !singular && ExactBox::of(&obb).contains(&exact_point(triple(15)));
    prop_assert_eq!(obb.contains(triple(15)), expected);
    Ok(())
}

#[test]
fn membership_is_exact_on_faces() {
    let mut random = Random(31);
    let mut outside = 0;
    for (_, points) in all_clouds() {
        let obb = bound(random.frame(), points.iter().copied());
        let oracle = ExactBox::of(&obb);
        for corner in obb.corners() {
            // The corner rounded to f32 lies on one side of the face or the other by less than a unit in the last place.
            let point = corner.map(|x| (x as f32).clamp(f32::MIN, f32::MAX));
            let inside = oracle.contains(&exact_point(point));
            outside += usize::from(!inside);
            assert_eq!(obb.contains(point), inside, "{point:?} {obb:?}");
        }
    }
    assert!(outside > 100, "corners should fall on both sides");
}

#[test]
fn a_singular_frame_contains_nothing() {
    let flat =
        Obb { center: [0.0; 3], frame: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]], half_extents: [1.0; 3] };
    assert!(!flat.contains([0.0; 3]));
}

/// Rigid, scaled, mirrored, sheared, flattened, and to nothing.
fn maps(random: &mut Random) -> Vec<Affine> {
    let [x, y, z] = random.frame();
    let offset = random.vector().map(|c| 1e3 * c as f32);
    let shear = [0, 1, 2].map(|k| z[k] + 5.0 * x[k]);
    let times = |axis: [f32; 3], s: f32| axis.map(|c| c * s);
    [
        [x, y, z],
        [times(x, 1e3), y, times(z, 1e-3)],
        [times(x, -1.0), y, z],
        [x, y, shear],
        [x, y, [0.0; 3]],
        [x, x, x],
        [[0.0; 3]; 3],
    ]
    .map(|[x, y, z]| Affine { columns: [x, y, z, offset] })
    .to_vec()
}

#[test]
fn images_of_boxes_are_contained() {
    let mut random = Random(32);
    for (name, points) in all_clouds() {
        let obb = bound(random.frame(), points.iter().copied());
        for map in maps(&mut random) {
            let image = obb.transformed(&map);
            let oracle = ExactBox::of(&image);
            for corner in corners(&obb) {
                assert!(oracle.contains(&common::image(&map, &corner)), "{name}: {map:?} {obb:?} {image:?}");
            }
        }
    }
}

/// How much area a box of 4 x 2 x 0.5 may gain where its center is moved to coordinates below 1024, relative.
///
/// They are rounded by 2⁻¹⁵, by `ε = √3 · 2⁻¹⁵` in all, and each half-extent grows by so much: the area by `2·(4 + 2 + 0.5)/11` of
/// it. The rest is for the frame, which is rounded twice by 2⁻²⁵ an entry.
const MOVED_ERROR: f64 = 1.25 * 1.7321 / 32_768.0;

#[test]
fn a_rigid_motion_keeps_the_size() {
    let mut random = Random(33);
    for _ in 0..100 {
        let obb = Obb { center: [1.0, 2.0, 3.0], frame: random.frame(), half_extents: [4.0, 2.0, 0.5] };
        let moved = obb.transformed(&maps(&mut random)[0]);
        assert!((moved.area() / obb.area() - 1.0).abs() <= MOVED_ERROR, "{obb:?} {moved:?}");
    }
}

#[test]
fn aabb_contains_the_exact_corners() {
    let mut random = Random(35);
    let cancelling = Obb {
        center: [1e7; 3],
        frame: [[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        half_extents: [1e7, 0.1, 1e7],
    };
    let clouds = all_clouds().into_iter().map(|(_, points)| bound(random.frame(), points));
    for obb in clouds.chain([cancelling]) {
        let aabb = obb.aabb();
        if obb.corners().iter().flatten().any(|x| x.abs() > f64::from(f32::MAX)) {
            assert!(aabb.reach() == f32::INFINITY, "{obb:?}");
            continue;
        }
        let ends = [aabb.min, aabb.max].map(exact_point);
        for corner in corners(&obb) {
            assert!((0..3).all(|k| ends[0][k] <= corner[k] && corner[k] <= ends[1][k]), "{obb:?} {aabb:?}");
        }
    }
}

#[test]
fn the_layout_is_fifteen_floats_in_order() {
    let obb = Obb {
        center: [1.0, 2.0, 3.0],
        frame: [[4.0, 5.0, 6.0], [7.0, 8.0, 9.0], [10.0, 11.0, 12.0]],
        half_extents: [13.0, 14.0, 15.0],
    };
    let numbers: &[f32] = bytemuck::cast_slice(std::slice::from_ref(&obb));
    assert!(numbers.iter().copied().eq((1..16_u8).map(f32::from)));
}

#[test]
fn sizes_of_skewed_boxes_are_those_of_parallelepipeds() {
    let frame = [[2.0, 0.0, 0.0], [1.0, 3.0, 0.0], [0.0, 1.0, -4.0]];
    let obb = Obb { center: [7.0; 3], frame, half_extents: [1.0, 0.5, 0.25] };
    // Edges (4,0,0), (1,3,0), (0,0.5,-2): faces 12, √(36+4+0.25), √(64+4).
    let area = 2.0 * (12.0 + (36.0_f64 + 4.0 + 0.25).sqrt() + (64.0_f64 + 4.0).sqrt());
    assert!((obb.area() - area).abs() <= 8.0 * f64::EPSILON * area);
    assert_eq!(obb.volume(), 24.0);
}

#[test]
fn or_aabb_compares_areas_and_ties_go_to_the_aligned_box() {
    let square = Aabb { min: [0.0; 3], max: [1.0, 1.0, 0.0] };
    let rotated_by_180 = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let tie = Obb { center: [0.5, 0.5, 0.0], frame: rotated_by_180, half_extents: [0.5, 0.5, 0.0] };
    assert_eq!(tie.or_aabb(&square).frame, Obb::IDENTITY_FRAME);
    // Flat boxes have no volume; by area the lesser one stays.
    let strip = Obb { half_extents: [0.5, 0.25, 0.0], ..tie };
    assert_eq!(strip.or_aabb(&square), strip);
}

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
    for (name, points) in all_clouds() {
        for frame in frames(&mut random) {
            let bounded = bound(frame, points.iter().copied());
            let oracle = ExactBox::of(&bounded);
            for &point in &points {
                assert!(oracle.contains(&exact_point(point)), "{name}: {point:?} outside {bounded:?}");
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
    for (name, points) in all_clouds() {
        let child = bound(random.frame(), points.iter().copied());
        let skewed = Affine { columns: std::array::from_fn(|_| random.vector().map(|x| x as f32)) };
        let sheared = child.transformed(&skewed);
        for frame in frames(&mut random) {
            let parent = bound_boxes(frame, [&child, &sheared]);
            let oracle = ExactBox::of(&parent);
            for corner in corners(&child).iter().chain(&corners(&sheared)) {
                assert!(oracle.contains(corner), "{name}: {child:?} and {sheared:?} in {parent:?}");
            }
        }
    }
}

#[test]
fn aligned_boxes_are_contained() {
    let mut random = Random(5);
    for (name, points) in all_clouds() {
        let aabb = Aabb::from_points(points.iter().copied());
        let aligned = ExactBox::of(&Obb::from_aabb(&aabb));
        let mut enclosure = Enclosure::new(random.frame(), points[0]);
        enclosure.add_aabb(&aabb);
        enclosure.add_aabb(&Aabb::EMPTY);
        let rotated = ExactBox::of(&enclosure.finish());
        for corner in aabb.corners().map(exact_point) {
            assert!(aligned.contains(&corner), "{name}");
            assert!(rotated.contains(&corner), "{name}");
        }
    }
}

/// Whether every point is inside, exactly.
fn contains_all(candidate: &Obb, points: &[[f32; 3]]) -> bool {
    let oracle = ExactBox::of(candidate);
    points.iter().all(|&point| oracle.contains(&exact_point(point)))
}

#[test]
fn a_half_extent_one_unit_in_the_last_place_too_small_is_detected() {
    let mut random = Random(6);
    let unit_cube: Vec<[f32; 3]> = Aabb { min: [-1.0; 3], max: [1.0; 3] }.corners().to_vec();
    let mut n_tight = 0;
    for (_, points) in all_clouds().into_iter().chain([("cube".to_owned(), unit_cube)]) {
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
    for (name, points) in all_clouds() {
        let frame = random.frame();
        let bounded = bound(frame, points.iter().copied());
        let oracle = ExactBox::of(&bounded);
        for k in 0..3 {
            let reached = points.iter().map(|&p| to_f64(&oracle.coordinates(&exact_point(p))[k]).abs());
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
