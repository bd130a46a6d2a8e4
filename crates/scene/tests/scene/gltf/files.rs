//! Accessors and buffers (strides, offsets, component types, sparse elements, bounds), and mutated
//! files: they never panic, and accepted ones give valid scenes.

use std::sync::OnceLock;

use proptest::prelude::*;
use serde_json::{Value, json};

use canted_scene::{ReadOptions, Scene, read_with};

use super::{F32, File, I8, I16, TRIANGLE, U8, U16, U32, read_bytes};
use crate::flaw::flaw;

/// The triangle with positions in accessor 0, after `change`.
fn triangle(change: impl FnOnce(&mut File)) -> File {
    let mut file = File::of_nodes(json!([{ "mesh": 0 }]));
    change(&mut file);
    file
}

fn positions(file: &File) -> Vec<[f32; 3]> {
    file.read().unwrap_or_else(|error| panic!("{error}")).meshes[0].positions.clone()
}

#[test]
fn reads_quantized_integers() {
    let cases: [(u32, &[u8], bool, f32); 7] = [
        (I8, &[0x80], false, -128.0),
        (I8, &[0x80], true, -1.0),
        (I8, &[127], true, 1.0),
        (U8, &[255], true, 1.0),
        (I16, &[0x01, 0x80], true, -1.0),
        (I16, &[0x00, 0x40], false, 16384.0),
        (U16, &[51, 51], true, 0.2),
    ];
    for (component, bytes, normalized, want) in cases {
        let file = triangle(|file| {
            let zero = vec![0; bytes.len()];
            let one = [&zero[..zero.len() - 1], &[1]].concat();
            let packed: Vec<u8> =
                [bytes, &zero, &zero, &zero, &one, &zero, &zero, &zero, &one].into_iter().flatten().copied().collect();
            let accessor = file.accessor(component, "VEC3", 3, &packed);
            file.json["accessors"][accessor]["normalized"] = json!(normalized);
            file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(accessor);
        });
        assert_eq!(positions(&file)[0], [want, 0.0, 0.0], "{component} {bytes:?} {normalized}");
    }
    triangle(|file| file.json["accessors"][0]["componentType"] = json!(U32)).rejected("accessor 0: component type U32");
}

#[test]
fn reads_interleaved_elements_at_odd_offsets() {
    let file = triangle(|file| {
        let mut bytes = vec![0xee; 3];
        for vertex in TRIANGLE.chunks(3) {
            bytes.extend(vertex.iter().flat_map(|x| (2.0 * x).to_le_bytes()));
            bytes.extend([0xee; 8]);
        }
        // The last element may be shorter than the stride.
        bytes.truncate(bytes.len() - 8);
        let accessor = file.accessor(F32, "VEC3", 3, &bytes);
        file.json["accessors"][accessor]["byteOffset"] = json!(3);
        file.json["bufferViews"][accessor]["byteStride"] = json!(20);
        file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(accessor);
    });
    assert_eq!(positions(&file), [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
}

/// Two positions replaced by sparse values, on top of a buffer view or of zeros.
fn sparse(on_zeros: bool, indices: &[u8]) -> File {
    triangle(|file| {
        let values: Vec<u8> = [5.0_f32, 6.0, 7.0, 8.0, 9.0, 10.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let (indices, values) = (file.view(indices), file.view(&values));
        file.json["accessors"][0]["sparse"] = json!({
            "count": 2,
            "indices": { "bufferView": indices, "componentType": U8 },
            "values": { "bufferView": values },
        });
        if on_zeros {
            file.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
        }
    })
}

#[test]
fn sparse_elements_replace_values() {
    assert_eq!(positions(&sparse(false, &[0, 2])), [[5.0, 6.0, 7.0], [1.0, 0.0, 0.0], [8.0, 9.0, 10.0]]);
    assert_eq!(positions(&sparse(true, &[1, 2])), [[0.0; 3], [5.0, 6.0, 7.0], [8.0, 9.0, 10.0]]);
    let mut many = sparse(true, &[1, 2]);
    many.json["accessors"][0]["count"] = json!(3000);
    let scene = many.read().unwrap();
    assert_eq!(scene.meshes[0].positions.len(), 3000, "more elements than bytes");
    assert_eq!(scene.warnings, ["degenerate triangles (zero area): 999"]);
    sparse(false, &[2, 1]).rejected("sparse index 1 after 2");
    sparse(false, &[1, 1]).rejected("sparse index 1 after 1");
    sparse(false, &[1, 3]).rejected("sparse index 3 out of range (3 elements)");
    sparse(false, &[1]).rejected("sparse indices exceed");
}

#[test]
fn out_of_bounds_ranges_are_rejected() {
    let with = |list: &str, key: &str, value: Value| triangle(|file| file.json[list][0][key] = value);
    with("accessors", "count", json!(4)).rejected("accessor 0: 4 elements exceed");
    with("accessors", "count", json!(u64::MAX)).rejected("accessor 0");
    with("accessors", "byteOffset", json!(1)).rejected("accessor 0");
    with("accessors", "byteOffset", json!(u64::MAX)).rejected("accessor 0");
    with("accessors", "bufferView", json!(1)).rejected("buffer view index 1 out of range");
    with("accessors", "type", json!("VEC9")).rejected("accessor 0: expected type Vec3");
    with("accessors", "componentType", json!(1)).rejected("unknown component type");
    with("bufferViews", "byteLength", json!(37)).rejected("buffer view 0");
    with("bufferViews", "byteOffset", json!(u64::MAX - 8)).rejected("buffer view 0");
    with("bufferViews", "byteStride", json!(u64::MAX)).rejected("accessor 0");
    with("bufferViews", "byteStride", json!(11)).rejected("stride of 11");
    with("bufferViews", "buffer", json!(1)).rejected("buffer index 1 out of range");
    triangle(|file| file.json["accessors"][0] = json!({ "componentType": F32, "type": "VEC3", "count": 1_u64 << 40 }))
        .rejected("without a buffer view");
}

#[test]
fn empty_accessors_give_no_triangles() {
    triangle(|file| file.json["accessors"][0]["count"] = json!(0)).rejected("no triangles");
}

#[test]
fn too_short_buffers_are_rejected() {
    let full = File::of_nodes(json!([{ "mesh": 0 }]));
    for length in 0..full.buffer.len() {
        let mut file = full.clone();
        file.buffer.truncate(length);
        file.json["buffers"] = json!([{ "byteLength": full.buffer.len(), "uri": "buffer.bin" }]);
        file.rejected("buffer 0: byteLength is 36");
        file.json["buffers"] = json!([{ "byteLength": length, "uri": "buffer.bin" }]);
        file.rejected("buffer view 0");
    }
}

#[test]
fn reads_buffers_from_files() {
    let mut file = File::of_nodes(json!([{ "mesh": 0 }]));
    let (folder, _) = file.saved();
    std::fs::rename(folder.path().join("buffer.bin"), folder.path().join("my data.bin")).unwrap();
    let n_bytes = file.buffer.len();
    let mut named = |uri: &str| {
        file.json["buffers"] = json!([{ "byteLength": n_bytes, "uri": uri }]);
        read_bytes(folder.path(), "test.gltf", file.json.to_string().as_bytes())
    };
    assert_eq!(named("my%20data.bin").unwrap().n_unique_triangles(), 1);
    assert_eq!(named("my data.bin").unwrap().n_unique_triangles(), 1);
    for uri in ["absent.bin", "../my data.bin", "https://example.invalid/a.bin"] {
        let error = named(uri).unwrap_err().to_string();
        assert!(error.contains("buffer 0: "), "{error}");
    }
    file.json["buffers"] = json!([{ "byteLength": 36 }]);
    file.rejected("buffer 0: neither a uri nor a BIN chunk");
}

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
        let view = file.view(&super::materials::png());
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

#[test]
fn unchanged_file_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    let scene = read_bytes(folder.path(), "full.glb", &full_featured().glb()).unwrap();
    assert_eq!(flaw(&scene), None);
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.n_placed_triangles()), (2, 4, 10));
    assert_eq!((scene.textures.len(), scene.cameras.len(), scene.lights.len()), (2, 1, 1));
    let mesh = &scene.meshes[1];
    assert!(mesh.second_uvs.is_some() && mesh.tangents.is_some() && mesh.colors.is_some());
    let posed = outcome(&full_featured().glb()).unwrap();
    assert!(flaw(&posed).is_none() && posed.meshes[1].positions != mesh.positions);
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
        prop_assert_eq!(outcome(&glb).as_ref().and_then(flaw), None);
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
        prop_assert_eq!(outcome(&file.glb()).as_ref().and_then(flaw), None);
    }
}
