//! Ray offsets: no self-intersection and no leaks, at every scale and far from the origin.

use std::sync::atomic::AtomicBool;

use canted_obb::Affine;
use canted_renderer::{Levels, StructureConfig, Surfaces, Tracer, prepare, render};
use canted_scene::{Material, Mesh, Scene};
use canted_trace::{Hit, MollerTrumbore, Ray, Watertight};
use canted_wide::LaneKernel;

use crate::common::{
    BruteForce, Vector, camera, dot, film, grey, inside_out, narrow, place, scene, settings, sphere, sub,
};

/// Powers of two scale every computation exactly; powers of ten do not.
const SCALES: [f32; 7] = [1e-3, 0.037, 1.0, 7.7, 1e3, 1e-20, 1e15];

/// An object at scale `s` around `center`, and a camera position that sees only it.
fn placed(object: &Mesh, s: f32, center: [f32; 3]) -> (Mesh, [f32; 3]) {
    let moved = |p: [f32; 3]| narrow(std::array::from_fn(|k| f64::from(center[k]) + f64::from(s) * f64::from(p[k])));
    let mut object = object.clone();
    for position in &mut object.positions {
        *position = moved(*position);
    }
    (object, moved([2.0, 3.0, 4.0]))
}

fn centers(s: f32) -> [[f32; 3]; 3] {
    [[0.0; 3], [3.0 * s, -50.0 * s, 20.0 * s], [1000.0 * s, 700.0 * s, -400.0 * s]]
}

#[test]
fn convex_objects_have_no_self_intersection_at_any_scale_or_position() {
    for s in SCALES {
        for center in centers(s) {
            let (object, eye) = placed(&sphere([0.0; 3], 1.0, 3, 0), s, center);
            let mut furnace = scene(vec![object], vec![grey(0.5)]);
            furnace.environment = Some([1.0; 3].into());
            let film = film(&furnace, &camera(eye, center, 15.0), &settings(12, 12, 6, 1));
            assert!(film.pixels().iter().all(|pixel| pixel.mean() == [0.5; 3]), "scale {s} at {center:?}");
        }
    }
}

#[test]
fn closed_objects_do_not_leak_at_any_scale_or_position() {
    let emissive = Material { emission: [1.0; 3], ..grey(0.5) };
    for s in SCALES {
        for center in centers(s) {
            let (object, _) = placed(&inside_out(sphere([0.0; 3], 1.0, 3, 0)), s, center);
            let mut room = scene(vec![object], vec![emissive.clone()]);
            room.environment = Some([100.0; 3].into());
            let target = std::array::from_fn(|k| center[k] + [0.3, -0.1, 0.2][k] * s);
            let film = film(&room, &camera(center, target, 100.0), &settings(12, 12, 6, 2));
            assert!(film.pixels().iter().all(|pixel| pixel.mean() == [1.75; 3]), "scale {s} at {center:?}");
        }
    }
}

/// Rays onto an object, the surfaces they hit, and the tracer.
fn surfaces_of(
    scene: &Scene,
    eye: [f32; 3],
    center: [f32; 3],
    mut check: impl FnMut(&Ray, &Hit, &canted_renderer::Surface),
) {
    let (tracer, surfaces) = (BruteForce::new(scene), Surfaces::new(scene));
    let view = canted_renderer::View::new(&camera(eye, center, 15.0), 16, 16).unwrap();
    for i in 0..256_u32 {
        let ray = view.ray([f64::from(i % 16) + 0.3, f64::from(i / 16) + 0.7]);
        let hit = tracer.closest_hit(&ray, &mut ()).unwrap();
        check(&ray, &hit, &surfaces.at(&hit, ray.direction));
    }
}

/// The origin of a new ray, rounded to `f32`, is at least twice `HIT_ERROR` times the reach from the plane along each
/// axis, and not much more than the bound of 44 units of rounding.
#[test]
fn origins_have_the_minimum_distance() {
    for s in SCALES {
        for center in centers(s) {
            let (object, eye) = placed(&sphere([0.0; 3], 1.0, 3, 0), s, center);
            let scene = scene(vec![object], vec![grey(0.5)]);
            let reach = f64::from(scene.bounds_world().reach());
            surfaces_of(&scene, eye, center, |_, hit, surface| {
                let corner = scene.meshes[0].positions[scene.meshes[0].triangles[hit.primitive.index()][0] as usize];
                let height = |p: [f32; 3]| dot(surface.normal, sub(p.map(f64::from), corner.map(f64::from)));
                let unit_of_rounding = 0.5 * f64::from(f32::EPSILON) * reach;
                for direction in [narrow(surface.normal), narrow(surface.normal.map(|x| -x))] {
                    let side = dot(surface.normal, direction.map(f64::from)).signum();
                    let height = side * height(surface.spawn_ray(direction).origin);
                    let axes: f64 = surface.normal.iter().map(|x| x.abs()).sum();
                    let roundings = height / (unit_of_rounding * axes);
                    assert!((40.0..46.0).contains(&roundings), "scale {s} at {center:?}: {roundings}");
                }
            });
        }
    }
}

/// The two tests above detect a missing offset: rays from the rounded hit point hit the object again.
#[test]
fn rays_without_offset_hit_the_surface_again() {
    let center = [1000.0, 700.0, -400.0];
    let (object, eye) = placed(&sphere([0.0; 3], 1.0, 3, 0), 1.0, center);
    let scene = scene(vec![object], vec![grey(0.5)]);
    let tracer = BruteForce::new(&scene);
    let mut n_hits = 0;
    surfaces_of(&scene, eye, center, |_, _, surface| {
        let bare = Ray::new(narrow(surface.position), narrow(surface.normal));
        n_hits += u32::from(tracer.occluded(&bare, &mut ()));
        assert!(!tracer.occluded(&surface.spawn_ray(narrow(surface.normal)), &mut ()));
    });
    assert!(n_hits > 32, "{n_hits} of 256");
}

/// Distant, stretched and sheared instances: the offset covers the rounding of transforms to and from object space.
#[test]
fn instances_far_from_the_origin_have_no_self_intersection() {
    let rotated: Vector = [0.36, 0.48, -0.8];
    for (stretch, shift) in [(1.0, 1e4), (1e-3, 10.0), (1e3, 1e6), (50.0, -3e5)] {
        let world_from_object = Affine {
            columns: [
                narrow(rotated.map(|x| x * stretch)),
                narrow([0.8 * stretch, -0.6 * stretch, 0.1 * stretch]),
                narrow([0.0, 0.3 * stretch, 2.0 * stretch]),
                narrow([shift, 0.3 * shift, -0.7 * shift]),
            ],
        };
        let mut furnace: Scene = scene(vec![sphere([0.0; 3], 1.0, 3, 0)], vec![grey(0.5)]);
        furnace.instances = vec![place(0, world_from_object)];
        furnace.environment = Some([1.0; 3].into());
        let center = world_from_object.columns[3];
        let eye = world_from_object.point([2.0, 3.0, 4.0]);
        let film = film(&furnace, &camera(eye, center, 4.0), &settings(12, 12, 6, 1));
        assert!(film.pixels().iter().all(|pixel| pixel.mean() == [0.5; 3]), "stretch {stretch} shift {shift}");
    }
}

/// Furnace tests with one-level and two-level BVHs. Only a watertight triangle test guarantees that edges do not leak.
fn check_furnaces<K: LaneKernel>(is_watertight: bool) {
    let emissive = Material { emission: [1.0; 3], ..grey(0.5) };
    let rotated = Affine { columns: [[0.36, 0.48, -0.8], [0.8, -0.6, 0.1], [0.0, 0.3, 2.0], [300.0, -90.0, 40.0]] };
    for s in [1e-3, 1.0, 1e3] {
        let ball = placed(&sphere([0.0; 3], 1.0, 4, 0), s, [10.0 * s; 3]).0;
        let map = Affine {
            columns: [rotated.columns[0], rotated.columns[1], rotated.columns[2], rotated.columns[3].map(|x| x * s)],
        };
        let center = map.point([10.0 * s; 3]);
        let eye = map.point([12.0 * s, 13.0 * s, 14.0 * s]);
        for levels in [Levels::One, Levels::Two] {
            let rendered = |object: &Mesh, material: &Material, sky, eye, target, fov| {
                let mut scene = scene(vec![object.clone()], vec![material.clone()]);
                scene.instances = vec![place(0, map)];
                scene.environment = Some([sky; 3].into());
                let prepared = prepare::<K>(&scene, &StructureConfig { levels, ..StructureConfig::default() }).unwrap();
                let view = camera(eye, target, fov);
                let cancel = AtomicBool::new(false);
                let film = render(&scene, &prepared.structure, &view, &settings(24, 24, 6, 2), &|_, _| (), &cancel);
                film.unwrap().pixels().iter().map(|pixel| pixel.mean()[0]).collect::<Vec<_>>()
            };
            let outside = rendered(&ball, &grey(0.5), 1.0, eye, center, 4.0);
            assert!(outside.iter().all(|&x| x == 0.5), "self-intersection at scale {s}, {levels:?}");
            if is_watertight {
                let inside = rendered(&inside_out(ball.clone()), &emissive, 100.0, center, eye, 100.0);
                assert!(inside.iter().all(|&x| x == 1.75), "leak at scale {s}, {levels:?}");
            }
        }
    }
}

#[test]
fn watertight_bvhs_have_no_self_intersection_and_no_leaks() {
    check_furnaces::<Watertight>(true);
}

#[test]
fn moller_trumbore_bvhs_have_no_self_intersection() {
    check_furnaces::<MollerTrumbore>(false);
}
