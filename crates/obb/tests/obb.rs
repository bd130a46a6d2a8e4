//! Boxes as a type: exact membership, affine images, sizes.

#![allow(clippy::cast_possible_truncation, reason = "test data are rounded on purpose")]

mod common;

use canted_obb::{Aabb, Affine, Obb, bound};
use common::clouds::{self, Random};
use common::exact::{self, ExactBox};
use proptest::prelude::*;

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
    let frame = obb.frame.map(exact::exact_point);
    let minor = |a: usize, b: usize| &frame[1][a] * &frame[2][b] - &frame[1][b] * &frame[2][a];
    let determinant = &frame[0][0] * minor(1, 2) + &frame[0][1] * minor(2, 0) + &frame[0][2] * minor(0, 1);
    let singular = determinant == exact::exact(0.0);
    let expected = !singular && ExactBox::of(&obb).contains(&exact::exact_point(triple(15)));
    prop_assert_eq!(obb.contains(triple(15)), expected);
    Ok(())
}

#[test]
fn membership_is_exact_on_faces() {
    let mut random = Random(31);
    let mut outside = 0;
    for (_, points) in clouds::all() {
        let obb = bound(random.frame(), points.iter().copied());
        let oracle = ExactBox::of(&obb);
        for corner in obb.corners() {
            // The corner rounded to f32 lies on one side of the face or the other by less than a unit in the last place.
            let point = corner.map(|x| (x as f32).clamp(f32::MIN, f32::MAX));
            let inside = oracle.contains(&exact::exact_point(point));
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
    for (name, points) in clouds::all() {
        let obb = bound(random.frame(), points.iter().copied());
        for map in maps(&mut random) {
            let image = obb.transformed(&map);
            let oracle = ExactBox::of(&image);
            for corner in exact::corners(&obb) {
                assert!(oracle.contains(&exact::image(&map, &corner)), "{name}: {map:?} {obb:?} {image:?}");
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
    let clouds = clouds::all().into_iter().map(|(_, points)| bound(random.frame(), points));
    for obb in clouds.chain([cancelling]) {
        let aabb = obb.aabb();
        if obb.corners().iter().flatten().any(|x| x.abs() > f64::from(f32::MAX)) {
            assert!(aabb.reach() == f32::INFINITY, "{obb:?}");
            continue;
        }
        let ends = [aabb.min, aabb.max].map(exact::exact_point);
        for corner in exact::corners(&obb) {
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
