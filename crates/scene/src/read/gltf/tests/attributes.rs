//! Vertex colors, tangents and texture coordinates.

use serde_json::{Value, json};

use super::{File, TRIANGLE, U8, U16};

/// A material with a normal map on set 1 and a base color texture on set 0.
fn mapped() -> Value {
    json!({
        "normalTexture": { "index": 0, "texCoord": 1 },
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } },
    })
}

/// Adds an attribute to the triangle.
fn with(mut file: File, attribute: &str, accessor: usize) -> File {
    file.json["meshes"][0]["primitives"][0]["attributes"][attribute] = json!(accessor);
    file
}

#[test]
fn reads_colors_of_every_type() {
    let halves = |file: &mut File| {
        [
            file.reals("VEC4", &[0.2, 0.4, 0.6, 0.8].repeat(3)),
            file.reals("VEC3", &[0.2, 0.4, 0.6].repeat(3)),
            file.accessor(U8, "VEC4", 3, &[51, 102, 153, 204].repeat(3)),
            file.accessor(U16, "VEC3", 3, &[0x33, 0x33, 0x66, 0x66, 0x99, 0x99].repeat(3)),
        ]
    };
    for (k, alpha) in [0.8, 1.0, 0.8, 1.0].into_iter().enumerate() {
        let mut file = File::of_nodes(json!([{ "mesh": 0 }]));
        let accessor = halves(&mut file)[k];
        file.json["accessors"][accessor]["normalized"] = json!(k >= 2);
        let scene = with(file, "COLOR_0", accessor).scene();
        assert_eq!(scene.meshes[0].colors.as_deref().unwrap(), [[0.2, 0.4, 0.6, alpha]; 3], "case {k}");
    }
}

#[test]
fn white_colors_are_dropped_and_invalid_ones_clamped() {
    let colored = |colors: &[f32]| {
        let mut file = File::of_nodes(json!([{ "mesh": 0 }]));
        let accessor = file.reals("VEC3", colors);
        with(file, "COLOR_0", accessor)
    };
    assert!(colored(&[1.0; 9]).scene().meshes[0].colors.is_none(), "white is dropped");
    let scene = colored(&[2.0, -1.0, f32::NAN, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]).scene();
    assert_eq!(scene.meshes[0].colors.as_ref().unwrap()[0], [1.0, 0.0, 0.0, 1.0]);
    colored(&[1.0; 6]).rejected("2 COLOR_0 values for 3 vertices");
}

#[test]
fn primitives_without_colors_are_white() {
    let mut file = File::new();
    let (positions, colors) = (file.reals("VEC3", &TRIANGLE), file.reals("VEC3", &[0.5; 9]));
    let plain = json!({ "attributes": { "POSITION": positions } });
    let colored = json!({ "attributes": { "POSITION": positions, "COLOR_0": colors } });
    let scene = file.with_node(json!([plain, colored, plain])).scene();
    let colors = scene.meshes[0].colors.as_ref().unwrap();
    assert_eq!([colors[0], colors[3], colors[8]], [[1.0; 4], [0.5, 0.5, 0.5, 1.0], [1.0; 4]]);
}

#[test]
fn tangents_are_kept_for_normal_maps() {
    let tangents = |material: Value| {
        let mut file = super::materials::file(material);
        let numbers = [2.0, 0.0, 0.0, 1.0, 0.0, 3.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0];
        let accessor = file.reals("VEC4", &numbers);
        with(file, "TANGENT", accessor).scene().meshes.remove(0).tangents
    };
    assert_eq!(tangents(json!({})), None);
    let want = vec![[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, -1.0], [0.0; 4]];
    assert_eq!(tangents(json!({ "normalTexture": { "index": 0 } })), Some(want), "unit or zero");
}

#[test]
fn reads_two_sets_of_coordinates() {
    let mesh = &super::materials::file(mapped()).scene().meshes[0];
    let (first, second) = (mesh.uvs.as_ref().unwrap(), mesh.second_uvs.as_ref().unwrap());
    assert_eq!((first[0], first[2]), ([0.0, 1.0], [1.0, 0.0]));
    assert_eq!((second[0], second[2]), ([1.0, 0.0], [0.0, 1.0]));
}

#[test]
fn non_finite_coordinates_become_zero() {
    let mut file = super::materials::file(mapped());
    let uvs = file.reals("VEC2", &[f32::NAN, 0.5, 0.5, f32::INFINITY, 0.5, 0.5]);
    let scene = with(file, "TEXCOORD_0", uvs).scene();
    assert_eq!(scene.meshes[0].uvs.as_deref().unwrap(), [[0.0, 0.0], [0.0, 0.0], [0.5, 0.5]]);
}
