//! Instances: shared meshes, repeated ones, and transforms without an inverse.

use serde_json::{Value, json};

use super::{F32, File, I8};
use crate::MeshId;

/// A node that repeats the triangle by these attributes.
fn repeated(file: &mut File, attributes: Value) {
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
    assert_eq!(found, [(MeshId(1), 1), (MeshId(0), 0), (MeshId(1), 1)], "nodes in file order, numbers by mesh");
}

#[test]
fn one_node_repeats_a_mesh() {
    let mut file = File::of_nodes(json!([]));
    let translations = file.reals("VEC3", &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    // A half turn about z, normalised bytes, and no turn.
    let rotations = file.accessor(I8, "VEC4", 2, &[0, 0, 127, 0, 0, 0, 0, 127]);
    file.json["accessors"][rotations]["normalized"] = json!(true);
    let scales = file.reals("VEC3", &[1.0, 1.0, 1.0, 1.0, -3.0, 1.0]);
    repeated(&mut file, json!({ "TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales, "_ID": 99 }));
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
fn instances_that_break_the_rules() {
    let mut file = File::of_nodes(json!([]));
    let two = file.reals("VEC3", &[1.0, 0.0, 0.0, 0.0, f32::NAN, 0.0]);
    let three = file.reals("VEC3", &[1.0; 9]);
    let with = |attributes: Value| {
        let mut file = file.clone();
        repeated(&mut file, attributes);
        file
    };
    assert_eq!(with(json!({ "TRANSLATION": two })).warned("1 of 2 instances").instances.len(), 1);
    with(json!({ "TRANSLATION": two, "SCALE": three })).refused("attributes of 2 and of 3 instances");
    with(json!({ "ROTATION": two })).refused("ROTATION");
    with(json!({ "SCALE": 77 })).refused("names accessor 77");
    with(json!({ "SCALE": "1" })).refused("not the index of an accessor");
    with(json!({})).refused("has no TRANSLATION, ROTATION or SCALE");
}

/// A few kilobytes that name the same nothing again and again would fill any memory.
#[test]
fn nothing_repeated_without_end_is_refused() {
    let zeros = |file: &mut File, count: u32| {
        file.push("accessors", json!({ "componentType": F32, "type": "VEC3", "count": count }));
        file.json["accessors"].as_array().unwrap().len() - 1
    };
    let mut file = File::of_nodes(json!([]));
    let translations = zeros(&mut file, 400_000);
    for _ in 0..2 {
        repeated(&mut file, json!({ "TRANSLATION": translations }));
    }
    assert_eq!(file.scene().instances.len(), 800_000);
    repeated(&mut file, json!({ "TRANSLATION": translations }));
    file.refused("node 2: 400000 instances, 1199997 with those before");

    let mut file = File::of_nodes(json!([{ "mesh": 0 }]));
    let positions = zeros(&mut file, 300_000);
    let vertices = json!({ "attributes": { "POSITION": positions } });
    file.mesh(json!([vertices, vertices]));
    assert_eq!(file.scene().instances.len(), 1);
    file.mesh(json!([vertices, { "attributes": { "POSITION": 0 }, "indices": positions }]));
    file.refused("meshes: 1200000 vertices and indices have no buffer view");
}

#[test]
fn transforms_without_an_inverse_place_nothing() {
    let placed = json!({ "mesh": 0 });
    for flat in [
        json!({ "mesh": 0, "scale": [1, 0, 1] }),
        json!({ "mesh": 0, "scale": [0, 0, 0] }),
        json!({ "mesh": 0, "rotation": [0, 0, 0, 0] }),
        json!({ "mesh": 0, "scale": [1e30, 1e30, 1e30], "translation": [1e39, 0, 0] }),
        json!({ "mesh": 0, "matrix": [1, 0, 0, 0, 0.1, 0.2, 0.3, 0, 0.7, 0.2, 0.3, 0, 0, 0, 0, 1] }),
        json!({ "mesh": 0, "rotation": [0.3, 0.1, 0.5, 0.8], "scale": [1, 1e-40, 1] }),
    ] {
        let scene = File::of_nodes(json!([placed, flat])).warned("node 1 \"\": 1 of 1 instances");
        assert_eq!(scene.instances.len(), 1, "{flat}");
        File::of_nodes(json!([flat])).refused("no node places a mesh");
    }
}

#[test]
fn transforms_with_an_inverse_however_uneven_stay() {
    for scale in [[1e-6, 1e6, 1.0], [1e-12, 1.0, 1.0], [1e12, 1e12, 1e12], [1e-20, -1e-20, 1e-20]] {
        let scene = File::of_nodes(json!([{ "mesh": 0, "scale": scale, "translation": [1e7, 0, 0] }])).read().unwrap();
        assert_eq!(scene.instances.len(), 1, "{scale:?}");
    }
}
