//! Meshes that deform while the shutter is open: at each time they are the static meshes of that time.

use std::sync::atomic::AtomicBool;

use canted_film::{Film, Filter};
use canted_lbvh::Strategy;
use canted_obb::Affine;
use canted_renderer::{
    Accel, Cone, Integrator, Levels, PrepareError, Prepared, Settings, StructureConfig, Surfaces, Tracer,
    UpdateOptions, UpdatePolicy, prepare, render,
};
use canted_scene::{Camera, Material, Mesh, MeshClose, Scene};
use canted_trace::{Hit, Query, Ray, Watertight, position_at};

use crate::common::{camera, cuboid, grey, parallelogram, place, scene, settings, sphere};

/// A ray at a time.
struct At(f32);

impl Query for At {
    const MAY_REJECT: bool = false;

    fn time(&self) -> f32 {
        self.0
    }
}

fn prepared(scene: &Scene, levels: Levels) -> Prepared<Watertight> {
    prepare(scene, &StructureConfig { levels, ..StructureConfig::default() }).unwrap()
}

fn film(scene: &Scene, view: &Camera, settings: &Settings) -> Film {
    let structure = prepared(scene, Levels::Auto).structure;
    render(scene, &structure, view, settings, &|_, _| (), &AtomicBool::new(false)).unwrap()
}

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
    let mut stage = scene(meshes, vec![grey(0.5)]);
    let turned = Affine { columns: [[0.8, 0.6, 0.1], [-0.6, 0.8, 0.0], [0.0, 0.2, 1.5], [1.5, 0.0, 0.3]] };
    stage.instances.push(place(0, turned));
    stage.instances.push(place(1, turned));
    stage.instances[2].world_from_object.columns[3] = [-1.5, 0.5, 0.0];
    stage.environment = Some([1.0, 0.8, 0.6].into());
    stage
}

/// Rays from all around.
fn rays() -> impl Iterator<Item = Ray> {
    let mut state = 1_u32;
    let mut number = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from(u16::try_from(state >> 16).unwrap()) / 32768.0 - 1.0
    };
    (0..1500).map(move |i| {
        let origin = [(); 3].map(|()| 3.0 * number());
        let target = [(); 3].map(|()| 1.5 * number());
        let length = [1e-3, 1.0, 1e5][i % 3];
        Ray::new(origin, std::array::from_fn(|k| if i % 7 == k { -0.0 } else { (target[k] - origin[k]) * length }))
    })
}

fn hits(tracer: &impl Tracer, time: f32) -> Vec<Option<Hit>> {
    rays().map(|ray| tracer.closest_hit(&ray, &mut At(time))).collect()
}

#[test]
fn hits_and_surfaces_at_a_time_are_those_of_the_static_scene() {
    let moving = stage(1.5);
    let structure = prepared(&moving, Levels::Auto).structure;
    let surfaces = Surfaces::new(&moving);
    let mut seen = Vec::new();
    for time in [0.0, 0.1, 0.5, 0.77, 1.0] {
        let still = still(&moving, time);
        let fixed = prepared(&still, Levels::Two).structure;
        let (ours, theirs) = (hits(&structure, time), hits(&fixed, 0.0));
        assert!(ours == theirs, "time {time}");
        let are_occluded = |tracer: &dyn Fn(&Ray) -> bool| rays().map(|ray| tracer(&ray)).collect::<Vec<bool>>();
        assert_eq!(
            are_occluded(&|ray| structure.occluded(ray, &mut At(time))),
            are_occluded(&|ray| fixed.occluded(ray, &mut At(0.0)))
        );
        let of_still = Surfaces::new(&still);
        for (ray, hit) in rays().zip(&ours) {
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
            let fresh = prepared(&now, Levels::Auto).structure;
            for time in [0.0, 0.6] {
                assert!(hits(&updated.structure, time) == hits(&fresh, time), "{policy:?}, frame {frame}, time {time}");
            }
        }
        assert!((policy == UpdatePolicy::Refit) == (n_refits >= 7) || policy == UpdatePolicy::Auto, "{n_refits}");
    }
}

/// A bright strip whose vertices move has the picture of a strip that is moved, sample by sample.
#[test]
fn a_deforming_strip_is_blurred_as_a_moving_one() {
    let bright = Material { emission: [1.0; 3], ..grey(0.0) };
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
        let mut furnace = scene(vec![ball], vec![grey(0.625)]);
        furnace.environment = Some([1.0; 3].into());
        let view = camera(at([0.0, 0.0, 4.0]), at([0.0; 3]), 8.0);
        for pixel in film(&furnace, &view, &settings(6, 6, 64, 2)).pixels() {
            assert_eq!(pixel.mean(), [0.625; 3], "scale {scale}, shift {shift}");
        }
    }
}

#[test]
fn structures_that_cannot_move_are_one_error() {
    let binary = Accel::Binary { strategy: Strategy::Aabb, builder: None };
    for accel in [binary, Accel::Bih, Accel::KdTree] {
        let config = StructureConfig { accel, ..StructureConfig::default() };
        let error = prepare::<Watertight>(&stage(1.0), &config).err();
        assert_eq!(error, Some(PrepareError::MovingTriangles));
        assert!(prepare::<Watertight>(&still(&stage(1.0), 0.5), &config).is_ok());
    }
    let mut torn = stage(1.0);
    torn.meshes[0].close.as_mut().unwrap().positions[3][1] = f32::INFINITY;
    let error = prepare::<Watertight>(&torn, &StructureConfig::default()).err().unwrap().to_string();
    assert!(error.contains("not finite"), "{error}");
}
