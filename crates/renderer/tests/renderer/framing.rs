//! Automatic cameras.

use std::path::PathBuf;

use canted_fixtures::skip;
use canted_renderer::{StructureConfig, View, frame, prepare};
use canted_scene::{Camera, Mesh, Projection, Scene};
use canted_trace::Watertight;

use crate::common::{BruteForce, Vector, cross, cuboid, dot, floor, grey, inside_out, scene, sphere, sub, unit};

fn framed(scene: &Scene, aspect: f64) -> Camera {
    frame(scene, &BruteForce::new(scene), aspect)
}

fn forward(camera: &Camera) -> Vector {
    unit(sub(camera.target.map(f64::from), camera.eye.map(f64::from)))
}

/// Minimum and maximum image coordinates of all vertices, in half-heights from the center; `None` behind the eye.
fn extremes(scene: &Scene, camera: &Camera) -> Option<[[f64; 2]; 2]> {
    let ahead = forward(camera);
    let right = unit(cross(ahead, camera.up.map(f64::from)));
    let up = cross(right, ahead);
    let Projection::Perspective { fov_degrees } = camera.projection else { panic!("{:?}", camera.projection) };
    let slope = (0.5 * f64::from(fov_degrees).to_radians()).tan();
    let mut extremes = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for instance in &scene.instances {
        for &position in &scene.meshes[instance.mesh.0 as usize].positions {
            let vertex = instance.world_from_object.point_f64(position.map(f64::from));
            let way = sub(vertex, camera.eye.map(f64::from));
            let depth = dot(way, ahead);
            if depth <= 0.0 {
                return None;
            }
            for (range, axis) in extremes.iter_mut().zip([right, up]) {
                let x = dot(way, axis) / (depth * slope);
                *range = [range[0].min(x), range[1].max(x)];
            }
        }
    }
    Some(extremes)
}

/// Whether all vertices are in the image, one pair of edges is nearly touched, and the other pair has equal margins.
fn fills(scene: &Scene, camera: &Camera, aspect: f64) -> bool {
    /// The fit interpolates between slopes a sixteenth apart; half of that allows for its curvature.
    const OFF_CENTER: f64 = 1.0 / 32.0;
    extremes(scene, camera).is_some_and(|[x, y]| {
        let greatest = [x[1].max(-x[0]) / aspect, y[1].max(-y[0])];
        let fill = greatest[0].max(greatest[1]);
        (0.949..0.951).contains(&fill)
            && ((x[0] + x[1]) / aspect).abs() < OFF_CENTER
            && (y[0] + y[1]).abs() < OFF_CENTER
    })
}

fn objects() -> [(&'static str, Mesh); 4] {
    [
        ("cube", cuboid([-1.0; 3], [1.0; 3], 0)),
        ("sphere", sphere([3.0, -2.0, 1.0], 0.5, 2, 0)),
        ("tower", cuboid([10.0, 0.0, 5.0], [11.0, 30.0, 6.0], 0)),
        ("field", floor(50.0, 2.0, 0)),
    ]
}

#[test]
fn objects_fill_the_image_from_the_default_direction() {
    for (name, object) in objects() {
        let scene = scene(vec![object], vec![grey(0.5)]);
        for aspect in [0.5, 1.0, 16.0 / 9.0, 3.0] {
            let camera = framed(&scene, aspect);
            let from = unit([1.0, 0.6, 0.8]);
            assert!(dot(forward(&camera), from) < -0.999_99, "{name} {aspect}: {camera:?}");
            assert!(fills(&scene, &camera, aspect), "{name} {aspect}: {camera:?} {:?}", extremes(&scene, &camera));
        }
    }
}

#[test]
fn test_detects_cameras_that_are_too_far_or_off_center() {
    let scene = scene(vec![cuboid([-1.0; 3], [1.0; 3], 0)], vec![grey(0.5)]);
    let camera = framed(&scene, 1.5);
    let moved = |way: Vector| {
        let shift = |p: [f32; 3]| crate::common::narrow(std::array::from_fn(|k| f64::from(p[k]) + way[k]));
        Camera { eye: shift(camera.eye), target: shift(camera.target), ..camera }
    };
    assert!(fills(&scene, &camera, 1.5));
    assert!(!fills(&scene, &moved(forward(&camera).map(|x| -0.1 * x)), 1.5));
    assert!(!fills(&scene, &moved([0.0, 0.2, 0.0]), 1.5));
}

#[test]
fn camera_scales_exactly_with_powers_of_two() {
    let object = sphere([3.0, -2.0, 1.0], 0.5, 2, 0);
    let camera = framed(&scene(vec![object.clone()], vec![grey(0.5)]), 1.5);
    for scale in [2.0_f32.powi(-40), 2.0_f32.powi(40)] {
        let mut scaled = object.clone();
        for position in &mut scaled.positions {
            *position = position.map(|x| x * scale);
        }
        let scaled = framed(&scene(vec![scaled], vec![grey(0.5)]), 1.5);
        assert_eq!(scaled.eye, camera.eye.map(|x| x * scale));
        assert_eq!(scaled.target, camera.target.map(|x| x * scale));
    }
}

/// The faces of a box with their fronts inside, without two triangles of one face.
fn open_room(min: [f32; 3], max: [f32; 3], open: &[usize]) -> Mesh {
    let mut room = inside_out(cuboid(min, max, 0));
    let triangles = std::mem::take(&mut room.triangles);
    room.triangles =
        (0..).zip(triangles).filter(|(i, _): &(usize, _)| !open.contains(&(i / 2))).map(|(_, t)| t).collect();
    room
}

/// Faces of a box in the order -z, +z, -y, +y, -x, +x.
#[test]
fn interior_with_one_open_side_is_viewed_through_it() {
    for (face, axis, sign) in [(0, 2, -1.0), (1, 2, 1.0), (4, 0, -1.0), (5, 0, 1.0)] {
        let room = open_room([0.0; 3], [5.5, 5.4, 5.6], &[face]);
        let block = cuboid([1.0, 0.0, 1.0], [2.5, 3.0, 2.5], 0);
        let scene = scene(vec![room, block], vec![grey(0.5)]);
        let camera = framed(&scene, 4.0 / 3.0);
        assert!(sign * f64::from(camera.eye[axis]) > 5.0, "face {face}: {camera:?}");
        assert!((sign * forward(&camera)[axis] + 1.0).abs() < 1e-6, "face {face}: {camera:?}");
        assert!(fills(&scene, &camera, 4.0 / 3.0), "face {face}: {camera:?}");
    }
}

/// A hall with two rows of pillars, with and without a roof: the view is along the hall, at eye height.
#[test]
fn closed_interior_is_viewed_along_its_length() {
    for open in [&[][..], &[3]] {
        let mut bodies = vec![open_room([-20.0, 0.0, -4.0], [20.0, 6.0, 4.0], open)];
        for i in -3_i8..=3 {
            for z in [-2.5, 2.5] {
                let x = 5.0 * f32::from(i);
                bodies.push(cuboid([x - 0.3, 0.0, z - 0.3], [x + 0.3, 6.0, z + 0.3], 0));
            }
        }
        let scene = scene(bodies, vec![grey(0.5)]);
        let camera = framed(&scene, 16.0 / 9.0);
        assert!(scene.bounds_world().contains(camera.eye), "{camera:?}");
        assert!((camera.eye[1] - 2.4).abs() < 1e-5);
        let ahead = forward(&camera);
        assert!(ahead[0].abs() > 0.98, "{camera:?}");
        // Most of the hall is in front of the camera.
        assert!(ahead[0].signum() * f64::from(camera.eye[0]) < 0.0, "{camera:?}");
    }
}

#[test]
fn scenes_without_extent_have_a_valid_camera() {
    let point = scene(vec![crate::common::mesh(vec![[1.0, 2.0, 3.0]; 3], vec![[0, 1, 2]], 0)], vec![grey(0.5)]);
    for scene in [Scene::default(), point] {
        assert!(View::new(&framed(&scene, 1.5), 30, 20).is_ok());
    }
}

/// The directory of real models, if it exists: `CANTED_SCENES`, or `../shared/scenes` next to the workspace.
fn models() -> PathBuf {
    let beside = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes"));
    std::env::var_os("CANTED_SCENES").map_or_else(beside, PathBuf::from)
}

/// The automatic camera of a model, and whether its eye is inside the model's box; `None` without the file.
fn of_model(name: &str) -> Option<(Camera, bool)> {
    let path = models().join(name);
    if !path.exists() {
        return skip(&format!("the view of {name}"), format_args!("not in {}", models().display()));
    }
    let scene = canted_scene::read(&path).unwrap();
    let prepared = prepare::<Watertight>(&scene, &StructureConfig::default()).unwrap();
    let camera = frame(&scene, &prepared.structure, 16.0 / 9.0);
    Some((camera, scene.bounds_world().contains(camera.eye)))
}

#[test]
fn real_objects_are_viewed_from_outside() {
    for name in ["stanford/bunny.ply", "stanford/dragon_res4_be.ply", "truss/tower_crane.glb", "truss/truss_bridge.glb"]
    {
        if let Some((camera, is_inside)) = of_model(name) {
            assert!(!is_inside && dot(forward(&camera), unit([1.0, 0.6, 0.8])) < -0.999, "{name}: {camera:?}");
        }
    }
}

#[test]
fn cornell_box_is_viewed_through_its_open_side() {
    if let Some((camera, is_inside)) = of_model("cornell/cornellBox.obj") {
        assert!(!is_inside && forward(&camera)[2] < -0.999, "{camera:?}");
    }
}

/// The atrium is 24 m long along the x axis and 5 m wide.
#[test]
fn sponza_is_viewed_along_its_atrium() {
    if let Some((camera, is_inside)) = of_model("sponza/sponza.gltf") {
        assert!(is_inside && forward(&camera)[0].abs() > 0.98, "{camera:?}");
        assert!(camera.eye[0].abs() < 12.0 && camera.eye[2].abs() < 2.5, "{camera:?}");
    }
}
