//! Buffer views compressed by meshoptimizer.

use serde_json::{Value, json};

use super::File;

const NAME: &str = "EXT_meshopt_compression";

#[test]
#[cfg(not(feature = "meshopt"))]
fn without_the_feature_the_file_is_refused() {
    let mut file = File::of_nodes(json!([{ "mesh": 0 }]));
    file.json["extensionsRequired"] = json!([NAME]);
    file.rejected("EXT_meshopt_compression (built without the feature 'meshopt') is not supported");
    // One that is not required has its content uncompressed, too.
    file.json["extensionsRequired"] = Value::Null;
    file.json["extensionsUsed"] = json!([NAME]);
    file.json.as_object_mut().unwrap().remove("extensionsRequired");
    file.scene();
}

#[cfg(feature = "meshopt")]
mod decoded {
    use super::*;
    use crate::Scene;
    use crate::read::gltf::tests::{F32, I8, TRIANGLE, U16, read_bytes};
    use proptest::prelude::*;

    /// A compressed view of `count` elements in buffer 0; its uncompressed content would be in buffer 1.
    fn compressed(file: &mut File, bytes: &[u8], count: usize, stride: usize, mode: &str, filter: &str) -> usize {
        let view = file.view(bytes);
        let [offset, length] = ["byteOffset", "byteLength"].map(|key| file.json["bufferViews"][view][key].clone());
        file.json["bufferViews"][view] = json!({
            "buffer": 1, "byteLength": count * stride,
            "extensions": { NAME: {
                "buffer": 0, "byteOffset": offset, "byteLength": length, "byteStride": stride, "count": count,
                "mode": mode, "filter": filter,
            } },
        });
        view
    }

    fn accessor(file: &mut File, view: usize, component: u32, element: &str, count: usize) -> usize {
        file.push(
            "accessors",
            json!({ "bufferView": view, "componentType": component, "type": element, "count": count }),
        )
    }

    /// The triangle with compressed positions, normals and indices.
    fn file() -> File {
        let mut file = File::new();
        let positions: Vec<[f32; 3]> = TRIANGLE.as_chunks().0.to_vec();
        let view =
            compressed(&mut file, &meshopt::encode_vertex_buffer(&positions).unwrap(), 3, 12, "ATTRIBUTES", "NONE");
        let positions = accessor(&mut file, view, F32, "VEC3", 3);
        let normals = meshopt::encode_filter_oct::<i8>(&[[0.0, 0.6, 0.8, 0.0]; 3], 8);
        let view =
            compressed(&mut file, &meshopt::encode_vertex_buffer(&normals).unwrap(), 3, 4, "ATTRIBUTES", "OCTAHEDRAL");
        let normals = accessor(&mut file, view, I8, "VEC3", 3);
        file.json["accessors"][normals]["normalized"] = json!(true);
        let view =
            compressed(&mut file, &meshopt::encode_index_buffer(&[0, 1, 2], 3).unwrap(), 3, 2, "TRIANGLES", "NONE");
        let indices = accessor(&mut file, view, U16, "SCALAR", 3);
        let attributes = json!({ "POSITION": positions, "NORMAL": normals });
        file = file.with_node(json!([{ "attributes": attributes, "indices": indices }]));
        file.json["extensionsRequired"] = json!([NAME]);
        file
    }

    /// The file as GLB, with a second buffer without content.
    fn glb(file: &File) -> Vec<u8> {
        let glb = file.glb();
        let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        let mut json: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
        json["buffers"]
            .as_array_mut()
            .unwrap()
            .push(json!({ "byteLength": 1000, "extensions": { NAME: { "fallback": true } } }));
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let n = |x: usize| u32::try_from(x).unwrap().to_le_bytes();
        let rest = &glb[20 + length..];
        [&glb[..8], &n(20 + text.len() + rest.len()), &n(text.len()), &glb[16..20], &text, rest].concat()
    }

    fn read(file: &File) -> Result<Scene, String> {
        let folder = tempfile::tempdir().unwrap();
        read_bytes(folder.path(), "test.glb", &glb(file)).map_err(|error| error.to_string())
    }

    #[test]
    fn all_modes_are_decompressed() {
        let scene = read(&file()).unwrap();
        assert_eq!((scene.warnings.len(), &scene.meshes[0].triangles[..]), (0, &[[0, 1, 2]][..]));
        assert_eq!(scene.meshes[0].positions.as_flattened(), TRIANGLE);
        let [_, y, z] = scene.meshes[0].normals.as_ref().unwrap()[1];
        assert!((y - 0.6).abs() < 0.02 && (z - 0.8).abs() < 0.02, "{y} {z}");
        let mut other = file();
        let sequence = meshopt::encode_index_sequence(&[2, 0, 1], 3).unwrap();
        let view = compressed(&mut other, &sequence, 3, 4, "INDICES", "NONE");
        let indices = accessor(&mut other, view, super::super::U32, "SCALAR", 3);
        other.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
        assert_eq!(read(&other).unwrap().meshes[0].positions.len(), 3);
        let mut exponents = file();
        let positions = meshopt::encode_filter_exp(TRIANGLE.as_chunks::<3>().0, 15, meshopt::EncodeExpMode::Separate);
        let bytes = meshopt::encode_vertex_buffer(&positions).unwrap();
        let view = compressed(&mut exponents, &bytes, 3, 12, "ATTRIBUTES", "EXPONENTIAL");
        exponents.json["accessors"][0]["bufferView"] = json!(view);
        assert_eq!(read(&exponents).unwrap().meshes[0].positions.as_flattened(), TRIANGLE);
    }

    #[test]
    fn wrong_declarations_are_refused() {
        for (key, value, words) in [
            ("byteStride", json!(6), "buffer view 0: a stride of 6 bytes is invalid"),
            ("byteStride", json!(260), "a stride of 260 bytes is invalid"),
            ("count", json!(1_u64 << 40), "elements from"),
            ("count", json!(-1), "count is -1"),
            ("count", json!(200), "malformed compressed data"),
            ("mode", json!("LINES"), "unknown mode 'LINES'"),
            ("filter", json!("SHARP"), "unknown filter 'SHARP'"),
            ("filter", json!("QUATERNION"), "a stride of 12 bytes is invalid"),
            ("buffer", json!(9), "buffer index 9 out of range"),
            ("byteLength", json!(1_u64 << 40), "compressed bytes exceed their buffer"),
        ] {
            let mut file = file();
            file.json["bufferViews"][0]["extensions"][NAME][key] = value;
            let error = read(&file).expect_err(words);
            assert!(error.contains(words), "{words}: {error}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn mutated_files_never_panic(
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
            which in 0..3_usize,
            key in prop::sample::select(vec!["byteStride", "count", "byteLength", "byteOffset", "buffer"]),
            value in prop::sample::select(vec![0_u64, 1, 2, 3, 4, 8, 16, 255, 1 << 32, u64::MAX]),
            is_declared: bool,
        ) {
            let mut file = file();
            for (at, byte) in changes {
                let at = at.index(file.buffer.len());
                file.buffer[at] = byte;
            }
            if is_declared {
                file.json["bufferViews"][which]["extensions"][NAME][key] = json!(value);
            }
            if let Ok(scene) = read(&file) {
                prop_assert!(super::super::mutated::is_valid(&scene));
            }
        }
    }
}
