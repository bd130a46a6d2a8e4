//! The hierarchy: chains of transforms against one point carried through them node by node, and trees that are none.

use std::time::{Duration, Instant};

use proptest::prelude::*;
use serde_json::{Value, json};

use super::{File, read_bytes};

/// Half the spacing of `f32` numbers at one.
const U: f64 = f32::EPSILON as f64 / 2.0;

/// A node's own transform, as a file says it.
#[derive(Clone, Debug)]
struct Parts {
    translation: [f32; 3],
    rotation: [f32; 4],
    scale: [f32; 3],
}

/// A point carried through one node: scaled, turned by the sandwich `q p q*` of quaternions, moved. Beside it the same
/// with every term made positive, which bounds what rounding can do.
fn carry(parts: &Parts, point: [f64; 3], reach: [f64; 3]) -> ([f64; 3], [f64; 3]) {
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
    let turned = product(product([x, y, z, w], [scaled[0], scaled[1], scaled[2], 0.0]), [-x, -y, -z, w]);
    let sum_of_scaled: f64 = (0..3).map(|k| f64::from(parts.scale[k]).abs() * reach[k]).sum();
    (
        std::array::from_fn(|k| turned[k] + f64::from(parts.translation[k])),
        // No coordinate of a turned vector is larger than the sum of those before.
        std::array::from_fn(|k| sum_of_scaled + f64::from(parts.translation[k]).abs()),
    )
}

/// A chain with the triangle at its end, as nodes in an order that is not the chain's.
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

/// Largest error of the images of four points under a chain, in units of its bound.
///
/// The affine map has entries rounded once, by U, and a point meets four of them; each of the three or so operations on
/// a term in each of the nodes adds at most 16 roundings in double precision.
fn worst_error(parts: &[Parts], world_from_object: &canted_obb::Affine) -> f64 {
    let bound = U + 16.0 * 4.0 * parts.len() as f64 * f64::EPSILON;
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let error = |corner: [f64; 3]| {
        let found = world_from_object.point_f64(corner);
        // From the mesh outward, the last node of the chain acts first.
        let start = (corner, corner.map(f64::abs));
        let (want, reach) = parts.iter().rev().fold(start, |(point, reach), parts| carry(parts, point, reach));
        // A corner meets one column and the origin, each no larger than the reach and rounded once.
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
    /// Mirrors, uneven scales and turns below them, which shear.
    #[test]
    fn chains_carry_points(parts in prop::collection::vec(parts(), 1..6)) {
        let scene = chain(&parts).read().unwrap();
        prop_assert_eq!(scene.instances.len(), 1);
        let worst = worst_error(&parts, &scene.instances[0].world_from_object);
        prop_assert!(worst <= 1.0, "{} bounds", worst);
    }
}

#[test]
fn the_check_sees_a_chain_in_the_wrong_order() {
    let turned = Parts { translation: [0.0; 3], rotation: [0.0, 0.0, 0.6, 0.8], scale: [1.0; 3] };
    let stretched = Parts { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0], scale: [2.0, 1.0, -1.0] };
    let scene = chain(&[turned.clone(), stretched.clone()]).scene();
    let placed = scene.instances[0].world_from_object;
    assert!(worst_error(&[turned.clone(), stretched.clone()], &placed) <= 1.0);
    assert!(worst_error(&[stretched, turned], &placed) > 1e5);
}

#[test]
fn a_chain_is_rounded_once() {
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
fn mirrors_and_shears_as_matrices() {
    let sheared = json!([1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, -2, 0, 7, 8, 9, 1]);
    let scene = File::of_nodes(json!([{ "mesh": 0, "matrix": sheared }])).scene();
    let placed = scene.instances[0].world_from_object;
    assert_eq!(placed.columns, [[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, -2.0], [7.0, 8.0, 9.0]]);
    assert!(placed.determinant() < 0.0, "the front faces flip");
    let projective = json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    File::of_nodes(json!([{ "mesh": 0, "matrix": projective }])).refused("node 0: has a matrix whose last row");
}

#[test]
fn chains_of_any_depth() {
    let n = 100_000;
    let mut nodes: Vec<Value> = (1..n).map(|child| json!({ "children": [child], "translation": [1, 0, 0] })).collect();
    nodes.push(json!({ "mesh": 0 }));
    let scene = File::of_nodes(json!(nodes)).scene();
    assert_eq!(scene.instances[0].world_from_object.columns[3], [(n - 1) as f32, 0.0, 0.0]);
}

#[test]
fn graphs_that_are_no_trees() {
    let child = |children: Value| json!({ "mesh": 0, "children": children });
    File::of_nodes(json!([child(json!([0]))])).refused("node 0: is its own ancestor");
    File::of_nodes(json!([child(json!([])), child(json!([2])), child(json!([3])), child(json!([1]))]))
        .refused("is its own ancestor");
    File::of_nodes(json!([child(json!([2])), child(json!([2])), child(json!([]))]))
        .refused("node 2: is a child of 0 and 1");
    File::of_nodes(json!([child(json!([1, 1])), child(json!([]))])).refused("node 1: is a child of 0 and 0");
    File::of_nodes(json!([child(json!([1]))])).refused("node 0: names node 1 of 1");
}

#[test]
fn the_cycle_is_named_not_what_hangs_below_it() {
    let below = json!({ "mesh": 0 });
    let nodes = json!([below, { "children": [2] }, { "children": [1, 0] }]);
    let error = File::of_nodes(nodes).read().unwrap_err().to_string();
    assert!(error.contains("node 1: ") || error.contains("node 2: "), "{error}");
}

/// Where every node is walked up from, half a million times half a million steps take minutes.
#[test]
fn a_cycle_beside_a_long_chain_is_found_in_one_walk() {
    let n = 500_000;
    let chain: String = (1..n).map(|child| format!("{{\"children\":[{child}]}},")).collect();
    let cycle = format!("{{}},{{\"children\":[{}]}},{{\"children\":[{n}]}}", n + 1);
    let text = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{chain}{cycle}]}}");
    let folder = tempfile::tempdir().unwrap();
    let start = Instant::now();
    let error = read_bytes(folder.path(), "test.gltf", text.as_bytes()).unwrap_err().to_string();
    assert!(error.contains(&format!("node {n}: is its own ancestor")), "{error}");
    assert!(start.elapsed() < Duration::from_secs(30), "{:?}", start.elapsed());
}

#[test]
fn only_the_default_scene_is_drawn() {
    let mut file = File::of_nodes(json!([
        { "mesh": 0, "translation": [1, 0, 0] },
        { "children": [2], "mesh": 0, "translation": [2, 0, 0] },
        { "mesh": 0, "translation": [3, 0, 0] },
    ]));
    let drawn = |file: &File| -> Vec<f32> {
        file.scene().instances.iter().map(|instance| instance.world_from_object.columns[3][0]).collect()
    };
    assert_eq!(drawn(&file), [1.0, 2.0, 5.0], "without scenes every node");
    file.json["scenes"] = json!([{ "nodes": [1, 1] }, { "nodes": [0] }, {}]);
    assert_eq!(drawn(&file), [2.0, 5.0], "the first scene, each root once");
    file.json["scene"] = json!(1);
    assert_eq!(drawn(&file), [1.0]);
    file.json["scene"] = json!(3);
    file.refused("names scene 3 of 3");
    file.json["scenes"] = json!([{}, { "nodes": [2] }]);
    file.json["scene"] = json!(0);
    file.refused("nothing to draw");
    file.json["scene"] = json!(1);
    file.refused("scene 1: names node 2, which is a child of node 1");
}
