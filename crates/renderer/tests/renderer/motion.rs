//! Motion blur of moving instances.

use std::sync::atomic::AtomicBool;

use canted_film::{Film, Filter};
use canted_obb::Affine;
use canted_renderer::{
    Cone, Levels, Pattern, Prepared, Settings, Structure, StructureConfig, Surfaces, prepare, render,
};
use canted_scene::{Camera, Material, Scene};
use canted_trace::{Hit, InstanceId, Side, Watertight};

use crate::common::{camera, cuboid, grey, parallelogram, place, scene, settings, sphere};

const OPEN: Affine = Affine::IDENTITY;

fn prepared(scene: &Scene, levels: Levels) -> Prepared<Watertight> {
    prepare(scene, &StructureConfig { levels, ..StructureConfig::default() }).unwrap()
}

fn film(scene: &Scene, view: &Camera, settings: &Settings) -> Film {
    let structure = prepared(scene, Levels::Auto).structure;
    render(scene, &structure, view, settings, &|_, _| (), &AtomicBool::new(false)).unwrap()
}

fn shifted(x: f32, y: f32) -> Affine {
    Affine { columns: [OPEN.columns[0], OPEN.columns[1], OPEN.columns[2], [x, y, 0.0]] }
}

fn moving(mut stage: Scene, close: Affine) -> Scene {
    stage.instances.iter_mut().for_each(|instance| instance.world_from_object_close = Some(close));
    stage
}

/// A bright strip moves across the view: a pixel's value is the fraction of pixel area and time that it covers.
#[test]
fn moving_strip_matches_coverage_over_time() {
    const SAMPLES: u32 = 1 << 10;
    let bright = Material { emission: [1.0; 3], ..grey(0.0) };
    // At time s it spans -0.5 + 0.75 s to -0.25 + 0.75 s; a pixel is an eighth wide.
    let strip = parallelogram([-0.5, -9.0, 0.0], [0.25, 0.0, 0.0], [0.0, 18.0, 0.0], 0);
    let stage = moving(scene(vec![strip], vec![bright]), shifted(0.75, 0.0));
    let view = camera([0.0, 0.0, 1.0], [0.0; 3], 90.0);
    let still = Settings { filter: Filter::BOX, ..settings(16, 16, SAMPLES, 0) };
    for pattern in [Pattern::Random, Pattern::Stratified, Pattern::Sobol] {
        let film = film(&stage, &view, &Settings { pattern, ..still });
        for column in 0..16_u8 {
            let left = (f64::from(column) - 8.0) / 8.0;
            let exact = covered(left, left + 0.125);
            let value = film.pixels()[8 * 16 + usize::from(column)].mean()[0];
            // Samples are 0 or 1: for random ones, five standard deviations of the mean.
            assert!(
                (value - exact).abs() <= 5.0 * (exact * (1.0 - exact) / f64::from(SAMPLES)).sqrt(),
                "{pattern:?} {column}: {value} {exact}"
            );
        }
    }
}

/// Fraction of pixel width and time that the strip covers, by many small time steps.
fn covered(left: f64, right: f64) -> f64 {
    const STEPS: u32 = 10_000;
    let at = |i: u32| {
        let shift = 0.75 * (f64::from(i) + 0.5) / f64::from(STEPS);
        ((right.min(shift - 0.25) - left.max(shift - 0.5)) / (right - left)).max(0.0)
    };
    (0..STEPS).map(at).sum::<f64>() / f64::from(STEPS)
}

/// No ray that leaves a moving convex object hits it again, neither by rounding nor at another time.
#[test]
fn moving_object_in_a_white_furnace_shows_its_albedo() {
    let turned = Affine { columns: [[0.2, 0.9, 0.0], [-0.9, 0.2, 0.3], [0.1, 0.0, 1.4], [0.3, -0.2, 0.5]] };
    for object in [sphere([0.0; 3], 1.0, 3, 0), cuboid([-1.0; 3], [1.0; 3], 0)] {
        for (scale, shift) in [(1.0, 0.0), (1e-3, 0.0), (1.0, 300.0), (1e4, -1e6)] {
            let placed = |map: &Affine| {
                let [x, y, z, t] = map.columns.map(|column| column.map(|c| c * scale));
                Affine { columns: [x, y, z, t.map(|t| t + shift)] }
            };
            let mut stage = scene(vec![object.clone()], vec![grey(0.625)]);
            stage.instances = vec![place(0, placed(&OPEN))];
            let mut stage = moving(stage, placed(&turned));
            stage.environment = Some([1.0; 3].into());
            let eye = [2.0, 3.0, 4.0].map(|x| x * scale + shift);
            let film = film(&stage, &camera(eye, [shift; 3], 2.0), &settings(8, 8, 64, 2));
            for pixel in film.pixels() {
                assert_eq!(pixel.mean(), [0.625; 3], "scale {scale}, shift {shift}");
            }
        }
    }
}

#[test]
fn motion_requires_two_levels_and_is_skipped_without_moving_instances() {
    let stage = || scene(vec![sphere([0.0; 3], 1.0, 2, 0)], vec![grey(0.5)]);
    let parts = |prepared: &Prepared<Watertight>| -> Vec<&str> { prepared.unused.iter().map(|l| l.feature).collect() };
    for levels in [Levels::Auto, Levels::One, Levels::Two] {
        let moving = prepared(&moving(stage(), shifted(1.0, 0.0)), levels);
        assert!(matches!(moving.structure, Structure::Two(_)), "{levels:?}");
        assert!(!parts(&moving).contains(&"motion") && !parts(&moving).contains(&"top-level BVH"));
    }
    let still = prepared(&stage(), Levels::Auto);
    assert!(matches!(still.structure, Structure::One(_)) && parts(&still).contains(&"motion"));
    assert!(parts(&prepared(&moving(stage(), OPEN), Levels::Auto)).contains(&"motion"), "start and end are equal");
}

#[test]
fn zero_motion_does_not_change_the_image() {
    let mut stage = scene(vec![sphere([0.0; 3], 1.0, 2, 0), cuboid([-2.0; 3], [-1.0; 3], 0)], vec![grey(0.5)]);
    stage.environment = Some([1.0, 0.8, 0.6].into());
    let view = camera([2.0, 3.0, 4.0], [0.0; 3], 50.0);
    let settings = settings(16, 12, 4, 2);
    let still = film(&stage, &view, &settings);
    assert_eq!(film(&moving(stage.clone(), OPEN), &view, &settings), still);
    assert_ne!(film(&moving(stage, shifted(0.1, 0.0)), &view, &settings), still);
}

#[test]
fn motion_through_a_singular_transform_is_rejected() {
    let stage = scene(vec![sphere([0.0; 3], 1.0, 1, 0)], vec![grey(0.5)]);
    let turned = Affine { columns: [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] };
    let error = prepare::<Watertight>(&moving(stage, turned), &StructureConfig::default()).err().unwrap();
    let sentence = "the transform of moving instance 0 is too close to singular at shutter time 0.5: its condition \
                    number is inf, at most 1.048576e6 is supported";
    assert_eq!(error.to_string(), sentence);
}

/// At each time, the surface equals that of a static instance with that transform.
#[test]
fn surfaces_match_static_instances() {
    let close = Affine { columns: [[0.0, 2.0, 0.0], [-1.0, 0.0, 0.5], [0.0, 0.25, 3.0], [4.0, -2.0, 1.0]] };
    let stage = scene(vec![sphere([0.5, 0.0, 0.0], 1.0, 1, 0)], vec![grey(0.5)]);
    let moving = moving(stage.clone(), close);
    for time in [0.0, 0.25, 0.5, 1.0] {
        let mut there = stage.clone();
        // Exact, because the values have few bits.
        let map = &mut there.instances[0].world_from_object.columns;
        for (column, (from, to)) in map.iter_mut().zip(OPEN.columns.iter().zip(&close.columns)) {
            *column = std::array::from_fn(|k| from[k] + time * (to[k] - from[k]));
        }
        for primitive in 0..32 {
            let hit = Hit {
                t: 1.0,
                u: 0.25,
                v: 0.5,
                primitive: canted_obb::PrimId(primitive),
                instance: InstanceId(0),
                side: Side::Front,
            };
            let (direction, still) = ([0.3, -1.0, 0.2], Surfaces::new(&there));
            let (a, b) = (Surfaces::new(&moving).at_time(&hit, direction, time, Cone::ZERO), still.at(&hit, direction));
            for k in 0..3 {
                assert!((a.position[k] - b.position[k]).abs() < 1e-14 && (a.normal[k] - b.normal[k]).abs() < 1e-14);
            }
            // The offset is the larger one of both ends.
            assert!(a.offset >= b.offset);
        }
    }
}
