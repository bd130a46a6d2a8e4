use canted_renderer::{CameraError, View};
use canted_scene::Camera;

use crate::common::{dot, sub, unit};

const CAMERA: Camera =
    Camera { eye: [1.0, 2.0, 3.0], target: [1.0, 2.0, -5.0], up: [0.0, 1.0, 0.0], fov_degrees: 90.0 };

fn direction(camera: &Camera, position: [f64; 2]) -> [f64; 3] {
    View::new(camera, 200, 100).unwrap().ray(position).direction.map(f64::from)
}

/// Two directions that differ by the rounding of `f32` only.
fn same(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).all(|k| (a[k] - b[k]).abs() <= f64::from(f32::EPSILON))
}

#[test]
fn the_picture_spans_the_field_of_view() {
    // 90 degrees from bottom to top: the edges lie at slope 1; twice as wide as high.
    assert!(same(direction(&CAMERA, [100.0, 50.0]), [0.0, 0.0, -1.0]));
    assert!(same(direction(&CAMERA, [100.0, 0.0]), unit([0.0, 1.0, -1.0])), "row 0 is the top");
    assert!(same(direction(&CAMERA, [100.0, 100.0]), unit([0.0, -1.0, -1.0])));
    assert!(same(direction(&CAMERA, [200.0, 50.0]), unit([2.0, 0.0, -1.0])), "x runs to the right");
    assert!(same(direction(&CAMERA, [0.0, 0.0]), unit([-2.0, 1.0, -1.0])));
}

#[test]
fn a_tilted_camera_looks_at_its_target_with_up_up() {
    let camera = Camera { eye: [3.0, 4.0, -2.0], target: [-1.0, 0.5, 7.0], up: [0.3, 2.0, 0.1], fov_degrees: 33.0 };
    let forward = unit(sub(camera.target.map(f64::from), camera.eye.map(f64::from)));
    assert!(same(direction(&camera, [100.0, 50.0]), forward));
    let (top, bottom) = (direction(&camera, [100.0, 0.0]), direction(&camera, [100.0, 100.0]));
    assert!((dot(top, bottom).acos().to_degrees() - 33.0).abs() < 1e-4);
    assert!(dot(sub(top, bottom), camera.up.map(f64::from)) > 0.0);
}

#[test]
fn rays_are_the_same_bits_at_every_power_of_two() {
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
fn unusable_cameras_are_named() {
    let refused = |camera: Camera| View::new(&camera, 8, 8).unwrap_err();
    assert_eq!(refused(Camera { target: CAMERA.eye, ..CAMERA }), CameraError::NoDirection { eye: CAMERA.eye });
    for up in [[0.0; 3], [0.0, 0.0, 2.0], [0.0, 0.0, -1.0]] {
        assert_eq!(refused(Camera { up, ..CAMERA }), CameraError::NoUp { up });
    }
    for degrees in [0.0, -1.0, 180.0, f32::INFINITY] {
        assert_eq!(refused(Camera { fov_degrees: degrees, ..CAMERA }), CameraError::FieldOfView { degrees });
    }
    let error = refused(Camera { eye: [f32::INFINITY, 0.0, 0.0], ..CAMERA });
    assert_eq!(error.to_string(), "camera eye [inf, 0.0, 0.0] is not finite");
    assert!(matches!(refused(Camera { fov_degrees: f32::NAN, ..CAMERA }), CameraError::FieldOfView { .. }));
}
