//! Default poses (morph targets and skins), animations against values computed by hand, and poses of open files: each equals the scene
//! that is read at that time, and bad poses are reported.

use std::path::Path;

use canted_fixtures::models;
use canted_scene::{AnimatedScene, ReadError, ReadOptions, Scene, read_with};
use serde_json::{Value, json};

use super::{F32, File, TRIANGLE, U8};

/// Column-major 4 x 4 matrix of a translation by `x`.
fn translation(x: f32) -> [f32; 16] {
    [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0]
}

/// The triangle with a morph target that moves vertices by 4 along z and tilts normals.
fn morphing() -> File {
    let mut file = File::new();
    let (positions, normals) = (file.reals("VEC3", &TRIANGLE), file.reals("VEC3", &[0.0, 0.0, 1.0].repeat(3)));
    let (lift, tilt) =
        (file.reals("VEC3", &[0.0, 0.0, 4.0].repeat(3)), file.reals("VEC3", &[1.0, 0.0, -1.0].repeat(3)));
    file.with_node(json!([{
        "attributes": { "POSITION": positions, "NORMAL": normals },
        "targets": [{ "POSITION": lift, "NORMAL": tilt }],
    }]))
}

#[test]
fn morph_weights_of_the_mesh_or_the_node() {
    let mut file = morphing();
    let first = |file: &File| {
        let mesh = &file.scene().meshes[0];
        (mesh.positions[1], mesh.normals.as_ref().unwrap()[1])
    };
    assert_eq!(first(&file), ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), "weights default to zero");
    file.json["meshes"][0]["weights"] = json!([0.25]);
    assert_eq!(first(&file).0, [1.0, 0.0, 1.0]);
    file.json["nodes"][0]["weights"] = json!([0.25]);
    file.push("nodes", json!({ "mesh": 0 }));
    assert_eq!(file.scene().meshes.len(), 1, "equal weights share the mesh");
    file.json["nodes"].as_array_mut().unwrap().pop();
    file.json["nodes"][0]["weights"] = json!([1]);
    assert_eq!(first(&file), ([1.0, 0.0, 4.0], [1.0, 0.0, 0.0]));
    file.push("nodes", json!({ "mesh": 0 }));
    let scene = file.scene();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (2, 2), "different weights need a copy");
    let heights: Vec<f32> =
        scene.instances.iter().map(|instance| scene.meshes[instance.mesh.0 as usize].positions[0][2]).collect();
    assert_eq!(heights, [4.0, 1.0]);
    assert!(
        scene.instances.iter().all(|instance| instance.first_primitive == 0),
        "both have the numbers of the file's mesh"
    );
}

#[test]
fn mismatched_morph_targets_are_rejected() {
    let mut file = morphing();
    let short = file.reals("VEC3", &[0.0; 6]);
    file.json["meshes"][0]["weights"] = json!([1]);
    file.json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = json!(short);
    file.rejected("morph target has 2 elements, expected 3");
}

#[test]
fn active_unsupported_morph_targets_are_reported() {
    let mut file = morphing();
    let (shift, tint) = (file.reals("VEC2", &[0.5; 6]), file.reals("VEC4", &[0.5; 12]));
    let target = &mut file.json["meshes"][0]["primitives"][0]["targets"][0];
    (target["TEXCOORD_0"], target["COLOR_0"]) = (json!(shift), json!(tint));
    file.scene();
    file.json["nodes"][0]["weights"] = json!([0.5]);
    file.push("nodes", json!({ "mesh": 0, "weights": [1] }));
    let warning = |name| format!("ignoring {name} of morph targets (not supported): mesh 0 and 1 more");
    assert_eq!(file.read().unwrap().warnings, ["TEXCOORD_0", "COLOR_0"].map(warning));
    // Unused meshes are not reported.
    let mesh = file.json["meshes"][0].clone();
    file.push("meshes", mesh);
    file.json["meshes"][1]["weights"] = json!([1]);
    file.json["nodes"] = json!([{ "mesh": 0 }]);
    file.scene();
}

#[test]
fn excess_weights_are_reported() {
    let mut file = morphing();
    file.json["meshes"][0]["weights"] = json!([0.25, 0.5, 1]);
    let scene = file.warned("ignoring weights without a morph target: mesh 0, 3 weights for 1 targets");
    assert_eq!(scene.meshes[0].positions[1], [1.0, 0.0, 1.0]);
    file.json["nodes"][0]["weights"] = json!([1, 1]);
    file.warned("ignoring weights without a morph target: node 0, 2 weights for 1 targets");
}

/// The triangle in a skin of two joints, translated by 10 and 30 from their bind pose.
fn skinned(joints: &[u8; 12], weights: &[f32; 12]) -> File {
    let mut file = File::new();
    let (positions, normals) = (file.reals("VEC3", &TRIANGLE), file.reals("VEC3", &[0.0, 0.0, 1.0].repeat(3)));
    let (joints, weights) = (file.accessor(U8, "VEC4", 3, joints), file.reals("VEC4", weights));
    let inverse_binds = file.reals("MAT4", &[translation(-1.0), translation(-2.0)].concat());
    file.push("skins", json!({ "joints": [1, 2], "inverseBindMatrices": inverse_binds }));
    let attributes = json!({ "POSITION": positions, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights });
    let mesh = file.mesh(json!([{ "attributes": attributes }]));
    file.json["nodes"] = json!([
        { "mesh": mesh, "skin": 0, "translation": [1000, 0, 0] },
        { "children": [2], "translation": [11, 0, 0] },
        { "translation": [21, 0, 0] },
    ]);
    file
}

const JOINTS: [u8; 12] = [0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 9, 9];
const WEIGHTS: [f32; 12] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0];

#[test]
fn skins_follow_joints_and_ignore_the_node() {
    let scene = skinned(&JOINTS, &WEIGHTS).scene();
    assert_eq!(scene.meshes[0].positions, [[10.0, 0.0, 0.0], [31.0, 0.0, 0.0], [20.0, 1.0, 0.0]]);
    assert_eq!(scene.instances[0].world_from_object, canted_obb::Affine::IDENTITY);
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 1));
}

#[test]
fn weights_are_normalized() {
    let scene = skinned(&JOINTS, &WEIGHTS.map(|weight| 4.0 * weight)).scene();
    assert_eq!(scene.meshes[0].positions[2], [20.0, 1.0, 0.0]);
}

#[test]
fn normals_follow_joints() {
    let mut file = skinned(&JOINTS, &WEIGHTS);
    // The first joint rotates by 180 degrees about x and scales; the normal stays normalized.
    file.json["nodes"][1]["rotation"] = json!([1, 0, 0, 0]);
    file.json["nodes"][1]["scale"] = json!([3, 1, 5]);
    let scene = file.scene();
    assert_eq!(scene.meshes[0].normals.as_ref().unwrap()[0], [0.0, 0.0, -1.0]);
}

#[test]
fn invalid_skins_are_rejected() {
    let mut joints = JOINTS;
    joints[4] = 2;
    skinned(&joints, &WEIGHTS).rejected("joint 2 of vertex 1 is not in the skin");
    let with = |change: &dyn Fn(&mut Value)| {
        let mut file = skinned(&JOINTS, &WEIGHTS);
        change(&mut file.json);
        file
    };
    with(&|json| json["skins"][0]["joints"] = json!([1, 2, 0]))
        .rejected("skin 0: 2 inverse bind matrices for 3 joints");
    with(&|json| json["skins"][0]["joints"] = json!([1, 9])).rejected("skin 0: node index 9 out of range");
    with(&|json| json["nodes"][0]["skin"] = json!(1)).rejected("node 0: skin index 1 out of range");
    with(&|json| json["accessors"][3]["count"] = json!(2)).rejected("joints or weights do not match 3 vertices");
    with(&|json| json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = Value::Null).rejected("json");
    with(&|json| {
        let attributes = json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap();
        attributes.remove("WEIGHTS_0");
    })
    .rejected("needs joints and weights");
    with(&|json| json["accessors"][4]["componentType"] = json!(F32 + 1)).rejected("accessor 4");
}

#[test]
fn unweighted_vertices_follow_the_first_joint() {
    let mut weights = WEIGHTS;
    (weights[4], weights[8], weights[9]) = (0.0, 1.0, -1.0);
    let scene = skinned(&JOINTS, &weights)
        .warned("vertices with zero joint weights, attached to the first joint of their skin: 2");
    assert_eq!(scene.meshes[0].positions, [[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [10.0, 1.0, 0.0]]);
    assert_eq!(scene.meshes[0].normals.as_deref().unwrap(), [[0.0, 0.0, 1.0]; 3]);
    let mut jointless = skinned(&JOINTS, &[0.0; 12]);
    jointless.json["skins"][0]["joints"] = json!([]);
    jointless.rejected("joint 0 of vertex 0 is not in the skin");
}

/// A roof of two triangles that a target folds along the ridge. The target stores no normals, so they follow the triangles.
#[test]
fn normals_of_targets_without_normals_follow_the_triangles() {
    let flat = |seam: bool| {
        let mut file = File::new();
        // Two triangles on either side of the ridge x = 0; with a seam, each has its own vertices on it.
        let [left, right] =
            [[0.0, -1.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0]];
        let mut down: Vec<f32> = [[0.0; 9], [0.0; 9]].concat();
        (down[8], down[17]) = (-1.0, -1.0);
        let positions: Vec<f32> = [left, right].concat();
        let normals = [0.0, 0.0, 1.0].repeat(6);
        let indices: &[u8] = if seam { &[0, 1, 2, 3, 4, 5] } else { &[0, 1, 2, 1, 0, 5] };
        let (positions, normals) = (file.reals("VEC3", &positions), file.reals("VEC3", &normals));
        let (down, indices) = (file.reals("VEC3", &down), file.accessor(U8, "SCALAR", indices.len(), indices));
        file.with_node(json!([{
            "attributes": { "POSITION": positions, "NORMAL": normals },
            "indices": indices,
            "targets": [{ "POSITION": down }],
        }]))
    };
    for seam in [false, true] {
        let mut file = flat(seam);
        let normals = |file: &File| file.scene().meshes[0].normals.clone().unwrap();
        assert!(normals(&file).iter().all(|normal| *normal == [0.0, 0.0, 1.0]), "without weight");
        file.json["meshes"][0]["weights"] = json!([1]);
        let folded = normals(&file);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let is_near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(is_near(folded[0], [0.0, 0.0, 1.0]), "smooth at the ridge: {folded:?}");
        assert!(is_near(folded[2], [-half, 0.0, half]), "{folded:?}");
        assert!(is_near(folded[folded.len() - 1], [half, 0.0, half]), "{folded:?}");
        // A small weight changes normals little.
        file.json["meshes"][0]["weights"] = json!([0.001]);
        assert!(normals(&file).iter().all(|[x, _, z]| x.abs() < 2e-3 && (z - 1.0).abs() < 1e-5));
    }
}

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
    let joints = file.accessor(U8, "VEC4", 3, &[0; 12]);
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
    assert!(warnings(&odd).contains("animation 0, ''"), "{}", warnings(&odd));
    let loose =
        with(&|json| drop(json["animations"][0]["channels"][0]["target"].as_object_mut().unwrap().remove("node")));
    assert_eq!(warnings(&loose), "ignoring channels without a target node: animation 0, 1 channels");
}

/// `KHR_animation_pointer`: the same poses as by a node and a path.
#[test]
fn pointers_to_nodes_animate_them() {
    let turn = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0];
    for (path, element, values) in [
        ("translation", "VEC3", &POSITIONS[..]),
        ("scale", "VEC3", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]),
        ("rotation", "VEC4", &turn),
    ] {
        let by_node = animated(path, element, values, "LINEAR");
        let mut file = by_node.clone();
        let pointer = json!({ "pointer": format!("/nodes/0/{path}") });
        file.json["animations"][0]["channels"][0]["target"] =
            json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": pointer } });
        file.json["extensionsUsed"] = json!(["KHR_animation_pointer"]);
        file.json["extensionsRequired"] = json!(["KHR_animation_pointer"]);
        for time in [0.0, 1.5, 3.0, 9.0] {
            assert_eq!(columns(&file, time), columns(&by_node, time), "{path} at {time}");
        }
        let target = &mut file.json["animations"][0]["channels"][0]["target"];
        target["extensions"]["KHR_animation_pointer"]["pointer"] = json!("/materials/0/alphaCutoff");
        let what = "ignoring animated properties other than transforms and weights of nodes";
        let warnings = file.read_at(1.0).unwrap().warnings;
        assert_eq!(warnings, [format!("{what}: animation 0, '/materials/0/alphaCutoff'")]);
        let target = &mut file.json["animations"][0]["channels"][0]["target"];
        target["extensions"]["KHR_animation_pointer"]["pointer"] = json!(format!("/nodes/7/{path}"));
        let warnings = file.read_at(1.0).unwrap().warnings;
        assert_eq!(warnings, [format!("ignoring animated properties of absent nodes: animation 0, '/nodes/7/{path}'")]);
    }
    let mut weights = File::new();
    let (times, near) = (weights.reals("SCALAR", &[0.0, 1.0]), weights.reals("SCALAR", &[0.0, 1.0]));
    let (positions, moved) = (weights.reals("VEC3", &TRIANGLE), weights.reals("VEC3", &[1.0; 9]));
    weights.mesh(json!([{ "attributes": { "POSITION": positions }, "targets": [{ "POSITION": moved }] }]));
    weights.json["nodes"] = json!([{ "mesh": 0 }]);
    let target =
        json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": "/nodes/0/weights" } } });
    weights.json["animations"] =
        json!([{ "channels": [{ "sampler": 0, "target": target }], "samplers": [{ "input": times, "output": near }] }]);
    assert_eq!(weights.read_at(0.5).unwrap().meshes[0].positions[0], [0.5; 3]);
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

/// A triangle that node 0 moves by 8 in a second of animation 0, and by `far` of animation 1; node 2 shows the triangle
/// with a morph target `lift` of a weight that goes from 0 to 1.
fn moving(far: f32, [x, y, z]: [f32; 3]) -> File {
    let mut file = File::new();
    let (triangle, times) = (file.reals("VEC3", &TRIANGLE), file.reals("SCALAR", &[0.0, 1.0]));
    let near = file.reals("VEC3", &[0.0, 0.0, 0.0, 8.0, 0.0, 0.0]);
    let far = file.reals("VEC3", &[0.0, 0.0, 0.0, far, 0.0, 0.0]);
    let lift = file.reals("VEC3", &[0.0, 0.0, 0.0, x, y, z, 0.0, 0.0, 0.0]);
    file.json["meshes"] = json!([
        { "name": "fixed", "primitives": [{ "attributes": { "POSITION": triangle } }] },
        { "name": "sail", "primitives": [{ "attributes": { "POSITION": triangle }, "targets": [{ "POSITION": lift }] }] },
    ]);
    file.json["nodes"] = json!([{ "mesh": 0 }, { "mesh": 0, "translation": [0, 5, 0] }, { "mesh": 1 }]);
    let slide = json!({ "sampler": 0, "target": { "node": 0, "path": "translation" } });
    let lifts = json!({ "sampler": 1, "target": { "node": 2, "path": "weights" } });
    let samplers = json!([{ "input": times, "output": near }, { "input": times, "output": times }]);
    file.json["animations"] = json!([
        { "name": "slide", "channels": [slide, lifts], "samplers": samplers },
        { "channels": [slide], "samplers": [{ "input": times, "output": far }] },
    ]);
    file
}

fn options_at(time: f32, animation: Option<&str>) -> ReadOptions {
    ReadOptions { time: Some(time), animation: animation.map(str::to_owned), ..ReadOptions::default() }
}

/// Everything that a pose may change, and everything that it must not.
fn everything(scene: &Scene) -> String {
    format!("{scene:?}")
}

/// Compares poses in any order with the file read at that time.
#[track_caller]
fn poses_match(path: &Path, animation: Option<&str>, times: &[f32]) {
    let (mut animated, mut scene) = AnimatedScene::open(path, &options_at(times[0], animation)).unwrap();
    assert!(animated.is_animated());
    for &time in times.iter().chain(times.iter().rev()) {
        let mut read = read_with(path, &options_at(time, animation)).unwrap();
        animated.pose(time, &mut scene).unwrap();
        // The warnings of a pose do not repeat those of materials and images.
        let without_warnings = |scene: &mut Scene| std::mem::take(&mut scene.warnings);
        let (ours, theirs) = (without_warnings(&mut scene), without_warnings(&mut read));
        assert!(ours.iter().all(|warning| theirs.contains(warning)), "{ours:?} {theirs:?}");
        assert_eq!(everything(&scene), everything(&read), "{path:?} at {time}");
    }
}

#[test]
fn poses_are_those_of_the_file_read_at_that_time() {
    let (_folder, path) = moving(-4.0, [0.0, 0.0, 2.0]).saved();
    // At 0 the second mesh has its default weights, so that it is no deformed copy.
    for animation in [None, Some("slide"), Some("0"), Some("1")] {
        poses_match(&path, animation, &[0.0, 0.25, 1.0, 7.0, -1.0, 0.5]);
    }
    let (mut animated, mut scene) = AnimatedScene::open(&path, &options_at(0.0, Some("1"))).unwrap();
    animated.pose(0.5, &mut scene).unwrap();
    assert_eq!(scene.instances[0].world_from_object.columns[3], [-2.0, 0.0, 0.0], "the second animation");
    assert!(scene.warnings.is_empty(), "an animation was chosen: {:?}", scene.warnings);
}

#[test]
fn poses_of_real_models_are_those_of_the_file_read_at_that_time() {
    let Some(folder) = models("poses_of_real_models_are_those_of_the_file_read_at_that_time") else { return };
    for (name, animation) in [("Fox", None), ("Fox", Some("Run")), ("Fox", Some("2")), ("CesiumMan", None)] {
        poses_match(&folder.join(format!("gltf/{name}.glb")), animation, &[0.0, 0.3, 1.1]);
    }
    for name in ["SimpleSkin", "SimpleMorph"] {
        poses_match(&folder.join(format!("gltf/{name}.gltf")), None, &[0.0, 0.3, 1.1]);
    }
}

#[test]
fn unknown_animations_are_reported_with_those_of_the_file() {
    let mut file = moving(1.0, [0.0; 3]);
    let error = |animation: &str| match file.read_with(&options_at(0.0, Some(animation))) {
        Err(error @ ReadError::UnknownAnimation { .. }) => error.to_string(),
        other => panic!("{other:?}"),
    };
    for wanted in ["swim", "2", "-1", ""] {
        let want = format!("test.gltf: unknown animation '{wanted}'; the file has 0 \"slide\", 1");
        assert!(error(wanted).ends_with(&want), "{}", error(wanted));
    }
    file.json.as_object_mut().unwrap().remove("animations");
    for options in [options_at(0.0, Some("slide")), ReadOptions { time: None, ..options_at(0.0, Some("0")) }] {
        let error = file.read_with(&options).unwrap_err().to_string();
        assert!(error.ends_with("the file has no animation"), "{error}");
    }
    assert!(!AnimatedScene::open(&file.saved().1, &ReadOptions::default()).unwrap().0.is_animated());
}

/// A name that looks like a number is a name.
#[test]
fn names_win_over_numbers() {
    let mut file = moving(-4.0, [0.0; 3]);
    file.json["animations"][1]["name"] = json!("0");
    let x = |animation| {
        file.read_with(&options_at(1.0, Some(animation))).unwrap().instances[0].world_from_object.columns[3][0]
    };
    assert_eq!([x("0"), x("slide"), x("1")], [-4.0, 8.0, -4.0]);
}

#[test]
fn poses_that_are_not_finite_are_reported_with_mesh_and_vertex() {
    for bad in [f32::NAN, f32::INFINITY] {
        let file = moving(bad, [0.0, bad, 0.0]);
        let (_folder, path) = file.saved();
        let (mut animated, mut scene) = AnimatedScene::open(&path, &options_at(0.0, None)).unwrap();
        let before = everything(&scene);
        let error = animated.pose(0.5, &mut scene).unwrap_err();
        let want = format!("mesh 1 \"sail\": primitive 0 vertex 1 is not finite: 1, {bad}, 0");
        assert!(matches!(&error, ReadError::VertexNotFinite { .. }) && error.to_string().ends_with(&want), "{error}");
        assert_eq!(everything(&scene), before, "the scene stays as it is");
        // A static picture skips the triangle with a warning, as before.
        assert!(file.read_at(0.5).unwrap().warnings.join("").contains("non-finite vertex: 1"));
        // Infinity times zero is NaN, so the node is at NaN even at the first key.
        let error = AnimatedScene::open(&path, &options_at(0.5, Some("1"))).err().unwrap().to_string();
        assert!(error.contains("mesh 0 \"fixed\": vertex 0 at node 0 is not finite: "), "{error}");
    }
}

/// Vertices that are not finite in the file, at rest and in every pose, lose their triangles with a warning, as elsewhere.
#[test]
fn vertices_that_are_not_finite_at_rest_are_skipped() {
    let mut file = moving(f32::NAN, [0.0; 3]);
    // The first vertex of the first mesh becomes the last key of the second animation.
    let (indices, values) =
        (json!({ "bufferView": 1, "componentType": U8 }), json!({ "bufferView": 3, "byteOffset": 12 }));
    let sparse = json!({ "count": 1, "indices": indices, "values": values });
    let positions = json!({ "bufferView": 0, "componentType": F32, "type": "VEC3", "count": 3, "sparse": sparse });
    let positions = file.push("accessors", positions);
    file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(positions);
    let (_folder, path) = file.saved();
    let (_, scene) = AnimatedScene::open(&path, &options_at(0.5, Some("slide"))).unwrap();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 1), "the other mesh");
    assert!(scene.warnings.join("").contains("skipping triangles with a non-finite vertex: 1"), "{:?}", scene.warnings);
}
