//! Node hierarchies (transform chains against pointwise evaluation, cycles and other invalid graphs), instances, cameras and lights.

use std::time::{Duration, Instant};

use canted_scene::{Camera, Light, MeshId, Projection, Scene};
use proptest::prelude::*;
use serde_json::{Value, json};

use super::{F32, File, I8, read_bytes};

/// Unit roundoff of `f32`.
const U: f64 = f32::EPSILON as f64 / 2.0;

/// A local transform.
#[derive(Clone, Debug)]
struct Parts {
    translation: [f32; 3],
    rotation: [f32; 4],
    scale: [f32; 3],
}

/// A point transformed by one node, with rotation `q p q*`, and a bound of its terms for the error analysis.
fn transform(parts: &Parts, point: [f64; 3], reach: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let q = parts.rotation.map(f64::from);
    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [x, y, z, w] = q.map(|component| component / norm);
    let scaled: [f64; 3] = std::array::from_fn(|k| f64::from(parts.scale[k]) * point[k]);
    let product = |a: [f64; 4], b: [f64; 4]| {
        [
            a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
            a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
            a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
            a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
        ]
    };
    let rotated = product(product([x, y, z, w], [scaled[0], scaled[1], scaled[2], 0.0]), [-x, -y, -z, w]);
    let sum_of_scaled: f64 = (0..3).map(|k| f64::from(parts.scale[k]).abs() * reach[k]).sum();
    (
        std::array::from_fn(|k| rotated[k] + f64::from(parts.translation[k])),
        // A coordinate of a rotated vector is at most the sum of the original ones.
        std::array::from_fn(|k| sum_of_scaled + f64::from(parts.translation[k]).abs()),
    )
}

/// A chain with the triangle at its end; nodes are in reverse order.
fn chain(parts: &[Parts]) -> File {
    let last = parts.len() - 1;
    let nodes: Vec<Value> = parts
        .iter()
        .rev()
        .enumerate()
        .map(|(k, parts)| {
            let mut node =
                json!({ "translation": parts.translation, "rotation": parts.rotation, "scale": parts.scale });
            if k > 0 {
                node["children"] = json!([k - 1]);
            } else {
                node["mesh"] = json!(0);
            }
            node
        })
        .collect();
    let mut file = File::of_nodes(json!(nodes));
    file.json["scenes"] = json!([{ "nodes": [last] }]);
    file
}

/// Largest error of four transformed points, relative to its bound.
///
/// Each entry of the affine transform is rounded once by U; a point uses four of them. Each node adds at most 16 roundings per
/// term in double precision.
fn worst_error(parts: &[Parts], world_from_object: &canted_obb::Affine) -> f64 {
    let bound = U + 16.0 * 4.0 * parts.len() as f64 * f64::EPSILON;
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let error = |corner: [f64; 3]| {
        let found = world_from_object.point_f64(corner);
        // The last node of the chain is applied first.
        let start = (corner, corner.map(f64::abs));
        let (want, reach) = parts.iter().rev().fold(start, |(point, reach), parts| transform(parts, point, reach));
        // A corner uses one column and the origin, each at most the reach and rounded once.
        (0..3).map(|k| (found[k] - want[k]).abs() / (2.0 * bound * reach[k].max(f64::MIN_POSITIVE))).fold(0.0, f64::max)
    };
    corners.into_iter().map(error).fold(0.0, f64::max)
}

fn parts() -> impl Strategy<Value = Parts> {
    let coordinate = prop_oneof![-10.0_f32..10.0, Just(0.0), Just(1e7), Just(-1e-6)];
    let turn = prop_oneof![
        prop::array::uniform4(-1.0_f32..1.0).prop_filter("a rotation", |q| q.iter().map(|x| x * x).sum::<f32>() > 0.1),
        Just([0.0, 0.0, 0.0, 1.0]),
        Just([1.0, 0.0, 0.0, 0.0]),
        Just([0.0, 0.0, 1000.0, 1000.0]),
    ];
    let factor = prop_oneof![0.25_f32..4.0, -4.0_f32..-0.25, Just(1.0), Just(-1.0)];
    (prop::array::uniform3(coordinate), turn, prop::array::uniform3(factor))
        .prop_map(|(translation, rotation, scale)| Parts { translation, rotation, scale })
}

proptest! {
    /// Includes mirroring and shearing.
    #[test]
    fn chains_transform_points(parts in prop::collection::vec(parts(), 1..6)) {
        let scene = chain(&parts).read().unwrap();
        prop_assert_eq!(scene.instances.len(), 1);
        let worst = worst_error(&parts, &scene.instances[0].world_from_object);
        prop_assert!(worst <= 1.0, "{} bounds", worst);
    }
}

#[test]
fn worst_error_detects_wrong_order() {
    let rotated = Parts { translation: [0.0; 3], rotation: [0.0, 0.0, 0.6, 0.8], scale: [1.0; 3] };
    let stretched = Parts { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0], scale: [2.0, 1.0, -1.0] };
    let scene = chain(&[rotated.clone(), stretched.clone()]).scene();
    let placed = scene.instances[0].world_from_object;
    assert!(worst_error(&[rotated.clone(), stretched.clone()], &placed) <= 1.0);
    assert!(worst_error(&[stretched, rotated], &placed) > 1e5);
}

#[test]
fn chains_are_rounded_once() {
    // In single precision 2^24 + 1 is 2^24, and the sum would be 0.
    let shift = 16_777_216;
    let scene = File::of_nodes(json!([
        { "children": [1], "translation": [shift, 0, 0] },
        { "children": [2], "translation": [1, 0, 0] },
        { "mesh": 0, "translation": [-shift, 0, 0] },
    ]))
    .scene();
    assert_eq!(scene.instances[0].world_from_object.columns[3], [1.0, 0.0, 0.0]);
}

#[test]
fn reads_mirroring_and_shearing_matrices() {
    let sheared = json!([1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, -2, 0, 7, 8, 9, 1]);
    let scene = File::of_nodes(json!([{ "mesh": 0, "matrix": sheared }])).scene();
    let placed = scene.instances[0].world_from_object;
    assert_eq!(placed.columns, [[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, -2.0], [7.0, 8.0, 9.0]]);
    assert!(placed.determinant() < 0.0, "mirrored");
    let rounded = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0.99999994]);
    assert_eq!(
        File::of_nodes(json!([{ "mesh": 0, "matrix": rounded }])).scene().instances[0].world_from_object,
        canted_obb::Affine::IDENTITY
    );
    let projective = json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    File::of_nodes(json!([{ "mesh": 0, "matrix": projective }])).rejected("node 0: the last row of its matrix");
}

#[test]
fn supports_deep_chains() {
    let n = 100_000;
    let mut nodes: Vec<Value> = (1..n).map(|child| json!({ "children": [child], "translation": [1, 0, 0] })).collect();
    nodes.push(json!({ "mesh": 0 }));
    let scene = File::of_nodes(json!(nodes)).scene();
    assert_eq!(scene.instances[0].world_from_object.columns[3], [(n - 1) as f32, 0.0, 0.0]);
}

#[test]
fn invalid_graphs_are_rejected() {
    let child = |children: Value| json!({ "mesh": 0, "children": children });
    File::of_nodes(json!([child(json!([0]))])).rejected("node 0: node is its own ancestor");
    File::of_nodes(json!([child(json!([])), child(json!([2])), child(json!([3])), child(json!([1]))]))
        .rejected("is its own ancestor");
    File::of_nodes(json!([child(json!([2])), child(json!([2])), child(json!([]))]))
        .rejected("node 2: child of two nodes, 0 and 1");
    File::of_nodes(json!([child(json!([1, 1])), child(json!([]))])).rejected("node 1: child of two nodes, 0 and 0");
    File::of_nodes(json!([child(json!([1]))])).rejected("node 0: node index 1 out of range");
}

#[test]
fn cycle_errors_name_a_node_of_the_cycle() {
    let below = json!({ "mesh": 0 });
    let nodes = json!([below, { "children": [2] }, { "children": [1, 0] }]);
    let error = File::of_nodes(nodes).read().unwrap_err().to_string();
    assert!(error.contains("node 1: ") || error.contains("node 2: "), "{error}");
}

/// Quadratic search would take minutes.
#[test]
fn cycle_detection_is_linear() {
    let n = 500_000;
    let chain: String = (1..n).map(|child| format!("{{\"children\":[{child}]}},")).collect();
    let cycle = format!("{{}},{{\"children\":[{}]}},{{\"children\":[{n}]}}", n + 1);
    let text = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{chain}{cycle}]}}");
    let folder = tempfile::tempdir().unwrap();
    let start = Instant::now();
    let error = read_bytes(folder.path(), "test.gltf", text.as_bytes()).unwrap_err().to_string();
    assert!(error.contains(&format!("node {n}: node is its own ancestor")), "{error}");
    assert!(start.elapsed() < Duration::from_secs(30), "{:?}", start.elapsed());
}

#[test]
fn only_the_default_scene_is_read() {
    let mut file = File::of_nodes(json!([
        { "mesh": 0, "translation": [1, 0, 0] },
        { "children": [2], "mesh": 0, "translation": [2, 0, 0] },
        { "mesh": 0, "translation": [3, 0, 0] },
    ]));
    let drawn = |file: &File| -> Vec<f32> {
        file.scene().instances.iter().map(|instance| instance.world_from_object.columns[3][0]).collect()
    };
    assert_eq!(drawn(&file), [1.0, 2.0, 5.0], "all nodes without scenes");
    file.json["scenes"] = json!([{ "nodes": [1, 1] }, { "nodes": [0] }, {}]);
    assert_eq!(drawn(&file), [2.0, 5.0], "the first scene, each root once");
    file.json["scene"] = json!(1);
    assert_eq!(drawn(&file), [1.0]);
    file.json["scene"] = json!(3);
    file.rejected("scene index 3 out of range");
    file.json["scenes"] = json!([{}, { "nodes": [2] }]);
    file.json["scene"] = json!(0);
    file.rejected("nothing to draw");
    file.json["scene"] = json!(1);
    let placed =
        |scene: &Scene| scene.instances.iter().map(|i| i.world_from_object.columns[3][0]).collect::<Vec<f32>>();
    assert_eq!(placed(&file.warned("placing a root of scene 1 as a child of its parent: node 2 of 1")), [5.0]);
    file.json["scenes"] = json!([{}, { "nodes": [2, 1] }]);
    assert_eq!(placed(&file.warned("a child of its parent")), [2.0, 5.0], "once");
}

/// Adds a node that instances the triangle by these attributes.
fn add_instancing(file: &mut File, attributes: Value) {
    file.push(
        "nodes",
        json!({
            "mesh": 0,
            "scale": [2, 2, 2],
            "extensions": { "EXT_mesh_gpu_instancing": { "attributes": attributes } },
        }),
    );
    file.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
}

#[test]
fn many_nodes_share_a_mesh() {
    let mut file = File::of_nodes(json!([{ "mesh": 1 }, { "mesh": 0 }, { "mesh": 1 }]));
    let positions = file.reals("VEC3", &super::TRIANGLE);
    file.mesh(json!([{ "attributes": { "POSITION": positions } }]));
    let scene = file.scene();
    assert_eq!(scene.meshes.len(), 2);
    let found: Vec<_> = scene.instances.iter().map(|instance| (instance.mesh, instance.first_primitive)).collect();
    assert_eq!(found, [(MeshId(1), 1), (MeshId(0), 0), (MeshId(1), 1)], "instances in node order, numbers by mesh");
}

#[test]
fn one_node_instances_a_mesh() {
    let mut file = File::of_nodes(json!([]));
    let translations = file.reals("VEC3", &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    // 180 degrees about z and the identity, as normalized bytes.
    let rotations = file.accessor(I8, "VEC4", 2, &[0, 0, 127, 0, 0, 0, 0, 127]);
    file.json["accessors"][rotations]["normalized"] = json!(true);
    let scales = file.reals("VEC3", &[1.0, 1.0, 1.0, 1.0, -3.0, 1.0]);
    add_instancing(
        &mut file,
        json!({ "TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales, "_ID": 99 }),
    );
    let scene = file.scene();
    let columns: Vec<_> = scene.instances.iter().map(|instance| instance.world_from_object.columns).collect();
    assert_eq!(
        columns,
        [
            [[-2.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, 2.0], [2.0, 0.0, 0.0]],
            [[2.0, 0.0, 0.0], [0.0, -6.0, 0.0], [0.0, 0.0, 2.0], [0.0, 2.0, 0.0]],
        ]
    );
    assert!(scene.instances.iter().all(|instance| instance.mesh == MeshId(0) && instance.first_primitive == 0));
}

#[test]
fn invalid_instancing_is_rejected() {
    let mut file = File::of_nodes(json!([]));
    let two = file.reals("VEC3", &[1.0, 0.0, 0.0, 0.0, f32::NAN, 0.0]);
    let three = file.reals("VEC3", &[1.0; 9]);
    let with = |attributes: Value| {
        let mut file = file.clone();
        add_instancing(&mut file, attributes);
        file
    };
    assert_eq!(with(json!({ "TRANSLATION": two })).warned("1 of 2 instances").instances.len(), 1);
    with(json!({ "TRANSLATION": two, "SCALE": three })).rejected("different counts, 2 and 3");
    with(json!({ "ROTATION": two })).rejected("ROTATION");
    with(json!({ "SCALE": 77 })).rejected("accessor index 77");
    with(json!({ "SCALE": "1" })).rejected("expected an accessor index");
    with(json!({})).rejected("missing TRANSLATION, ROTATION or SCALE");
}

/// Small files with shared accessors without data must not exhaust memory.
#[test]
fn excessive_repetition_is_rejected() {
    let zeros = |file: &mut File, count: u32| {
        file.push("accessors", json!({ "componentType": F32, "type": "VEC3", "count": count }));
        file.json["accessors"].as_array().unwrap().len() - 1
    };
    let mut file = File::of_nodes(json!([]));
    let translations = zeros(&mut file, 400_000);
    for _ in 0..2 {
        add_instancing(&mut file, json!({ "TRANSLATION": translations }));
    }
    assert_eq!(file.scene().instances.len(), 800_000);
    add_instancing(&mut file, json!({ "TRANSLATION": translations }));
    file.rejected("node 2: too many instances: 400000, in total 1199997");

    let mut file = File::of_nodes(json!([{ "mesh": 0 }]));
    let positions = zeros(&mut file, 300_000);
    let vertices = json!({ "attributes": { "POSITION": positions } });
    file.mesh(json!([vertices, vertices]));
    assert_eq!(file.scene().instances.len(), 1);
    file.mesh(json!([vertices, { "attributes": { "POSITION": 0 }, "indices": positions }]));
    file.rejected("meshes: 1200000 vertices and indices without a buffer view");
}

#[test]
fn singular_transforms_are_skipped() {
    let placed = json!({ "mesh": 0 });
    for flat in [
        json!({ "mesh": 0, "scale": [1, 0, 1] }),
        json!({ "mesh": 0, "scale": [0, 0, 0] }),
        json!({ "mesh": 0, "rotation": [0, 0, 0, 0] }),
        json!({ "mesh": 0, "scale": [1e30, 1e30, 1e30], "translation": [1e39, 0, 0] }),
        json!({ "mesh": 0, "matrix": [1, 0, 0, 0, 0.1, 0.2, 0.3, 0, 0.7, 0.2, 0.3, 0, 0, 0, 0, 1] }),
        json!({ "mesh": 0, "rotation": [0.3, 0.1, 0.5, 0.8], "scale": [1, 1e-40, 1] }),
    ] {
        let scene = File::of_nodes(json!([placed, flat])).warned("skipping 1 of 1 instances of node 1 ''");
        assert_eq!(scene.instances.len(), 1, "{flat}");
        File::of_nodes(json!([flat])).rejected("no node has a mesh");
    }
}

#[test]
fn extreme_invertible_transforms_are_kept() {
    for scale in [[1e-6, 1e6, 1.0], [1e-12, 1.0, 1.0], [1e12, 1e12, 1e12], [1e-20, -1e-20, 1e-20]] {
        let scene = File::of_nodes(json!([{ "mesh": 0, "scale": scale, "translation": [1e7, 0, 0] }])).read().unwrap();
        assert_eq!(scene.instances.len(), 1, "{scale:?}");
    }
}

/// The triangle and a second node.
fn second_node(node: Value) -> File {
    File::of_nodes(json!([{ "mesh": 0 }, node]))
}

fn with_camera(node: Value, camera: Value) -> File {
    let mut node = node;
    node["camera"] = json!(0);
    let mut file = second_node(node);
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
    second_node(json!({ "camera": 0 })).rejected("node 1: camera index 0 out of range");
}

fn with_light(node: Value, light: Value) -> File {
    let mut node = node;
    node["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
    let mut file = second_node(node);
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
    second_node(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }))
        .rejected("node 1: light index 0 out of range");
}
