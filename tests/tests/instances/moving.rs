//! Instances that move while the shutter is open are hit at each time as if they stood still at that position.
//!
//! Transforms and times have so few bits that every interpolated transform is exact in `f32`. A still instance with that
//! transform is the same input bit for bit, so all oracles of still instances apply.

use canted_bvh2::Bvh2;
use canted_fixtures::{Rotation, SplitMix64};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::Affine;
use canted_tlas::{Instance, InstanceError, MAX_CONDITION, Tlas, TopConfig};
use canted_trace::{Intersect, Ray, TriangleTest};

use super::{
    geometry::{check_hit, reaches},
    queries::loop_over_all,
    setup::{Altered, affine, binary_top, blas_of, build, meshes, rays},
};

fn top() -> TopConfig {
    binary_top(VolumeConfig { strategy: Strategy::Dop, fallback: true })
}

/// One of 1025 times, of ten bits.
fn time(rng: &mut SplitMix64) -> f32 {
    f32::from(u16::try_from(rng.below(1025)).unwrap()) / 1024.0
}

/// The linear part rounded to multiples of 2⁻⁶ of `unit`, which thirteen bits can represent.
fn coarse(map: &Affine, unit: f32) -> Affine {
    let [x, y, z, shift] = map.columns;
    let [x, y, z] = [x, y, z].map(|column| column.map(|c| (c * 64.0).round() / 64.0 * unit));
    Affine { columns: [x, y, z, shift] }
}

/// The exact transform at a time; panics if `f32` cannot represent it.
fn at([open, close]: &[Affine; 2], time: f32) -> Affine {
    let mut map = *open;
    for (j, column) in map.columns.iter_mut().enumerate() {
        for (k, number) in column.iter_mut().enumerate() {
            let (from, to) = (f64::from(open.columns[j][k]), f64::from(close.columns[j][k]));
            let exact = from + f64::from(time) * (to - from);
            let rounded = exact as f32;
            assert_eq!(f64::from(rounded), exact, "column {j} row {k} at {time}");
            *number = rounded;
        }
    }
    map
}

/// Motions of each kind: start and end.
fn motions() -> Vec<(&'static str, [Affine; 2])> {
    let turn = Rotation::off_axis();
    let about_z =
        |angle: f64, scale: [f64; 3], shift: [f32; 3]| affine(&Rotation::euler(0.0, 0.0, angle), scale, shift);
    let quarter = std::f64::consts::FRAC_PI_2;
    let shear = |a: f32, b: f32| Affine { columns: [[1.0, 0.0, 0.0], [a, 1.0, 0.0], [b, 0.5, 1.0], [0.25, 0.0, 0.5]] };
    let motion = |unit: f32, open: Affine, close: Affine| [coarse(&open, unit), coarse(&close, unit)];
    let far = [10_000_000.0, -10_000_000.0, 3_000_000.0];
    let beyond = far.map(|x| x + 3.0 * 1024.0);
    vec![
        ("translation", motion(1.0, affine(&turn, [1.0; 3], [0.0; 3]), affine(&turn, [1.0; 3], [3.0, -2.0, 1.0]))),
        ("quarter turn", motion(1.0, about_z(0.0, [1.0; 3], [0.0; 3]), about_z(quarter, [1.0; 3], [0.0; 3]))),
        (
            "rotation and translation",
            motion(1.0, about_z(0.3, [1.0; 3], [1.0, 0.0, 0.0]), about_z(1.1, [1.0; 3], [0.0, 2.0, 0.5])),
        ),
        ("mirrored", motion(1.0, about_z(0.2, [-1.0, 1.0, 1.0], [0.5; 3]), about_z(1.4, [-1.0, 1.0, 2.0], [-0.5; 3]))),
        ("sheared", motion(1.0, shear(0.5, -0.25), shear(-1.0, 2.0))),
        ("unequal growth", motion(1.0, affine(&turn, [0.5; 3], [0.0; 3]), affine(&turn, [3.0, 1.0, 8.0], [1.0; 3]))),
        ("small", motion(1.0 / 1024.0, about_z(0.0, [1.0; 3], [0.5; 3]), about_z(1.0, [2.0; 3], [0.5625; 3]))),
        ("large", motion(1024.0, about_z(0.0, [1.0; 3], [64.0; 3]), about_z(1.0, [2.0; 3], [-512.0; 3]))),
        ("far", motion(256.0, about_z(0.0, [1.0; 3], far), about_z(1.0, [1.5; 3], beyond))),
        ("far, mirrored", motion(1024.0, about_z(0.0, [1.0, 1.0, -1.0], far), about_z(1.5, [1.0, 1.0, -1.0], beyond))),
    ]
}

fn moving(motions: &[[Affine; 2]]) -> Vec<Instance> {
    (0..)
        .zip(motions)
        .map(|(i, &[open, close])| Instance::moving(u32::try_from(blas_of(i)).unwrap(), open, close))
        .collect()
}

fn bottom() -> Vec<Bvh2> {
    let [soup, torus] = meshes();
    vec![build(&soup, Strategy::Dop), build(&torus, Strategy::Aabb)]
}

/// Rays at the instances at a time, and their transforms at that time.
fn shots(motions: &[[Affine; 2]], time: f32, n: usize, seed: u64) -> (Vec<Affine>, Vec<Ray>) {
    let placed: Vec<Affine> = motions.iter().map(|motion| at(motion, time)).collect();
    let meshes = meshes();
    let rays = placed.iter().enumerate().flat_map(|(i, map)| rays(&meshes[blas_of(i)], map, n, seed)).collect();
    (placed, rays)
}

/// The first ray whose answer differs from a loop over all triangles at their positions at that time.
fn first_difference(tlas: &dyn Intersect, placed: &[Affine], rays: &[Ray], time: f32) -> Option<String> {
    rays.iter().zip(loop_over_all(placed, TriangleTest::Watertight, rays)).find_map(|(ray, want)| {
        let got = tlas.closest_hit(&ray.at_time(time));
        let occluded = tlas.occluded(&ray.at_time(time));
        (got != want || occluded != want.is_some()).then(|| format!("{ray:?} at {time}: {got:?}, not {want:?}"))
    })
}

#[test]
fn moving_instances_match_still_ones_and_exact_geometry() {
    let mut rng = SplitMix64::new(5);
    for (name, motion) in motions() {
        let motions = [motion; 2];
        let tlas = Tlas::new(bottom(), &moving(&motions), top()).unwrap();
        for (i, time) in [0.0, 1.0, 0.5].into_iter().chain((0..6).map(|_| time(&mut rng))).enumerate() {
            let (placed, rays) = shots(&motions, time, 12, i as u64);
            assert_eq!(first_difference(&tlas, &placed, &rays, time), None, "{name}");
            for ray in rays.iter().step_by(7) {
                let hit = tlas.closest_hit(&ray.at_time(time));
                check_hit(ray, hit.as_ref(), &placed, reaches())
                    .unwrap_or_else(|error| panic!("{name} at {time}: {error}"));
            }
        }
    }
}

#[test]
fn many_moving_instances_match_at_any_time() {
    let motions: Vec<[Affine; 2]> = motions().into_iter().map(|(_, motion)| motion).collect();
    let mut instances = moving(&motions);
    // Half of them stand still at their start.
    let motions: Vec<_> =
        motions.iter().enumerate().map(|(i, motion)| if i % 3 == 0 { [motion[0]; 2] } else { *motion }).collect();
    instances.iter_mut().step_by(3).for_each(|instance| instance.world_from_object_close = None);
    let binary = |strategy| binary_top(VolumeConfig { strategy, fallback: true });
    for top in [TopConfig::default(), binary(Strategy::Aabb), binary(Strategy::Dop), binary(Strategy::Quaternion)] {
        let tlas = Tlas::new(bottom(), &instances, top.clone()).unwrap();
        let mut rng = SplitMix64::new(6);
        for i in 0..8 {
            let time = time(&mut rng);
            let (placed, rays) = shots(&motions, time, 3, i);
            assert_eq!(first_difference(&tlas, &placed, &rays, time), None, "{top:?}");
        }
    }
}

#[test]
fn equal_transforms_match_a_still_instance() {
    let motions: Vec<[Affine; 2]> = motions().into_iter().map(|(_, [open, _])| [open; 2]).collect();
    let still: Vec<Instance> =
        moving(&motions).into_iter().map(|i| Instance { world_from_object_close: None, ..i }).collect();
    let [moving, still] = [moving(&motions), still].map(|instances| Tlas::new(bottom(), &instances, top()).unwrap());
    let (_, rays) = shots(&motions, 0.0, 8, 1);
    for ray in &rays {
        for time in [0.0, 0.3, 1.0, f32::NAN] {
            assert_eq!(moving.closest_hit(&ray.at_time(time)), still.closest_hit(ray));
        }
    }
    assert_eq!(moving.aabb(), still.aabb());
}

#[test]
fn times_outside_the_shutter_are_clamped() {
    let motions: Vec<[Affine; 2]> = motions().into_iter().map(|(_, motion)| motion).collect();
    let tlas = Tlas::new(bottom(), &moving(&motions), top()).unwrap();
    for (beyond, end) in [(-1.0, 0.0), (f32::NEG_INFINITY, 0.0), (f32::NAN, 0.0), (2.0, 1.0), (f32::INFINITY, 1.0)] {
        let (placed, rays) = shots(&motions, end, 2, 3);
        assert_eq!(first_difference(&tlas, &placed, &rays, end), None);
        for ray in &rays {
            assert_eq!(tlas.closest_hit(&ray.at_time(beyond)), tlas.closest_hit(&ray.at_time(end)), "{beyond}");
        }
    }
}

#[test]
fn the_check_detects_a_small_sweep_and_a_wrong_time() {
    for (name, motion) in motions() {
        let motions = [motion; 2];
        let (placed, rays) = shots(&motions, 1.0, 40, 8);
        let shrunk = Tlas::new(bottom().into_iter().map(Altered::shrunk).collect(), &moving(&motions), top()).unwrap();
        assert!(first_difference(&shrunk, &placed, &rays, 1.0).is_some(), "{name}");
        let sound = Tlas::new(bottom(), &moving(&motions), top()).unwrap();
        assert_eq!(first_difference(&sound, &placed, &rays, 1.0), None, "{name}");
        assert!(first_difference(&sound, &placed, &rays, 1.0 - 1.0 / 1024.0).is_some(), "{name}");
    }
}

#[test]
fn motions_through_singular_transforms_are_rejected_with_the_time() {
    let refused = |open: Affine, close: Affine| {
        let still = Instance::new(0, Affine::IDENTITY);
        let moving = Instance::moving(0, open, close);
        Tlas::new(bottom(), &[still, moving], top()).map(|_| ()).unwrap_err()
    };
    let about_z = |angle: f64| affine(&Rotation::euler(0.0, 0.0, angle), [1.0; 3], [0.0; 3]);
    let half_turn = refused(Affine::IDENTITY, about_z(std::f64::consts::PI));
    assert!(
        matches!(half_turn, InstanceError::IllConditionedAt { instance: 1, time, condition }
            if time == 0.5 && condition > MAX_CONDITION),
        "{half_turn}"
    );
    let mirror = refused(Affine::IDENTITY, affine(&Rotation::IDENTITY, [1.0, -3.0, 1.0], [0.0; 3]));
    let InstanceError::IllConditionedAt { instance: 1, time, .. } = mirror else { panic!("{mirror}") };
    // The scale falls by four per unit of time and is rejected below 1 / limit of the greatest scale, three.
    assert!((time - 0.25).abs() <= 3.0 / MAX_CONDITION / 4.0, "{time}");
    let flat = refused(Affine::IDENTITY, Affine::scale([0.0; 3]));
    assert_eq!(
        flat.to_string(),
        "the transform of moving instance 1 is too close to singular at shutter time 1: its condition number is inf, \
         at most 1.048576e6 is supported"
    );
    let mut bad = Affine::IDENTITY;
    bad.columns[2][1] = f32::NAN;
    assert_eq!(refused(Affine::IDENTITY, bad), InstanceError::NotFinite { instance: 1 });
}
