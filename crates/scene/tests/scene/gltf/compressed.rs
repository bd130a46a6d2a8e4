//! Geometry compressed by meshoptimizer and by Draco.

use std::path::PathBuf;

use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;
use crate::flaw::flaw;

const MESHOPT: &str = "EXT_meshopt_compression";

/// Streams of meshoptimizer 0.25: the positions, normals and indices of the triangle, a sequence, and the positions with exponents.
const POSITIONS: &[u8] = &[
    161, 250, 234, 170, 0, 0, 255, 0, 127, 126, 0, 0, 127, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    0, 1, 1, 0,
];
const NORMALS: &[u8] = &[161, 170, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 54, 127, 0, 0];
const TRIANGLES: &[u8] = &[225, 240, 0, 118, 135, 86, 103, 120, 169, 134, 101, 137, 104, 152, 1, 105, 0, 0];
const SEQUENCE: &[u8] = &[209, 8, 6, 4, 0, 0, 0, 0];
const EXPONENTS: &[u8] = &[
    161, 238, 238, 170, 0, 64, 63, 0, 2, 0, 0, 0, 64, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 242, 0, 0, 0, 242,
    0, 0, 0, 242, 0, 0, 0,
];

/// A compressed view of `count` elements in buffer 0; its uncompressed content would be in buffer 1.
fn compressed(file: &mut File, bytes: &[u8], count: usize, stride: usize, mode: &str, filter: &str) -> usize {
    let view = file.view(bytes);
    let [offset, length] = ["byteOffset", "byteLength"].map(|key| file.json["bufferViews"][view][key].clone());
    file.json["bufferViews"][view] = json!({
        "buffer": 1, "byteLength": count * stride,
        "extensions": { MESHOPT: {
            "buffer": 0, "byteOffset": offset, "byteLength": length, "byteStride": stride, "count": count,
            "mode": mode, "filter": filter,
        } },
    });
    view
}

/// The triangle with compressed positions, normals and indices.
fn meshopt_file() -> File {
    let mut file = File::new();
    let view = compressed(&mut file, POSITIONS, 3, 12, "ATTRIBUTES", "NONE");
    let positions = file.accessor_of(view, F32, "VEC3", 3);
    let view = compressed(&mut file, NORMALS, 3, 4, "ATTRIBUTES", "OCTAHEDRAL");
    let normals = file.accessor_of(view, I8, "VEC3", 3);
    file.json["accessors"][normals]["normalized"] = json!(true);
    let view = compressed(&mut file, TRIANGLES, 3, 2, "TRIANGLES", "NONE");
    let indices = file.accessor_of(view, U16, "SCALAR", 3);
    let attributes = json!({ "POSITION": positions, "NORMAL": normals });
    file = file.with_node(json!([{ "attributes": attributes, "indices": indices }]));
    file.json["extensionsRequired"] = json!([MESHOPT]);
    file
}

/// Reads the file with a second buffer without content, which is marked or not.
fn read_views(file: &File, fallback: Value) -> Result<Scene, String> {
    let mut file = file.clone();
    let fallback = json!({ "byteLength": 1000, "extensions": fallback });
    file.json["buffers"] = json!([{ "byteLength": file.buffer.len(), "uri": "buffer.bin" }, fallback]);
    file.read().map_err(|error| error.to_string())
}

fn read_meshopt(file: &File) -> Result<Scene, String> {
    read_views(file, json!({ MESHOPT: { "fallback": true } }))
}

#[test]
fn all_modes_are_decompressed() {
    let scene = read_meshopt(&meshopt_file()).unwrap();
    assert_eq!((scene.warnings.len(), &scene.meshes[0].triangles[..]), (0, &[[0, 1, 2]][..]));
    assert_eq!(scene.meshes[0].positions.as_flattened(), TRIANGLE);
    let [_, y, z] = scene.meshes[0].normals.as_ref().unwrap()[1];
    assert!((y - 0.6).abs() < 0.02 && (z - 0.8).abs() < 0.02, "{y} {z}");
    let mut other = meshopt_file();
    let view = compressed(&mut other, SEQUENCE, 3, 4, "INDICES", "NONE");
    let indices = other.accessor_of(view, U32, "SCALAR", 3);
    other.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    assert_eq!(read_meshopt(&other).unwrap().meshes[0].positions.len(), 3);
    let mut exponents = meshopt_file();
    let view = compressed(&mut exponents, EXPONENTS, 3, 12, "ATTRIBUTES", "EXPONENTIAL");
    exponents.json["accessors"][0]["bufferView"] = json!(view);
    assert_eq!(read_meshopt(&exponents).unwrap().meshes[0].positions.as_flattened(), TRIANGLE);
}

/// gltf-pipeline writes such files.
#[test]
fn the_buffer_of_plain_data_may_lack_its_mark() {
    assert_eq!(read_views(&meshopt_file(), json!({})).unwrap().meshes[0].positions.as_flattened(), TRIANGLE);
    // One whose views are not all compressed has content.
    let mut file = meshopt_file();
    file.json["bufferViews"].as_array_mut().unwrap().push(json!({ "buffer": 1, "byteLength": 4 }));
    assert!(read_views(&file, json!({})).unwrap_err().contains("buffer 1: neither a uri nor a BIN chunk"));
}

#[test]
fn wrong_declarations_are_refused() {
    for (key, value, words) in [
        ("byteStride", json!(6), "buffer view 0: a stride of 6 bytes is invalid"),
        ("byteStride", json!(260), "a stride of 260 bytes is invalid"),
        ("count", json!(1_u64 << 40), "elements from"),
        ("count", json!(-1), "count is -1"),
        ("count", json!(200), "malformed compressed data: "),
        ("mode", json!("LINES"), "unknown mode 'LINES'"),
        ("filter", json!("SHARP"), "unknown filter 'SHARP'"),
        ("filter", json!("QUATERNION"), "a stride of 12 bytes is invalid"),
        ("buffer", json!(9), "buffer index 9 out of range"),
        ("byteLength", json!(1_u64 << 40), "compressed bytes exceed their buffer"),
    ] {
        let mut file = meshopt_file();
        file.json["bufferViews"][0]["extensions"][MESHOPT][key] = value;
        let error = read_meshopt(&file).expect_err(words);
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
        let mut file = meshopt_file();
        for (at, byte) in changes {
            let at = at.index(file.buffer.len());
            file.buffer[at] = byte;
        }
        if is_declared {
            file.json["bufferViews"][which]["extensions"][MESHOPT][key] = json!(value);
        }
        if let Ok(scene) = read_meshopt(&file) {
            prop_assert_eq!(flaw(&scene), None);
        }
    }
}

const DRACO: &str = "KHR_draco_mesh_compression";

/// The text of a file of `tests/files/draco`.
fn draco(name: &str) -> Value {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/files/draco")).join(name);
    serde_json::from_slice(&fs::read(path.with_extension("gltf")).unwrap()).unwrap()
}

fn draco_scene(json: &Value) -> Result<Scene, String> {
    File { json: json.clone(), buffer: Vec::new() }.read().map_err(|error| error.to_string())
}

#[test]
#[cfg(not(feature = "draco"))]
fn without_the_feature_the_file_is_refused() {
    let error = draco_scene(&draco("edgebreaker")).unwrap_err();
    assert!(error.contains("built without the feature 'draco'"), "{error}");
    draco_scene(&draco("fallback")).unwrap();
}

#[cfg(feature = "draco")]
mod decoded {
    use super::*;

    /// Each file has a second mesh: what the reference decoder makes of the data of the first.
    #[test]
    fn meshes_are_those_of_the_reference_decoder() {
        for name in
            ["edgebreaker", "valence", "fast", "sequential", "lossless", "cube_edgebreaker", "cube_sequential", "seams"]
        {
            let scene = draco_scene(&draco(name)).unwrap();
            let [mesh, wanted] = &scene.meshes[..] else { panic!("{name}: {} meshes", scene.meshes.len()) };
            assert!(!mesh.triangles.is_empty() && mesh.triangles == wanted.triangles, "{name}");
            assert!(mesh.positions == wanted.positions, "{name}: positions");
            assert!(mesh.normals == wanted.normals, "{name}: normals");
            assert!(mesh.uvs == wanted.uvs && mesh.colors == wanted.colors, "{name}: texture coordinates and colors");
            let is_colored = ["edgebreaker", "fast", "sequential"].contains(&name);
            assert_eq!(
                (mesh.uvs.is_some(), mesh.colors.is_some()),
                (is_colored || name.starts_with("cube"), is_colored)
            );
        }
    }

    #[test]
    fn plain_data_are_preferred_and_need_no_valid_data() {
        let mut json = draco("fallback");
        assert_eq!(draco_scene(&json).unwrap().meshes[0].positions.len(), 4);
        json["meshes"][0]["primitives"][0]["extensions"][DRACO]["bufferView"] = json!(99);
        assert_eq!(draco_scene(&json).unwrap().meshes[0].positions.len(), 4);
    }

    #[test]
    fn wrong_declarations_are_refused() {
        type Edit = fn(&mut Value);
        let edits: [(&str, Edit); 7] = [
            ("mesh 0 primitive 0: KHR_draco_mesh_compression: bufferView", |json| {
                json["meshes"][0]["primitives"][0]["extensions"][DRACO]["bufferView"] = json!("0");
            }),
            ("buffer view index 99 out of range", |json| {
                json["meshes"][0]["primitives"][0]["extensions"][DRACO]["bufferView"] = json!(99);
            }),
            ("KHR_draco_mesh_compression: attributes", |json| {
                json["meshes"][0]["primitives"][0]["extensions"][DRACO]["attributes"]["POSITION"] = json!(-1);
            }),
            ("mesh 0 primitive 0: POSITION: malformed Draco data: no attribute 77", |json| {
                json["meshes"][0]["primitives"][0]["extensions"][DRACO]["attributes"]["POSITION"] = json!(77);
            }),
            ("expected type Vec3", |json| {
                // Texture coordinates for positions.
                json["meshes"][0]["primitives"][0]["extensions"][DRACO]["attributes"]["POSITION"] = json!(13);
            }),
            ("decoded bytes in a file of", |json| json["accessors"][0]["count"] = json!(1_u64 << 40)),
            ("buffer view 0: malformed Draco data: ", |json| {
                json["bufferViews"][0]["byteLength"] = json!(30);
            }),
        ];
        for (words, edit) in edits {
            let mut json = draco("edgebreaker");
            edit(&mut json);
            let error = draco_scene(&json).expect_err(words);
            assert!(error.contains(words), "{words}: {error}");
        }
    }

    /// Numbers are those of the data, which differ where the encoder splits or merges vertices.
    #[test]
    fn counts_of_accessors_may_be_wrong() {
        let mut json = draco("seams");
        for accessor in json["accessors"].as_array_mut().unwrap() {
            if accessor.get("bufferView").is_none() {
                accessor["count"] = json!(60);
            }
        }
        assert_eq!(draco_scene(&json).unwrap().meshes[0].triangles.len(), 170);
    }

    /// One type of integers for another.
    #[test]
    fn components_get_the_type_of_the_accessor() {
        let mut json = draco("edgebreaker");
        let color = json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"].as_u64().unwrap() as usize;
        let plain = draco_scene(&json).unwrap();
        json["accessors"][color]["componentType"] = json!(U16);
        let wide = draco_scene(&json).unwrap();
        let [plain, wide] = [plain, wide].map(|scene| scene.meshes[0].colors.as_ref().unwrap()[5]);
        assert!((0..4).all(|k| (wide[k] - plain[k] * 255.0 / 65535.0).abs() < 1e-6), "{plain:?} {wide:?}");
        json["accessors"][color]["componentType"] = json!(I8);
        let error = draco_scene(&json).unwrap_err();
        assert!(error.contains("COLOR_0: malformed Draco data: 255 does not fit I8"), "{error}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]

        #[test]
        fn mutated_data_never_panic(
            name in prop::sample::select(vec!["edgebreaker", "fast", "sequential", "valence", "lossless", "seams"]),
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        ) {
            let mut json = draco(name);
            let uri = json["buffers"][0]["uri"].as_str().unwrap();
            let (start, mut text) = uri.split_once(',').map(|(start, text)| (start.to_owned(), text.as_bytes().to_vec())).unwrap();
            // Of base64: four characters stand for three bytes.
            let n_compressed = json["bufferViews"][0]["byteLength"].as_u64().unwrap() as usize * 4 / 3;
            for (at, byte) in changes {
                let at = at.index(n_compressed);
                text[at] = b'A' + byte % 26;
            }
            json["buffers"][0]["uri"] = json!(format!("{start},{}", String::from_utf8(text).unwrap()));
            if let Ok(scene) = draco_scene(&json) {
                prop_assert_eq!(flaw(&scene), None);
            }
        }
    }
}
