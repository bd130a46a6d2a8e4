//! Mutated files never panic, and accepted files give valid scenes.

use std::sync::OnceLock;

use proptest::prelude::*;
use serde_json::{Value, json};

use super::{File, TRIANGLE, U8, read_bytes};
use crate::{ReadOptions, Scene, read_with};

/// A small file that uses most features.
fn full_featured() -> &'static File {
    static FILE: OnceLock<File> = OnceLock::new();
    FILE.get_or_init(|| {
        let mut file = File::new();
        let (positions, uvs) = (file.reals("VEC3", &TRIANGLE), file.reals("VEC2", &TRIANGLE[..6]));
        let (strip, indices) = (file.reals("VEC3", &[TRIANGLE, TRIANGLE].concat()), file.indices(&[0, 1, 2, 4, 5]));
        let joints = file.accessor(U8, "VEC4", 3, &[0; 12]);
        let weights = file.reals("VEC4", &[1.0, 0.0, 0.0, 0.0].repeat(3));
        let (replaced, values) = (file.view(&[1]), file.view(&[0; 12]));
        file.json["accessors"][strip]["sparse"] = json!({
            "count": 1,
            "indices": { "bufferView": replaced, "componentType": U8 },
            "values": { "bufferView": values },
        });
        file.json["textures"] = json!([{ "source": 0 }]);
        let png = crate::read::image::tests::encoded(image::ImageFormat::Png);
        let view = file.view(&png);
        file.json["images"] = json!([{ "bufferView": view }]);
        let (tangents, colors) = (file.reals("VEC4", &[1.0; 12]), file.reals("VEC3", &[0.5; 9]));
        file.json["materials"] = json!([{
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } },
            "normalTexture": { "index": 0, "texCoord": 1, "extensions": { "KHR_texture_transform": { "rotation": 1 } } },
            "extensions": { "KHR_materials_transmission": { "transmissionFactor": 0.5 }, "KHR_materials_ior": { "ior": 1.25 } },
        }]);
        let (times, turns) = (file.reals("SCALAR", &[0.0, 1.0]), file.reals("VEC4", &[0.0, 0.0, 0.0, 1.0].repeat(2)));
        let cubic = file.reals("SCALAR", &[0.0, 0.5, 0.0, 1.0, 0.25, 0.0]);
        file.json["animations"] = json!([{
            "channels": [
                { "sampler": 0, "target": { "node": 2, "path": "rotation" } },
                { "sampler": 1, "target": { "node": 0, "path": "weights" } },
            ],
            "samplers": [
                { "input": times, "output": turns },
                { "input": times, "output": cubic, "interpolation": "CUBICSPLINE" },
            ],
        }]);
        file.json["skins"] = json!([{ "joints": [2] }]);
        file.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1, "znear": 1 } }]);
        file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
        let attributes = json!({
            "POSITION": positions, "TEXCOORD_0": uvs, "TEXCOORD_1": uvs, "TANGENT": tangents, "COLOR_0": colors,
            "JOINTS_0": joints, "WEIGHTS_0": weights,
        });
        file.mesh(json!([{ "attributes": attributes, "material": 0, "targets": [{ "POSITION": positions }] }]));
        file.mesh(json!([{ "attributes": { "POSITION": strip }, "indices": indices, "mode": 5 }]));
        file.json["meshes"][0]["weights"] = json!([0.5]);
        file.json["nodes"] = json!([
            { "mesh": 0, "skin": 0, "children": [1, 2] },
            { "mesh": 1, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": positions } } } },
            { "camera": 0, "scale": [1, 2, 3], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        ]);
        file.json["scenes"] = json!([{ "nodes": [0] }]);
        file
    })
}

/// Whether indices are in range, positions finite, and attribute lists of equal length.
pub(super) fn is_valid(scene: &Scene) -> bool {
    let meshes_are_valid = scene.meshes.iter().all(|mesh| {
        let n_vertices = mesh.positions.len();
        let corner_is_valid =
            |&corner: &u32| mesh.positions.get(corner as usize).is_some_and(|p| p.iter().all(|x| x.is_finite()));
        mesh.triangles.as_flattened().iter().all(corner_is_valid)
            && [&mesh.uvs, &mesh.second_uvs].into_iter().flatten().all(|uvs| uvs.len() == n_vertices)
            && mesh.tangents.as_ref().is_none_or(|tangents| tangents.len() == n_vertices)
            && mesh.colors.as_ref().is_none_or(|colors| colors.len() == n_vertices)
            && mesh.normals.as_ref().is_none_or(|normals| normals.len() == n_vertices)
            && mesh.parts.first().is_some_and(|part| part.first_triangle == 0)
            && mesh.parts.iter().all(|part| (part.material.0 as usize) < scene.materials.len())
    });
    let instance_is_valid = |instance: &crate::Instance| {
        let placed = &instance.world_from_object;
        (instance.mesh.0 as usize) < scene.meshes.len() && placed.is_finite() && placed.determinant() != 0.0
    };
    meshes_are_valid && !scene.instances.is_empty() && scene.instances.iter().all(instance_is_valid)
}

#[test]
fn unchanged_file_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    let scene = read_bytes(folder.path(), "full.glb", &full_featured().glb()).unwrap();
    assert!(is_valid(&scene));
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.n_placed_triangles()), (2, 4, 10));
    assert_eq!((scene.textures.len(), scene.cameras.len(), scene.lights.len()), (2, 1, 1));
    let mesh = &scene.meshes[1];
    assert!(mesh.second_uvs.is_some() && mesh.tangents.is_some() && mesh.colors.is_some());
    let posed = outcome(&full_featured().glb()).unwrap();
    assert!(is_valid(&posed) && posed.meshes[1].positions != mesh.positions);
}

#[test]
fn is_valid_detects_invalid_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = read_bytes(folder.path(), "full.glb", &full_featured().glb()).unwrap();
    let breaks: [fn(&mut Scene); 5] = [
        |scene| scene.meshes[0].triangles[0][2] = 99,
        |scene| scene.meshes[0].positions[1][0] = f32::NAN,
        |scene| scene.meshes[0].parts.clear(),
        |scene| scene.instances[0].mesh.0 = 7,
        |scene| scene.instances[0].world_from_object.columns[0] = [0.0; 3],
    ];
    for invalidate in breaks {
        let mut scene = scene.clone();
        invalidate(&mut scene);
        assert!(!is_valid(&scene));
    }
}

/// JSON pointers to all numbers below a value.
fn numbers(value: &Value, at: String) -> Vec<String> {
    match value {
        Value::Number(_) => vec![at],
        Value::Array(items) => {
            items.iter().enumerate().flat_map(|(k, item)| numbers(item, format!("{at}/{k}"))).collect()
        }
        Value::Object(items) => items.iter().flat_map(|(key, item)| numbers(item, format!("{at}/{key}"))).collect(),
        _ => Vec::new(),
    }
}

/// Numbers that are invalid in most contexts.
fn unusual_number() -> impl Strategy<Value = Value> {
    prop_oneof![
        (0..12_u32).prop_map(|x| json!(x)),
        prop::sample::select(vec![
            json!(-1),
            json!(255),
            json!(u32::MAX),
            json!(1_u64 << 32),
            json!(u64::MAX),
            json!(1e39),
            json!(-1e-45),
            json!(5126),
            json!("0"),
            Value::Null,
        ]),
    ]
}

/// Bytes to overwrite others with.
fn patch() -> impl Strategy<Value = (prop::sample::Index, Vec<u8>)> {
    let bytes = prop_oneof![
        prop::collection::vec(any::<u8>(), 1..5),
        Just(vec![0xff; 4]),
        Just(f32::NAN.to_le_bytes().to_vec()),
        Just(f32::INFINITY.to_le_bytes().to_vec()),
        Just(1e38_f32.to_le_bytes().to_vec()),
    ];
    (any::<prop::sample::Index>(), bytes)
}

/// Overwrites bytes, truncating patches at the end.
fn overwrite(bytes: &mut [u8], patches: Vec<(prop::sample::Index, Vec<u8>)>) {
    for (at, patch) in patches {
        let start = at.index(bytes.len());
        for (byte, new) in bytes[start..].iter_mut().zip(patch) {
            *byte = new;
        }
    }
}

/// Reads a GLB at a time between its keyframes; `None` for an error.
fn outcome(glb: &[u8]) -> Option<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mutated.glb");
    std::fs::write(&path, glb).unwrap();
    read_with(&path, &ReadOptions { time: Some(0.5), ..ReadOptions::default() }).ok()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Arbitrary bytes of the container and the JSON.
    #[test]
    fn changed_bytes_never_panic(patches in prop::collection::vec(patch(), 1..3), length: prop::sample::Index, cut: bool) {
        let mut glb = full_featured().glb();
        overwrite(&mut glb, patches);
        if cut {
            glb.truncate(length.index(glb.len()));
        }
        prop_assert!(outcome(&glb).is_none_or(|scene| is_valid(&scene)));
    }

    /// Numbers of valid JSON, and bytes of the buffer.
    #[test]
    fn changed_numbers_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), unusual_number()), 0..4),
        patches in prop::collection::vec(patch(), 0..4),
    ) {
        let mut file = full_featured().clone();
        let pointers = numbers(&file.json, String::new());
        for (at, value) in changes {
            *file.json.pointer_mut(&pointers[at.index(pointers.len())]).unwrap() = value;
        }
        overwrite(&mut file.buffer, patches);
        prop_assert!(outcome(&file.glb()).is_none_or(|scene| is_valid(&scene)));
    }
}
