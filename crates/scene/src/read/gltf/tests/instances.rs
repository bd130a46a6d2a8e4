//! Instances: shared meshes, GPU instancing, singular transforms.

use serde_json::{Value, json};

use super::{F32, File, I8};
use crate::MeshId;

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
