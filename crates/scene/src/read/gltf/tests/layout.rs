//! Accessors and buffers: strides, offsets, component types, sparse elements, bounds.

use serde_json::{Value, json};

use super::{F32, File, I8, I16, TRIANGLE, U8, U16, U32};

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
        let uri = format!("data:;base64,{}", super::to_base64(&file.buffer));
        file.json["buffers"] = json!([{ "byteLength": full.buffer.len(), "uri": uri }]);
        file.rejected("buffer 0: byteLength is 36");
        file.json["buffers"] = json!([{ "byteLength": length, "uri": uri }]);
        file.rejected("buffer view 0");
    }
}

#[test]
fn reads_buffers_from_files() {
    let mut file = File::of_nodes(json!([{ "mesh": 0 }]));
    let bytes = file.buffer.clone();
    let mut named = |uri: &str| {
        file.json["buffers"] = json!([{ "byteLength": bytes.len(), "uri": uri }]);
        file.read_beside(|folder| std::fs::write(folder.join("my data.bin"), &bytes).unwrap())
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
