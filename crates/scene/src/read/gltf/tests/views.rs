//! Cameras and lights that nodes place.

use serde_json::{Value, json};

use super::File;
use crate::{Camera, Light};

/// The triangle, and a node with these keys.
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
    // A quarter turn about x looks up.
    let scene = with_camera(json!({ "rotation": [1, 0, 0, 1] }), perspective(1.0)).scene();
    let [camera] = scene.cameras[..] else { panic!("one camera") };
    assert_eq!((camera.target, camera.up), ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]));
}

#[test]
fn cameras_far_out_still_look_the_same_way() {
    let node = json!({ "translation": [1e7, 1e7, 1e7], "rotation": [0.1, 0.2, 0.3, 0.9] });
    let near = with_camera(json!({ "rotation": [0.1, 0.2, 0.3, 0.9] }), perspective(1.0)).scene().cameras[0];
    let far = with_camera(node, perspective(1.0)).scene().cameras[0];
    let direction = |camera: Camera| -> [f64; 3] {
        let view: [f64; 3] = std::array::from_fn(|k| f64::from(camera.target[k]) - f64::from(camera.eye[k]));
        let length = view.iter().map(|x| x * x).sum::<f64>().sqrt();
        view.map(|x| x / length)
    };
    // The target is at most twice as far out as the eye, so it is rounded by at most 2 ULP of the eye's coordinate.
    let bound = 2.0 * f64::from(f32::EPSILON) * 3.0_f64.sqrt();
    for (a, b) in direction(near).into_iter().zip(direction(far)) {
        assert!((a - b).abs() <= bound, "{a} {b}");
    }
}

#[test]
fn cameras_that_cannot_be_used_are_said() {
    let ortho = json!({ "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "znear": 0, "zfar": 1 } });
    let node = json!({});
    for (camera, why) in [
        (perspective(0.0), "field of view"),
        (perspective(3.15), "field of view"),
        (ortho, "orthographic"),
        (json!({ "type": "perspective" }), "no projection"),
        (json!({ "type": "panoramic" }), "no projection"),
    ] {
        assert!(with_camera(node.clone(), camera).warned(why).cameras.is_empty());
    }
    for node in [json!({ "scale": [1, 1, 0] }), json!({ "scale": [1, 0, 1] }), json!({ "translation": [1e39, 0, 0] })] {
        with_camera(node, perspective(1.0)).warned("without an orientation");
    }
    file(json!({ "camera": 0 })).refused("node 1: names camera 0 of 0");
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
fn suns_and_points() {
    let quarter_turn_about_y = json!({ "rotation": [0, 1, 0, 1], "scale": [2, 2, 2] });
    let sun = json!({ "type": "directional", "color": [1, 0.5, 0.25], "intensity": 4 });
    let scene = with_light(quarter_turn_about_y, sun).scene();
    assert_eq!(scene.lights, [Light::Sun { direction: [-1.0, 0.0, 0.0], irradiance: [4.0, 2.0, 1.0] }]);
    let scene = with_light(json!({ "translation": [1, 2, 3] }), json!({ "type": "point" })).scene();
    assert_eq!(scene.lights, [Light::Point { position: [1.0, 2.0, 3.0], intensity: [1.0; 3] }]);
}

#[test]
fn lights_that_cannot_be_used_are_said() {
    for (light, why) in [
        (json!({ "type": "point", "intensity": -1 }), "intensity -1"),
        (json!({ "type": "point", "color": [0, -1, 0] }), "color"),
        (json!({ "type": "spot", "spot": {} }), "is a spot"),
        (json!({ "type": "laser" }), "unknown type"),
    ] {
        assert!(with_light(json!({}), light).warned(why).lights.is_empty());
    }
    let flat = json!({ "scale": [1, 1, 0] });
    with_light(flat, json!({ "type": "directional" })).warned("has no direction");
    file(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } })).refused("node 1: names light 0 of 0");
}
