use std::path::PathBuf;

use canted_fixtures::skip;
use canted_obb::Affine;
use canted_renderer::{CameraError, Levels, SceneBvh, SceneBvhConfig, Shown, Subject, View, frame};
use canted_scene::{AlphaMode, Camera, Lens, Material, Mesh, Projection, Scene};

use crate::common::{
    BruteForce, U, Vector, cross, cuboid, dot, film, floor, gray, inside_out, parallelogram, place, scene, settings,
    sphere, sub, unit,
};

const CAMERA: Camera = Camera::pinhole([1.0, 2.0, 3.0], [1.0, 2.0, -5.0], [0.0, 1.0, 0.0], 90.0);

fn direction(camera: &Camera, position: [f64; 2]) -> [f64; 3] {
    View::new(camera, 200, 100).unwrap().ray(position).direction.map(f64::from)
}

/// Whether two directions differ only by `f32` rounding.
fn same(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).all(|k| (a[k] - b[k]).abs() <= f64::from(f32::EPSILON))
}

#[test]
fn image_spans_the_field_of_view() {
    // 90 degrees from bottom to top: the edges have slope 1; the image is twice as wide as high.
    assert!(same(direction(&CAMERA, [100.0, 50.0]), [0.0, 0.0, -1.0]));
    assert!(same(direction(&CAMERA, [100.0, 0.0]), unit([0.0, 1.0, -1.0])), "row 0 is at the top");
    assert!(same(direction(&CAMERA, [100.0, 100.0]), unit([0.0, -1.0, -1.0])));
    assert!(same(direction(&CAMERA, [200.0, 50.0]), unit([2.0, 0.0, -1.0])), "x points to the right");
    assert!(same(direction(&CAMERA, [0.0, 0.0]), unit([-2.0, 1.0, -1.0])));
}

#[test]
fn tilted_camera_looks_at_target_with_up_pointing_up() {
    let camera = Camera::pinhole([3.0, 4.0, -2.0], [-1.0, 0.5, 7.0], [0.3, 2.0, 0.1], 33.0);
    let forward = unit(sub(camera.target.map(f64::from), camera.eye.map(f64::from)));
    assert!(same(direction(&camera, [100.0, 50.0]), forward));
    let (top, bottom) = (direction(&camera, [100.0, 0.0]), direction(&camera, [100.0, 100.0]));
    // Rounding a unit vector rotates it by one rounding and changes its length by one.
    let field = 33.0_f64.to_radians();
    let bound = (2.0 + 2.0 / field.tan()) * U;
    assert!((dot(top, bottom).acos() - field).abs() <= bound);
    assert!(dot(sub(top, bottom), camera.up.map(f64::from)) > 0.0);
}

#[test]
fn rays_scale_exactly_with_powers_of_two() {
    let base = View::new(&CAMERA, 64, 64).unwrap();
    for scale in [2.0_f32.powi(-60), 2.0_f32.powi(60)] {
        let camera = Camera {
            eye: CAMERA.eye.map(|x| x * scale),
            target: CAMERA.target.map(|x| x * scale),
            up: [0.0, scale, 0.0],
            ..CAMERA
        };
        let ray = View::new(&camera, 64, 64).unwrap().ray([3.25, 60.5]);
        assert_eq!(ray.direction, base.ray([3.25, 60.5]).direction);
    }
}

#[test]
fn invalid_cameras_are_reported() {
    let refused = |camera: Camera| View::new(&camera, 8, 8).unwrap_err();
    assert_eq!(refused(Camera { target: CAMERA.eye, ..CAMERA }), CameraError::NoDirection { eye: CAMERA.eye });
    for up in [[0.0; 3], [0.0, 0.0, 2.0], [0.0, 0.0, -1.0]] {
        assert_eq!(refused(Camera { up, ..CAMERA }), CameraError::NoUp { up });
    }
    for degrees in [0.0, -1.0, 180.0, f32::INFINITY] {
        assert_eq!(
            refused(Camera { projection: perspective(degrees), ..CAMERA }),
            CameraError::FieldOfView { degrees }
        );
    }
    let error = refused(Camera { eye: [f32::INFINITY, 0.0, 0.0], ..CAMERA });
    assert_eq!(error.to_string(), "camera eye [inf, 0.0, 0.0] is not finite");
    assert!(matches!(refused(Camera { projection: perspective(f32::NAN), ..CAMERA }), CameraError::FieldOfView { .. }));
}

fn perspective(fov_degrees: f32) -> Projection {
    Projection::Perspective { fov_degrees }
}

#[test]
fn orthographic_rays_span_the_height() {
    let camera = Camera { projection: Projection::Orthographic { height: 6.0 }, ..CAMERA };
    let view = View::new(&camera, 4, 2).unwrap();
    // The camera looks along -z with x to the right: the image covers 12 by 6 units around the eye.
    let [left_top, right_bottom] = [[0.0, 0.0], [4.0, 2.0]].map(|position| view.ray(position));
    assert_eq!(left_top.origin, [1.0 - 6.0, 2.0 + 3.0, 3.0]);
    assert_eq!(right_bottom.origin, [1.0 + 6.0, 2.0 - 3.0, 3.0]);
    assert_eq!((left_top.direction, right_bottom.direction), ([0.0, 0.0, -1.0], [0.0, 0.0, -1.0]));
    for height in [0.0, -1.0, f32::INFINITY, f32::NAN] {
        let camera = Camera { projection: Projection::Orthographic { height }, ..CAMERA };
        assert!(matches!(View::new(&camera, 4, 2), Err(CameraError::Height { .. })), "{height}");
    }
}

/// All rays of one position intersect in the plane of focus, and nowhere else.
#[test]
fn lens_is_sharp_only_in_the_plane_of_focus() {
    let lens = Some(Lens { radius: 0.5, focus_distance: 4.0 });
    for projection in [CAMERA.projection, Projection::Orthographic { height: 6.0 }] {
        let camera = Camera { projection, lens, ..CAMERA };
        let view = View::new(&camera, 40, 20).unwrap();
        let position = [31.0, 4.5];
        // The camera looks along -z from z = 3.
        let at_depth = |ray: &canted_trace::Ray, depth: f32| {
            let t = (3.0 - depth - ray.origin[2]) / ray.direction[2];
            [0, 1].map(|k| ray.origin[k] + t * ray.direction[k])
        };
        let middle = view.ray(position);
        let mut spread = 0.0_f32;
        for square in [[0.0, 0.0], [0.999, 0.5], [0.25, 0.75], [0.5, 0.5], [0.5, 0.999]] {
            let ray = view.ray_through_lens(position, square);
            let difference = |depth| {
                let (a, b) = (at_depth(&ray, depth), at_depth(&middle, depth));
                (a[0] - b[0]).hypot(a[1] - b[1])
            };
            // A dozen roundings of coordinates below 16.
            assert!(difference(4.0) < 12.0 * 16.0 * f32::EPSILON, "{projection:?} {square:?}: {}", difference(4.0));
            // By similar triangles the blur at twice the distance is as wide as the lens.
            assert!(difference(8.0) <= 0.5 + 1e-4);
            spread = spread.max(difference(8.0));
        }
        assert!(spread > 0.49, "{spread}");
    }
    for (radius, focus_distance) in [(0.0, 1.0), (1.0, 0.0), (f32::NAN, 1.0), (1.0, f32::INFINITY)] {
        let camera = Camera { lens: Some(Lens { radius, focus_distance }), ..CAMERA };
        assert!(matches!(View::new(&camera, 4, 2), Err(CameraError::Lens { .. })));
    }
}

/// Pixels per side of an image; odd, so that the edges of a square of three pixels coincide with pixel edges.
const N: u32 = 63;

/// Diameter, in pixels, of the blur disk of a square light with sides of three pixels on the axis at `depth`.
///
/// A uniform disk of diameter `D` has the variance `D²/16` along each axis, a square of side `a` has `a²/12`, and so a
/// pixel has 1/12. Variances of successive blurs add. At 100 samples about 900 rays hit the light, which gives the
/// variance to `1/√1800` and its root, the diameter, to 1.2 %. No light falls outside of disk, square and pixel
/// combined.
fn blur(camera: &Camera, depth: f32, pixel: f32, samples: u32) -> f64 {
    const SIDE: f32 = 3.0;
    let half = 0.5 * SIDE * pixel;
    let lamp = parallelogram([-half, -half, -depth], [2.0 * half, 0.0, 0.0], [0.0, 2.0 * half, 0.0], 0);
    let stage = scene(vec![lamp], vec![Material { emission: [1.0; 3], ..gray(0.0) }]);
    let film = film(&stage, camera, &settings(N, N, samples, 0));
    let (mut light, mut squares, mut edge) = (0.0, 0.0, 0.0_f64);
    for (index, pixel) in (0..).zip(film.pixels()).filter(|(_, pixel)| pixel.sum[0] > 0.0) {
        let at = [index % N, index / N].map(|i: u32| f64::from(i) + 0.5 - 0.5 * f64::from(N));
        let square = at[0] * at[0] + at[1] * at[1];
        (light, squares) = (light + pixel.sum[0], squares + pixel.sum[0] * square);
        edge = edge.max(square.sqrt());
    }
    let variance = squares / light / 2.0 - f64::from(SIDE).powi(2) / 12.0 - 1.0 / 12.0;
    let diameter = 4.0 * variance.max(0.0).sqrt();
    assert!(
        edge <= 0.5 * diameter * 1.05 + (0.5 * f64::from(SIDE) + 0.5) * std::f64::consts::SQRT_2,
        "{edge} {diameter}"
    );
    diameter
}

/// An aperture `A` focused at `s` blurs a point at depth `d` to a disk of diameter `A·|d - s|/(d·s)` in the plane at
/// distance 1, or `A·|d - s|/s` for an orthographic projection.
#[test]
fn blur_matches_the_thin_lens_formula() {
    const FOCUS: f32 = 4.0;
    let at_origin = Camera::pinhole([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 40.0);
    let of_perspective = 2.0 * 20.0_f32.to_radians().tan() / N as f32;
    let of_parallel = 6.0 / N as f32;
    for (depth, radius) in [(2.0_f32, 0.5_f32), (3.0, 1.0), (6.0, 1.0), (40.0, 0.5)] {
        let lens = Some(Lens { radius, focus_distance: FOCUS });
        let aside = f64::from(2.0 * radius * (depth - FOCUS).abs() / FOCUS);
        for projection in [at_origin.projection, Projection::Orthographic { height: 6.0 }] {
            let pixel = match projection {
                Projection::Perspective { .. } => of_perspective * depth,
                Projection::Orthographic { .. } => of_parallel,
            };
            let expected = aside / f64::from(pixel);
            if expected > 0.7 * f64::from(N) {
                continue;
            }
            let sharp = Camera { projection, ..at_origin };
            let found = blur(&Camera { lens, ..sharp }, depth, pixel, 100);
            assert!((found / expected - 1.0).abs() < 0.05, "{projection:?} {depth}: {found} pixels for {expected}");
            // In the plane of focus, and without a lens, only the square remains.
            assert!(blur(&sharp, depth, pixel, 4) < 1.0, "{projection:?} {depth}");
            let in_focus = Camera { lens: Some(Lens { radius, focus_distance: depth }), ..sharp };
            assert!(blur(&in_focus, depth, pixel, 4) < 1.0, "{projection:?} {depth}");
        }
    }
}

// Automatic cameras.

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
        let scene = scene(vec![object], vec![gray(0.5)]);
        for aspect in [0.5, 1.0, 16.0 / 9.0, 3.0] {
            let camera = framed(&scene, aspect);
            let from = unit([0.7, 0.5, 1.0]);
            assert!(dot(forward(&camera), from) < -0.999_99, "{name} {aspect}: {camera:?}");
            assert!(fills(&scene, &camera, aspect), "{name} {aspect}: {camera:?} {:?}", extremes(&scene, &camera));
        }
    }
}

/// What is flat and upright is seen from the side on which its fronts are; +z is the front of what has both.
#[test]
fn charts_are_viewed_from_the_front() {
    let plate = |size: [f32; 3]| cuboid(size.map(|x| -x), size, 0);
    let sheet = parallelogram([0.0; 3], [0.0, 2.0, 0.0], [3.0, 0.0, 0.0], 0);
    for (name, object, from) in [
        ("board", plate([3.0, 2.0, 0.1]), [0.0, 0.0, 1.0]),
        ("sign", plate([0.1, 2.0, 3.0]), [1.0, 0.0, 0.0]),
        ("sheet", sheet.clone(), [0.0, 0.0, -1.0]),
        ("turned sheet", inside_out(sheet), [0.0, 0.0, 1.0]),
        ("book", plate([3.0, 2.0, 0.5]), [0.7, 0.5, 1.0]),
        ("plate", plate([3.0, 0.1, 3.0]), [0.7, 0.5, 1.0]),
    ] {
        let scene = scene(vec![object], vec![gray(0.5)]);
        let camera = framed(&scene, 1.5);
        assert!(dot(forward(&camera), unit(from)) < -0.999_99, "{name}: {camera:?}");
        assert!(fills(&scene, &camera, 1.5), "{name}: {camera:?}");
    }
}

/// A mirrored node, triangles of the wrong winding, one level and two: the camera stands outside, at the same place.
#[test]
fn closed_objects_are_viewed_from_outside_whatever_their_winding() {
    let cube = cuboid([-1.0; 3], [1.0; 3], 0);
    let plain = scene(vec![cube.clone()], vec![gray(0.5)]);
    let mut mirrored = plain.clone();
    mirrored.instances = vec![place(0, Affine::scale([-1.0, 1.0, 1.0]))];
    let wrong = scene(vec![inside_out(cube)], vec![gray(0.5)]);
    let expected = framed(&plain, 1.5);
    for (name, scene) in [("plain", &plain), ("mirrored", &mirrored), ("wrong", &wrong)] {
        for levels in [Levels::One, Levels::Two] {
            let bvh = SceneBvh::build(scene, &SceneBvhConfig { levels, ..SceneBvhConfig::default() }).unwrap();
            assert_eq!(frame(scene, &bvh, 1.5), expected, "{name} {levels:?}");
        }
    }
}

/// A single-sided sheet is seen from the side on which it is drawn: from below, or from behind.
#[test]
fn single_sided_sheets_are_viewed_from_their_fronts() {
    let lying = parallelogram([0.0; 3], [0.0, 0.0, 2.0], [3.0, 0.0, 0.0], 0);
    let tilted = parallelogram([0.0; 3], [3.0, 0.0, 0.0], [0.0, 2.0, -2.0], 0);
    for (name, sheet, from) in [
        ("up", lying.clone(), [0.7, 0.5, 1.0]),
        ("down", inside_out(lying), [0.7, -0.5, 1.0]),
        ("front", tilted.clone(), [0.7, 0.5, 1.0]),
        ("back", inside_out(tilted), [-0.7, 0.5, -1.0]),
    ] {
        for double_sided in [false, true] {
            let scene = scene(vec![sheet.clone()], vec![Material { double_sided, ..gray(0.5) }]);
            let from = if double_sided { [0.7, 0.5, 1.0] } else { from };
            let camera = framed(&scene, 1.5);
            assert!(dot(forward(&camera), unit(from)) < -0.999_99, "{name} {double_sided}: {camera:?}");
        }
    }
}

/// What no ray hits does not make an object smaller in the picture, unless there is nothing else.
#[test]
fn invisible_materials_do_not_count() {
    let ball = sphere([0.0, 0.5, 0.0], 0.5, 3, 0);
    let alone = framed(&scene(vec![ball.clone()], vec![gray(0.5)]), 1.5);
    for (alpha, alpha_mode) in [(0.0, AlphaMode::Blend), (0.2, AlphaMode::Mask { cutoff: 0.5 })] {
        let hidden = Material { alpha, alpha_mode, ..gray(0.5) };
        let around = cuboid([-40.0; 3], [40.0; 3], 1);
        let both = scene(vec![ball.clone(), around], vec![gray(0.5), hidden.clone()]);
        assert_eq!(framed(&both, 1.5), alone, "{alpha_mode:?}");
        let only = scene(vec![cuboid([-1.0; 3], [1.0; 3], 0)], vec![hidden]);
        assert!(fills(&only, &framed(&only, 1.5), 1.5));
    }
}

/// A wide floor, and something small far away, do not make an object smaller in the picture.
#[test]
fn floors_and_strays_do_not_count() {
    let ball = || sphere([0.0, 0.5, 0.0], 0.5, 3, 0);
    let alone = framed(&scene(vec![ball()], vec![gray(0.5)]), 1.5);
    for (name, other, has_floor) in [
        ("floor", floor(50.0, 0.0, 0), true),
        ("slab", cuboid([-40.0, -1.0, -60.0], [40.0, -0.1, 60.0], 0), true),
        ("stray", sphere([200.0, 0.5, 0.0], 0.05, 2, 0), false),
    ] {
        let scene = scene(vec![ball(), other], vec![gray(0.5)]);
        let subject = Subject::new(&scene, [0.0, 1.0, 0.0]);
        assert_eq!(subject.frame(&scene, &BruteForce::new(&scene), 1.5), (alone, Shown::Object), "{name}");
        assert_eq!((subject.has_floor, subject.foot()), (has_floor, [0.0; 3]), "{name}");
    }
    // In one mesh, too.
    let mut both = ball();
    let stray = sphere([200.0, 0.5, 0.0], 0.05, 2, 0);
    let n = u32::try_from(both.positions.len()).unwrap();
    both.positions.extend(stray.positions);
    both.triangles.extend(stray.triangles.iter().map(|t| t.map(|i| i + n)));
    assert_eq!(framed(&scene(vec![both], vec![gray(0.5)]), 1.5), alone);
}

#[test]
fn cameras_that_show_nothing_are_recognized() {
    let scene = scene(vec![sphere([0.0; 3], 1.0, 3, 0), floor(50.0, -1.0, 0)], vec![gray(0.5)]);
    let (bvh, subject) = (BruteForce::new(&scene), Subject::new(&scene, [0.0, 1.0, 0.0]));
    for (eye, target, shows) in [
        ([0.0, 1.0, 5.0], [0.0; 3], true),
        ([0.0, 1.0, 5.0], [0.0, 1.0, 9.0], false),
        // Inside, too far, and the floor alone.
        ([0.0; 3], [0.0, 0.0, -1.0], false),
        ([0.0, 1.0, 90.0], [0.0; 3], false),
        ([0.0, 1.0, 5.0], [30.0, -1.0, 20.0], false),
    ] {
        let camera = Camera::pinhole(eye, target, [0.0, 1.0, 0.0], 40.0);
        assert_eq!(subject.is_shown_by(&scene, &bvh, &camera, 1.5), shows, "{eye:?} {target:?}");
    }
}

#[test]
fn test_detects_cameras_that_are_too_far_or_off_center() {
    let scene = scene(vec![cuboid([-1.0; 3], [1.0; 3], 0)], vec![gray(0.5)]);
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
    let camera = framed(&scene(vec![object.clone()], vec![gray(0.5)]), 1.5);
    for scale in [2.0_f32.powi(-40), 2.0_f32.powi(40)] {
        let mut scaled = object.clone();
        for position in &mut scaled.positions {
            *position = position.map(|x| x * scale);
        }
        let scaled = framed(&scene(vec![scaled], vec![gray(0.5)]), 1.5);
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
        let scene = scene(vec![room, block], vec![gray(0.5)]);
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
        let scene = scene(bodies, vec![gray(0.5)]);
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
    let point = scene(vec![crate::common::mesh(vec![[1.0, 2.0, 3.0]; 3], vec![[0, 1, 2]], 0)], vec![gray(0.5)]);
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
    let prepared = SceneBvh::build(&scene, &SceneBvhConfig::default()).unwrap();
    let camera = frame(&scene, &prepared, 16.0 / 9.0);
    Some((camera, scene.bounds_world().contains(camera.eye)))
}

#[test]
fn real_objects_are_viewed_from_outside() {
    for name in ["stanford/bunny.ply", "stanford/dragon_res4_be.ply", "truss/tower_crane.glb", "truss/truss_bridge.glb"]
    {
        if let Some((camera, is_inside)) = of_model(name) {
            assert!(!is_inside && dot(forward(&camera), unit([0.7, 0.5, 1.0])) < -0.999, "{name}: {camera:?}");
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
