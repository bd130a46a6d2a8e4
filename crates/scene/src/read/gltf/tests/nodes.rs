//! Node hierarchies: transform chains against pointwise evaluation, cycles and other invalid graphs.

use std::time::{Duration, Instant};

use proptest::prelude::*;
use serde_json::{Value, json};

use super::{File, read_bytes};
use crate::Scene;

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
