//! Motion blur of moving instances.

use canted_film::{Film, Filter};
use canted_obb::Affine;
use canted_renderer::{
    BvhKind, Cone, Integrator, Levels, Pattern, PrepareError, SceneBvh, SceneBvhConfig, SceneLevels, Settings,
    Surfaces, UpdateOptions, UpdatePolicy,
};
use canted_scene::{Camera, Material, Mesh, MeshClose, Scene};
use canted_trace::{Hit, InstanceId, Intersect, Ray, Side, position_at};

use crate::common::{
    camera, cuboid, film_of, gray, parallelogram, place, prepared, rays_from_all_around, scene, settings, sphere, under,
};

const OPEN: Affine = Affine::IDENTITY;

fn film(scene: &Scene, view: &Camera, settings: &Settings) -> Film {
    film_of(scene, &prepared(scene, Levels::Auto), view, settings)
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
    let bright = Material { emission: [1.0; 3], ..gray(0.0) };
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
            let mut stage = scene(vec![object.clone()], vec![gray(0.625)]);
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
    let stage = || scene(vec![sphere([0.0; 3], 1.0, 2, 0)], vec![gray(0.5)]);
    let parts = |prepared: &SceneBvh| -> Vec<&str> { prepared.unused.iter().map(|l| l.feature).collect() };
    for levels in [Levels::Auto, Levels::One, Levels::Two] {
        let moving = prepared(&moving(stage(), shifted(1.0, 0.0)), levels);
        assert!(matches!(moving.levels(), SceneLevels::Two(_)), "{levels:?}");
        assert!(!parts(&moving).contains(&"motion") && !parts(&moving).contains(&"top-level BVH"));
    }
    let still = prepared(&stage(), Levels::Auto);
    assert!(matches!(still.levels(), SceneLevels::One(_)) && parts(&still).contains(&"motion"));
    assert!(parts(&prepared(&moving(stage(), OPEN), Levels::Auto)).contains(&"motion"), "start and end are equal");
}

#[test]
fn zero_motion_does_not_change_the_image() {
    let stage = under(
        [1.0, 0.8, 0.6],
        scene(vec![sphere([0.0; 3], 1.0, 2, 0), cuboid([-2.0; 3], [-1.0; 3], 0)], vec![gray(0.5)]),
    );
    let view = camera([2.0, 3.0, 4.0], [0.0; 3], 50.0);
    let settings = settings(16, 12, 4, 2);
    let still = film(&stage, &view, &settings);
    assert_eq!(film(&moving(stage.clone(), OPEN), &view, &settings), still);
    assert_ne!(film(&moving(stage, shifted(0.1, 0.0)), &view, &settings), still);
}

#[test]
fn motion_through_a_singular_transform_is_rejected() {
    let stage = scene(vec![sphere([0.0; 3], 1.0, 1, 0)], vec![gray(0.5)]);
    let turned = Affine { columns: [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] };
    let error = SceneBvh::build(&moving(stage, turned), &SceneBvhConfig::default()).err().unwrap();
    let sentence = "the transform of moving instance 0 is too close to singular at shutter time 0.5: its condition \
                    number is inf, at most 1.048576e6 is supported";
    assert_eq!(error.to_string(), sentence);
}

/// At each time, the surface equals that of a static instance with that transform.
#[test]
fn surfaces_match_static_instances() {
    let close = Affine { columns: [[0.0, 2.0, 0.0], [-1.0, 0.0, 0.5], [0.0, 0.25, 3.0], [4.0, -2.0, 1.0]] };
    let stage = scene(vec![sphere([0.5, 0.0, 0.0], 1.0, 1, 0)], vec![gray(0.5)]);
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

// Meshes that deform while the shutter is open: at each time they are the static meshes of that time.

/// The mesh, deforming.
fn deforming(mesh: Mesh, close: impl Fn([f32; 3]) -> [f32; 3]) -> Mesh {
    let positions = mesh.positions.iter().copied().map(close).collect();
    Mesh { close: Some(MeshClose { positions, ..MeshClose::default() }), ..mesh }
}

/// The scene as it is at a time, without motion.
fn still(scene: &Scene, time: f32) -> Scene {
    let mut still = scene.clone();
    for mesh in &mut still.meshes {
        let Some(close) = mesh.close.take() else { continue };
        let ends = mesh.positions.iter().zip(&close.positions);
        mesh.positions = ends.map(|(open, close)| position_at(open, close, time)).collect();
    }
    still
}

/// A sphere that twists and grows, one that collapses, and a box that stays, in several places.
fn stage(twist: f32) -> Scene {
    let twisted = move |[x, y, z]: [f32; 3]| {
        let (sin, cos) = (twist * z).sin_cos();
        [1.5 * (cos * x - sin * y), sin * x + cos * y, z + 0.3 * twist]
    };
    let meshes = vec![
        deforming(sphere([0.0; 3], 1.0, 3, 0), twisted),
        deforming(sphere([0.0; 3], 0.5, 2, 0), |_| [0.1; 3]),
        cuboid([-0.5; 3], [0.5, 0.25, 0.5], 0),
    ];
    let mut stage = scene(meshes, vec![gray(0.5)]);
    let turned = Affine { columns: [[0.8, 0.6, 0.1], [-0.6, 0.8, 0.0], [0.0, 0.2, 1.5], [1.5, 0.0, 0.3]] };
    stage.instances.push(place(0, turned));
    stage.instances.push(place(1, turned));
    stage.instances[2].world_from_object.columns[3] = [-1.5, 0.5, 0.0];
    stage.environment = Some([1.0, 0.8, 0.6].into());
    stage
}

fn hits(bvh: &dyn Intersect, time: f32) -> Vec<Option<Hit>> {
    rays_from_all_around(1500).map(|ray| bvh.closest_hit(&ray.at_time(time))).collect()
}

#[test]
fn hits_and_surfaces_at_a_time_are_those_of_the_static_scene() {
    let moving = stage(1.5);
    let structure = prepared(&moving, Levels::Auto);
    let surfaces = Surfaces::new(&moving);
    let mut seen = Vec::new();
    for time in [0.0, 0.1, 0.5, 0.77, 1.0] {
        let still = still(&moving, time);
        let fixed = prepared(&still, Levels::Two);
        let (ours, theirs) = (hits(&structure, time), hits(&fixed, 0.0));
        assert!(ours == theirs, "time {time}");
        let are_occluded =
            |tracer: &dyn Fn(&Ray) -> bool| rays_from_all_around(1500).map(|ray| tracer(&ray)).collect::<Vec<bool>>();
        assert_eq!(
            are_occluded(&|ray| structure.occluded(&ray.at_time(time))),
            are_occluded(&|ray| fixed.occluded(ray))
        );
        let of_still = Surfaces::new(&still);
        for (ray, hit) in rays_from_all_around(1500).zip(&ours) {
            let Some(hit) = hit else { continue };
            let (a, b) = (surfaces.at_time(hit, ray.direction, time, Cone::ZERO), of_still.at(hit, ray.direction));
            assert_eq!((a.position, a.normal, a.is_front), (b.position, b.normal, b.is_front));
            assert!(a.offset >= b.offset);
        }
        seen.push(ours);
    }
    assert!(seen.windows(2).all(|pair| pair[0] != pair[1]), "the scene moves");
    assert!(seen[0].iter().flatten().count() > 200);
}

/// Updated structures have the hits of new ones, also where a mesh starts or stops to deform.
#[test]
fn updates_follow_deforming_meshes() {
    for policy in [UpdatePolicy::Auto, UpdatePolicy::Refit, UpdatePolicy::Rebuild] {
        let mut updated = prepared(&stage(0.2), Levels::Auto);
        let mut n_refits = 0;
        for frame in 1..8_u8 {
            let mut now = stage(0.2 + 0.3 * f32::from(frame));
            if frame % 4 == 3 {
                now.meshes[1].close = None;
            }
            let options = UpdateOptions { policy, trace_time: std::time::Duration::from_millis(20) };
            let updates = updated.update(&now, &options).unwrap();
            n_refits += updates.refits;
            let fresh = prepared(&now, Levels::Auto);
            for time in [0.0, 0.6] {
                assert!(hits(&updated, time) == hits(&fresh, time), "{policy:?}, frame {frame}, time {time}");
            }
        }
        assert!((policy == UpdatePolicy::Refit) == (n_refits >= 7) || policy == UpdatePolicy::Auto, "{n_refits}");
    }
}

/// A bright strip whose vertices move has the picture of a strip that is moved, sample by sample.
#[test]
fn a_deforming_strip_is_blurred_as_a_moving_one() {
    let bright = Material { emission: [1.0; 3], ..gray(0.0) };
    let strip = || parallelogram([-0.5, -9.0, 0.0], [0.25, 0.0, 0.0], [0.0, 18.0, 0.0], 0);
    let view = camera([0.0, 0.0, 1.0], [0.0; 3], 90.0);
    for integrator in [Integrator::Hybrid, Integrator::Path] {
        let settings = Settings { filter: Filter::BOX, integrator, ..settings(16, 16, 256, 0) };
        let by_vertices = scene(vec![deforming(strip(), |[x, y, z]| [x + 0.75, y, z])], vec![bright.clone()]);
        let mut by_instance = scene(vec![strip()], vec![bright.clone()]);
        let close = Affine { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.75, 0.0, 0.0]] };
        by_instance.instances[0].world_from_object_close = Some(close);
        let values = |scene: &Scene| {
            film(scene, &view, &settings).pixels().iter().map(|pixel| pixel.mean()[0]).collect::<Vec<f64>>()
        };
        let (ours, theirs, open) = (values(&by_vertices), values(&by_instance), values(&still(&by_vertices, 0.0)));
        // A sample at the very edge may be rounded to the other side.
        let is_near = |others: &[f64]| ours.iter().zip(others).all(|(a, b)| (a - b).abs() <= 2.0 / 256.0);
        assert!(is_near(&theirs), "{integrator:?}");
        assert!(!is_near(&open), "{integrator:?}");
    }
}

/// No ray that leaves a convex object hits it again, at any time of its deformation.
#[test]
fn a_deforming_object_in_a_white_furnace_shows_its_albedo() {
    for (scale, shift) in [(1.0, 0.0), (1e-3, 0.0), (1.0, 300.0)] {
        let at = move |p: [f32; 3]| p.map(|x| scale * x + shift);
        let grown = move |[x, y, z]: [f32; 3]| at([2.0 * x, 0.7 * y + 0.4, 1.2 * z]);
        let mut ball = sphere([0.0; 3], 1.0, 3, 0);
        ball = deforming(ball, grown);
        ball.positions.iter_mut().for_each(|p| *p = at(*p));
        let furnace = under([1.0; 3], scene(vec![ball], vec![gray(0.625)]));
        let view = camera(at([0.0, 0.0, 4.0]), at([0.0; 3]), 8.0);
        for pixel in film(&furnace, &view, &settings(6, 6, 64, 2)).pixels() {
            assert_eq!(pixel.mean(), [0.625; 3], "scale {scale}, shift {shift}");
        }
    }
}

#[test]
fn structures_that_cannot_move_are_one_error() {
    for kind in [BvhKind::Bvh2, BvhKind::Bih, BvhKind::KdTree] {
        let config = SceneBvhConfig { kind, ..SceneBvhConfig::default() };
        let error = SceneBvh::build(&stage(1.0), &config).err();
        assert_eq!(error, Some(PrepareError::MovingTriangles));
        assert!(SceneBvh::build(&still(&stage(1.0), 0.5), &config).is_ok());
    }
    let mut torn = stage(1.0);
    torn.meshes[0].close.as_mut().unwrap().positions[3][1] = f32::INFINITY;
    let error = SceneBvh::build(&torn, &SceneBvhConfig::default()).err().unwrap().to_string();
    assert!(error.contains("not finite"), "{error}");
}
