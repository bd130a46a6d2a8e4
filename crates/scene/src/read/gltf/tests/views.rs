//! Cameras and lights of nodes.

use serde_json::{Value, json};

use super::File;
use crate::{Camera, Light, Projection};

/// The triangle and a second node.
fn file(node: Value) -> File {
    File::of_nodes(json!([{ "mesh": 0 }, node]))
}

fn with_camera(node: Value, camera: Value) -> File {
    let mut node = node;
    node["camera"] = json!(0);
    let mut file = file(node);
    file.push("cameras", camera);
    file
}

fn perspective(yfov: f64) -> Value {
    json!({ "type": "perspective", "perspective": { "yfov": yfov, "znear": 0.1 } })
}

#[test]
fn cameras_look_along_minus_z() {
    let right_angle = std::f64::consts::FRAC_PI_2;
    let scene =
        with_camera(json!({ "translation": [0.5, 0, 0.25], "scale": [3, 3, 3] }), perspective(right_angle)).scene();
    let want = Camera::pinhole([0.5, 0.0, 0.25], [0.5, 0.0, -0.75], [0.0, 1.0, 0.0], 90.0);
    assert_eq!(scene.cameras, [want]);
    // A rotation by 90 degrees about x looks up.
    let scene = with_camera(json!({ "rotation": [1, 0, 0, 1] }), perspective(1.0)).scene();
    let [camera] = scene.cameras[..] else { panic!("one camera") };
    assert_eq!((camera.target, camera.up), ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]));
}

fn orthographic(ymag: f64) -> Value {
    json!({ "type": "orthographic", "orthographic": { "xmag": 3, "ymag": ymag, "znear": 0, "zfar": 1 } })
}

#[test]
fn orthographic_height_is_twice_ymag() {
    let scene = with_camera(json!({ "translation": [0, 0, 1] }), orthographic(1.5)).scene();
    let like = Camera::pinhole([0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 90.0);
    assert_eq!(scene.cameras, [Camera { projection: Projection::Orthographic { height: 3.0 }, ..like }]);
}

#[test]
fn distant_cameras_keep_their_direction() {
    let node = json!({ "translation": [1e7, 1e7, 1e7], "rotation": [0.1, 0.2, 0.3, 0.9] });
    let near = with_camera(json!({ "rotation": [0.1, 0.2, 0.3, 0.9] }), perspective(1.0)).scene().cameras[0];
    let far = with_camera(node, perspective(1.0)).scene().cameras[0];
    let direction = |camera: Camera| -> [f64; 3] {
        let view: [f64; 3] = std::array::from_fn(|k| f64::from(camera.target[k]) - f64::from(camera.eye[k]));
        let length = view.iter().map(|x| x * x).sum::<f64>().sqrt();
        view.map(|x| x / length)
    };
    // The target's coordinates are at most twice the eye's, so rounding is at most 2 ULP of those.
    let bound = 2.0 * f64::from(f32::EPSILON) * 3.0_f64.sqrt();
    for (a, b) in direction(near).into_iter().zip(direction(far)) {
        assert!((a - b).abs() <= bound, "{a} {b}");
    }
}

#[test]
fn invalid_cameras_are_reported() {
    let node = json!({});
    for (camera, why) in [
        (perspective(0.0), "field of view"),
        (perspective(3.15), "field of view"),
        (orthographic(0.0), "ymag of 0"),
        (orthographic(-1.0), "ymag of -1"),
        (json!({ "type": "perspective" }), "no projection"),
        (json!({ "type": "panoramic" }), "no projection"),
    ] {
        assert!(with_camera(node.clone(), camera).warned(why).cameras.is_empty());
    }
    for node in [json!({ "scale": [1, 1, 0] }), json!({ "scale": [1, 0, 1] }), json!({ "translation": [1e39, 0, 0] })] {
        with_camera(node, perspective(1.0)).warned("no orientation");
    }
    file(json!({ "camera": 0 })).rejected("node 1: camera index 0 out of range");
}

fn with_light(node: Value, light: Value) -> File {
    let mut node = node;
    node["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
    let mut file = file(node);
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
    file.json["extensionsRequired"] = json!(["KHR_lights_punctual"]);
    file
}

#[test]
fn reads_directional_and_point_lights() {
    let rotated_about_y = json!({ "rotation": [0, 1, 0, 1], "scale": [2, 2, 2] });
    let sun = json!({ "type": "directional", "color": [1, 0.5, 0.25], "intensity": 4 });
    let scene = with_light(rotated_about_y, sun).scene();
    assert_eq!(scene.lights, [Light::Sun { direction: [-1.0, 0.0, 0.0], irradiance: [4.0, 2.0, 1.0] }]);
    let scene = with_light(json!({ "translation": [1, 2, 3] }), json!({ "type": "point" })).scene();
    assert_eq!(scene.lights, [Light::Point { position: [1.0, 2.0, 3.0], intensity: [1.0; 3] }]);
}

#[test]
fn reads_spot_lights() {
    let along_x = json!({ "translation": [1, 2, 3], "rotation": [0, -1, 0, 1] });
    let cone = json!({ "innerConeAngle": 0, "outerConeAngle": std::f64::consts::FRAC_PI_3 });
    for (spot, cos_outer) in [(cone, 0.5), (json!({}), std::f32::consts::FRAC_1_SQRT_2)] {
        let scene = with_light(along_x.clone(), json!({ "type": "spot", "spot": spot, "intensity": 2 })).scene();
        let [Light::Spot { position, direction, intensity, cos_inner, cos_outer: found }] = scene.lights[..] else {
            panic!("one spot")
        };
        assert_eq!((position, direction, intensity), ([1.0, 2.0, 3.0], [1.0, 0.0, 0.0], [2.0; 3]));
        // The angle in the file is rounded once and its cosine once.
        assert!(cos_inner == 1.0 && (found - cos_outer).abs() <= f32::EPSILON, "{cos_inner} {found}");
    }
    with_light(json!({}), json!({ "type": "spot", "spot": { "outerConeAngle": 0.000245 } })).scene();
    let ranged = with_light(json!({}), json!({ "type": "point", "range": 5 })).warned("range of lights");
    assert_eq!(ranged.lights.len(), 1);
}

#[test]
fn invalid_lights_are_reported() {
    for (light, why) in [
        (json!({ "type": "point", "intensity": -1 }), "intensity -1"),
        (json!({ "type": "point", "color": [0, -1, 0] }), "color"),
        (json!({ "type": "spot", "spot": { "innerConeAngle": 1, "outerConeAngle": 1 } }), "cone angles 1 and 1"),
        (json!({ "type": "spot", "spot": { "innerConeAngle": -0.5 } }), "cone angles -0.5"),
        (json!({ "type": "spot", "spot": { "outerConeAngle": 1.6 } }), "and 1.6 must"),
        (
            json!({ "type": "spot", "spot": { "outerConeAngle": 1e-4 } }),
            "cosines of cone angles 0 and 0.0001 are equal in single precision (the smallest cone from 0 is 0.000245)",
        ),
        (json!({ "type": "spot", "spot": { "outerConeAngle": 0.000244 } }), "are equal in single precision"),
        (json!({ "type": "laser" }), "unknown type"),
    ] {
        assert!(with_light(json!({}), light).warned(why).lights.is_empty());
    }
    let flat = json!({ "scale": [1, 1, 0] });
    with_light(flat, json!({ "type": "directional" })).warned("no orientation");
    file(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }))
        .rejected("node 1: light index 0 out of range");
}
