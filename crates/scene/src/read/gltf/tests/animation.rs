//! Animations, against values computed by hand.

use serde_json::{Value, json};

use super::{File, TRIANGLE};

/// The triangle on a node with one animation channel with key times 1, 2 and 4.
fn animated(path: &str, element: &str, values: &[f32], interpolation: &str) -> File {
    let mut file = File::of_nodes(json!([{ "mesh": 0 }]));
    let (input, output) = (file.reals("SCALAR", &[1.0, 2.0, 4.0]), file.reals(element, values));
    file.json["animations"] = json!([{
        "channels": [{ "sampler": 0, "target": { "node": 0, "path": path } }],
        "samplers": [{ "input": input, "output": output, "interpolation": interpolation }],
    }]);
    file
}

/// The columns of the only instance at a time.
#[track_caller]
fn columns(file: &File, time: f32) -> [[f32; 3]; 4] {
    let scene = file.read_at(time).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(scene.warnings, [""; 0]);
    scene.instances[0].world_from_object.columns
}

/// Position of the node at a time.
#[track_caller]
fn position(file: &File, time: f32) -> [f32; 3] {
    columns(file, time)[3]
}

const POSITIONS: [f32; 9] = [0.0, 1.0, 0.0, 8.0, 3.0, 0.0, 4.0, 3.0, 2.0];

#[test]
fn linear_and_step_interpolation() {
    let line = animated("translation", "VEC3", &POSITIONS, "LINEAR");
    for (time, want) in [
        (-5.0, [0.0, 1.0, 0.0]),
        (1.0, [0.0, 1.0, 0.0]),
        (1.25, [2.0, 1.5, 0.0]),
        (2.0, [8.0, 3.0, 0.0]),
        (3.0, [6.0, 3.0, 1.0]),
        (4.0, [4.0, 3.0, 2.0]),
        (1e9, [4.0, 3.0, 2.0]),
    ] {
        assert_eq!(position(&line, time), want, "{time}");
    }
    let step = animated("translation", "VEC3", &POSITIONS, "STEP");
    for (time, x) in [(0.0, 0.0), (1.99, 0.0), (2.0, 8.0), (3.99, 8.0), (4.0, 4.0)] {
        assert_eq!(position(&step, time)[0], x, "{time}");
    }
    assert_eq!(line.scene().instances[0].world_from_object.columns[3], [0.0; 3], "without a time it is not animated");
}

#[test]
fn cubic_spline_interpolation() {
    // Each key: in-tangent, value, out-tangent.
    let key = |into: f32, value: f32, out: f32| [[into, 0.0, 0.0], [value, 0.0, 0.0], [out, 0.0, 0.0]];
    let keys = [key(9.0, 0.0, 2.0), key(4.0, 8.0, 0.0), key(-2.0, 4.0, 9.0)].concat().concat();
    let spline = animated("translation", "VEC3", &keys, "CUBICSPLINE");
    // Halfway: the mean of the values plus an eighth of the interval times the difference of the tangents.
    for (time, x) in
        [(0.0, 0.0), (1.5, 4.0 + (2.0 - 4.0) / 8.0), (2.0, 8.0), (3.0, 6.0 + 2.0 * (0.0 + 2.0) / 8.0), (9.0, 4.0)]
    {
        assert_eq!(position(&spline, time)[0], x, "{time}");
    }
}

#[test]
fn rotations_and_scales_are_interpolated() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    // Rotations about z by 0, 90 (negated quaternion of length 2) and 180 degrees.
    let turns = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -2.0 * half, -2.0 * half, 0.0, 0.0, 1.0, 0.0];
    let file = animated("rotation", "VEC4", &turns, "LINEAR");
    for (time, degrees) in [(1.0, 0.0), (1.5, 45.0), (2.0, 90.0), (3.0, 135.0), (4.0, 180.0_f64)] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let [x, ..] = columns(&file, time).map(|column| column.map(f64::from));
        // Each component of the quaternion is rounded once.
        let bound = 4.0 * f64::from(f32::EPSILON);
        assert!((x[0] - cos).abs() <= bound && (x[1] - sin).abs() <= bound, "{x:?} at {time}");
    }
    let scales = [1.0, 1.0, 1.0, 3.0, 1.0, 1.0, 3.0, 5.0, 1.0];
    let columns = columns(&animated("scale", "VEC3", &scales, "LINEAR"), 3.0);
    assert_eq!([columns[0][0], columns[1][1], columns[2][2]], [3.0, 3.0, 1.0]);
}

#[test]
fn weights_deform_the_mesh() {
    let mut file = animated("weights", "SCALAR", &[0.0, 1.0, 1.0, 0.0, 0.5, 0.0], "LINEAR");
    let lift = file.reals("VEC3", &[0.0, 0.0, 4.0].repeat(3));
    let push = file.reals("VEC3", &[8.0, 0.0, 0.0].repeat(3));
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": lift }, { "POSITION": push }]);
    let first = |time| file.read_at(time).unwrap().meshes[0].positions[0];
    assert_eq!(first(0.0), [8.0, 0.0, 0.0]);
    assert_eq!(first(1.25), [6.0, 0.0, 1.0]);
    assert_eq!(first(3.0), [0.0, 0.0, 3.0]);
}

#[test]
fn cubic_weights_have_three_values_per_weight() {
    let mut file = animated("weights", "SCALAR", &[], "CUBICSPLINE");
    // Per key, for two weights: in-tangents, values, out-tangents.
    let keys = [[0.0, 0.0, 1.0, 2.0, 0.0, 0.0], [0.0, 0.0, 3.0, 4.0, 0.0, 0.0], [0.0, 0.0, 5.0, 6.0, 0.0, 0.0]];
    let output = file.reals("SCALAR", &keys.concat());
    file.json["animations"][0]["samplers"][0]["output"] = json!(output);
    let lift = file.reals("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    let push = file.reals("VEC3", &[1.0, 0.0, 0.0].repeat(3));
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": lift }, { "POSITION": push }]);
    for (time, want) in [(1.0, [2.0, 0.0, 1.0]), (1.5, [3.0, 0.0, 2.0]), (4.0, [6.0, 0.0, 5.0])] {
        assert_eq!(file.read_at(time).unwrap().meshes[0].positions[0], want, "{time}");
    }
}

#[test]
fn joints_move_the_skin() {
    let mut file = animated("translation", "VEC3", &POSITIONS, "LINEAR");
    let joints = file.accessor(super::U8, "VEC4", 3, &[0; 12]);
    let weights = file.reals("VEC4", &[1.0, 0.0, 0.0, 0.0].repeat(3));
    file.push("skins", json!({ "joints": [0] }));
    let attributes = &mut file.json["meshes"][0]["primitives"][0]["attributes"];
    (attributes["JOINTS_0"], attributes["WEIGHTS_0"]) = (json!(joints), json!(weights));
    file.json["nodes"] = json!([{}, { "mesh": 0, "skin": 0 }]);
    let scene = file.read_at(3.0).unwrap();
    let want: Vec<[f32; 3]> = TRIANGLE.chunks(3).map(|p| [p[0] + 6.0, p[1] + 3.0, p[2] + 1.0]).collect();
    assert_eq!(scene.meshes[0].positions, want);
}

#[test]
fn unsupported_animations_are_reported() {
    let warnings = |file: &File| file.read_at(1.0).unwrap().warnings.join("|");
    assert_eq!(
        warnings(&File::of_nodes(json!([{ "mesh": 0 }]))),
        "ignoring the time, the file has no animation: time 1"
    );
    let line = animated("translation", "VEC3", &POSITIONS, "LINEAR");
    let with = |change: &dyn Fn(&mut Value)| {
        let mut file = line.clone();
        change(&mut file.json);
        file
    };
    let several = with(&|json| {
        let second = json["animations"][0].clone();
        json["animations"].as_array_mut().unwrap().push(second);
        json["animations"][0]["name"] = json!("walk");
    });
    assert_eq!(warnings(&several), "using only the first of several animations: animation 0 \"walk\"");
    let fixed = with(&|json| json["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]));
    assert_eq!(warnings(&fixed), "ignoring the animation of a node with a matrix: node 0");
    let odd = with(&|json| json["animations"][0]["channels"][0]["target"]["path"] = json!("pointer"));
    assert!(warnings(&odd).contains("animation 0 channel 0"));
    let loose =
        with(&|json| drop(json["animations"][0]["channels"][0]["target"].as_object_mut().unwrap().remove("node")));
    assert_eq!(warnings(&loose), "ignoring channels without a target node: animation 0, 1 channels");
}

#[test]
fn invalid_animations_are_rejected() {
    let rejected = |change: &dyn Fn(&mut File), thing: &str| {
        let mut file = animated("translation", "VEC3", &POSITIONS, "LINEAR");
        change(&mut file);
        file.scene();
        let error = file.read_at(1.0).expect_err(thing).to_string();
        assert!(error.contains("animation 0 channel 0") && error.contains(thing), "{error}");
    };
    let sampler = |key: &'static str, value: Value| {
        move |file: &mut File| file.json["animations"][0]["samplers"][0][key] = value.clone()
    };
    rejected(&|file| file.json["animations"][0]["channels"][0]["sampler"] = json!(1), "sampler index 1 out of range");
    rejected(
        &|file| file.json["animations"][0]["channels"][0]["target"]["node"] = json!(7),
        "node index 7 out of range",
    );
    rejected(&sampler("input", json!(9)), "accessor index 9");
    rejected(&sampler("interpolation", json!("CUBIC")), "unknown interpolation");
    rejected(&sampler("interpolation", json!("CUBICSPLINE")), "3 values for 3 keys");
    for (times, thing) in [
        ([1.0, 1.0, 2.0], "key time 1 after 1"),
        ([1.0, 3.0, 2.0], "key time 2 after 3"),
        ([0.0, f32::NAN, 2.0], "not finite"),
    ] {
        let change = |file: &mut File| {
            let input = file.reals("SCALAR", &times);
            file.json["animations"][0]["samplers"][0]["input"] = json!(input);
        };
        rejected(&change, thing);
    }
}
