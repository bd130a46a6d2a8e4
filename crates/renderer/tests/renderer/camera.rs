use canted_renderer::{CameraError, View};
use canted_scene::{Camera, Lens, Material, Projection};

use crate::common::{U, dot, film, grey, parallelogram, scene, settings, sub, unit};

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
    let stage = scene(vec![lamp], vec![Material { emission: [1.0; 3], ..grey(0.0) }]);
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
