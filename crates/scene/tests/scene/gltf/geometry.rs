//! Primitives (topologies, indices, normals, joining, dropped triangles), vertex colors, tangents and texture coordinates.

use canted_scene::{MaterialId, Part};
use proptest::prelude::*;
use serde_json::{Value, json};

use super::{F32, File, TRIANGLE, U8, U16, U32};

/// An unused point, then five points of a planar strip.
const STRIP: [f32; 18] = [9.0, 9.0, 9.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0];

#[test]
fn strips_and_fans_with_and_without_indices() {
    for (mode, want) in [(5, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]), (6, [[1, 2, 0], [2, 3, 0], [3, 4, 0]])] {
        let mut file = File::new();
        let positions = file.reals("VEC3", &STRIP[3..]);
        let plain = file.with_node(json!([{ "attributes": { "POSITION": positions }, "mode": mode }])).scene();
        assert_eq!(plain.meshes[0].triangles, want);

        let mut file = File::new();
        let (positions, indices) = (file.reals("VEC3", &STRIP), file.indices(&[1, 2, 3, 4, 5]));
        let primitive = json!({ "attributes": { "POSITION": positions }, "indices": indices, "mode": mode });
        let indexed = file.with_node(json!([primitive])).scene();
        assert_eq!(indexed.meshes[0].triangles, want, "unused vertices are dropped");
        assert_eq!(indexed.meshes[0].positions, plain.meshes[0].positions);
    }
}

#[test]
fn reads_indices_of_every_width() {
    for (component, bytes) in [(U8, vec![2, 0, 1]), (U32, vec![2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0])] {
        let mut file = File::new();
        let positions = file.reals("VEC3", &TRIANGLE);
        let indices = file.accessor(component, "SCALAR", 3, &bytes);
        let scene = file.with_node(json!([{ "attributes": { "POSITION": positions }, "indices": indices }])).scene();
        assert_eq!(scene.meshes[0].triangles, [[2, 0, 1]]);
    }
    let mut file = File::new();
    let (positions, indices) = (file.reals("VEC3", &TRIANGLE), file.reals("SCALAR", &[0.0, 1.0, 2.0]));
    file.with_node(json!([{ "attributes": { "POSITION": positions }, "indices": indices }])).rejected("indices");
}

#[test]
fn primitives_become_parts() {
    let mut file = File::new();
    let (positions, indices) = (file.reals("VEC3", &STRIP), file.indices(&[1, 2, 3, 3, 2, 4, 5, 4, 3]));
    let normals = file.reals("VEC3", &[0.0, 0.0, 2.0].repeat(6));
    for name in ["first", "second"] {
        file.push("materials", json!({ "name": name }));
    }
    let scene = file
        .with_node(json!([
            { "attributes": { "POSITION": positions }, "indices": indices, "material": 1 },
            { "attributes": { "POSITION": positions, "NORMAL": normals }, "indices": indices },
        ]))
        .scene();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.triangles[3..], [[5, 6, 7], [7, 6, 8], [9, 8, 7]]);
    assert_eq!(mesh.positions.len(), 10, "the unused vertex is dropped");
    let part = |first_triangle, material| Part { first_triangle, material: MaterialId(material) };
    assert_eq!(mesh.parts, [part(0, 1), part(3, 2)]);
    assert_eq!((scene.materials.len(), &scene.materials[2].name[..]), (3, "default"));
    let normals = mesh.normals.as_ref().unwrap();
    assert!(normals[..5].iter().all(|normal| *normal == [0.0; 3]), "the first primitive has no normals");
    assert!(normals[5..].iter().all(|normal| *normal == [0.0, 0.0, 1.0]), "normalized");
    assert!(mesh.uvs.is_none(), "no texture needs coordinates");
}

#[test]
fn shared_vertex_lists_are_not_copied() {
    let mut file = File::new();
    let many: Vec<f32> = (0..3 * 30_000).map(|k| (k % 97) as f32).collect();
    let positions = file.reals("VEC3", &many);
    let primitives: Vec<_> = (0..1000_u16)
        .map(|k| {
            let first = 30 * k;
            let indices = file.indices(&[first, first + 1, first + 5]);
            json!({ "attributes": { "POSITION": positions }, "indices": indices })
        })
        .collect();
    let scene = file.with_node(json!(primitives)).read().unwrap();
    assert_eq!(scene.meshes[0].positions.len(), 3000);
}

#[test]
fn non_finite_triangles_are_dropped() {
    let mut file = File::new();
    let mut numbers = STRIP;
    numbers[15] = f32::NEG_INFINITY;
    let positions = file.reals("VEC3", &numbers);
    let primitive = json!({ "attributes": { "POSITION": positions }, "mode": 5 });
    let scene = file.with_node(json!([primitive])).warned("non-finite");
    assert_eq!(scene.meshes[0].positions.len(), 5);
    assert_eq!(scene.n_unique_triangles(), 3);
}

#[test]
fn positions_keep_their_bits() {
    let numbers = [-0.0, f32::from_bits(1), 1e-38, f32::MAX, f32::MIN_POSITIVE, -1e7, 16_777_215.0, -0.0, 0.1];
    let mut file = File::new();
    let positions = file.reals("VEC3", &numbers);
    let scene = file.with_node(json!([{ "attributes": { "POSITION": positions } }])).read().unwrap();
    let bits = |numbers: &[f32]| -> Vec<u32> { numbers.iter().map(|x| x.to_bits()).collect() };
    assert_eq!(bits(scene.meshes[0].positions.as_flattened()), bits(&numbers));
}

#[test]
fn invalid_normals_become_zero() {
    let mut file = File::new();
    let positions = file.reals("VEC3", &TRIANGLE);
    let normals = file.reals("VEC3", &[f32::NAN, 0.0, 1.0, 0.0, 0.0, 0.0, 1e-30, 0.0, 0.0]);
    let scene = file.with_node(json!([{ "attributes": { "POSITION": positions, "NORMAL": normals } }])).scene();
    assert_eq!(scene.meshes[0].normals.as_ref().unwrap()[..], [[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0]]);
}

#[test]
fn skipped_primitives_are_reported() {
    let mut file = File::new();
    let (positions, indices) = (file.reals("VEC3", &TRIANGLE), file.indices(&[0, 1, 2, 1]));
    let valid = json!({ "attributes": { "POSITION": positions } });
    let with = |primitive| file.clone().with_node(json!([valid, primitive]));
    with(json!({ "attributes": { "POSITION": positions }, "mode": 1 }))
        .warned("skipping points and lines (not supported): mesh 0 primitive 1");
    with(json!({ "attributes": { "NORMAL": positions } }))
        .warned("skipping primitives without POSITION: mesh 0 primitive 1");
    let scene =
        with(json!({ "attributes": { "POSITION": positions }, "indices": indices })).warned("1 trailing indices");
    assert_eq!(scene.n_unique_triangles(), 2);
    let mut many = file.clone().with_node(json!([valid]));
    for _ in 0..16 {
        many = many.with_node(json!([{ "attributes": { "POSITION": positions }, "mode": 1 }]));
    }
    many.warned("skipping points and lines (not supported): mesh 1 primitive 0 and 15 more");
    file.clone().with_node(json!([{ "attributes": { "POSITION": positions }, "mode": 0 }])).rejected("nothing to draw");
}

#[test]
fn invalid_primitives_are_rejected() {
    let mut file = File::new();
    let (positions, indices) = (file.reals("VEC3", &TRIANGLE), file.indices(&[0, 1, 3]));
    let (pairs, two) = (file.reals("VEC2", &TRIANGLE[..6]), file.reals("VEC3", &TRIANGLE[..6]));
    let with = |primitive| file.clone().with_node(json!([primitive]));
    with(json!({ "attributes": { "POSITION": 9 } })).rejected("accessor index 9 out of range (4 defined)");
    with(json!({ "attributes": { "POSITION": pairs } })).rejected("POSITION");
    with(json!({ "attributes": { "POSITION": positions }, "indices": indices }))
        .rejected("index 2 is 3, out of range (3 vertices)");
    with(json!({ "attributes": { "POSITION": positions, "NORMAL": two } })).rejected("2 NORMAL values for 3 vertices");
    with(json!({ "attributes": { "POSITION": positions }, "material": 0 }))
        .rejected("material index 0 out of range (0 defined)");
    with(json!({ "attributes": { "POSITION": positions }, "mode": 7 })).rejected("unknown mode");
}

#[test]
fn unused_meshes_only_count_for_numbering() {
    let mut file = File::new();
    let (strip, triangle) = (file.reals("VEC3", &STRIP), file.reals("VEC3", &TRIANGLE));
    let lines = file.mesh(json!([{ "attributes": { "POSITION": triangle }, "mode": 3 }]));
    file.mesh(json!([{ "attributes": { "POSITION": strip }, "mode": 5 }]));
    let placed = file.mesh(json!([{ "attributes": { "POSITION": triangle } }]));
    file.json["nodes"] = json!([{ "mesh": lines }, { "mesh": placed }]);
    let scene = file.warned("points and lines");
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 1));
    assert_eq!(scene.instances[0].first_primitive, 4);
    assert_eq!(scene.instances[0].mesh.0, 0);
}

proptest! {
    /// Against direct lookup of each corner.
    #[test]
    fn corners_match_the_indices(
        numbers in prop::collection::vec(prop::num::f32::NORMAL | prop::num::f32::ZERO, 12..60),
        picks in prop::collection::vec(any::<u16>(), 3..40),
    ) {
        let n_vertices = numbers.len() / 3;
        let indices: Vec<u16> = picks.iter().map(|pick| pick % u16::try_from(n_vertices).unwrap()).collect();
        let mut file = File::new();
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        let positions = file.accessor(F32, "VEC3", n_vertices, &bytes);
        let index_accessor = file.indices(&indices);
        let read = file.with_node(json!([{ "attributes": { "POSITION": positions }, "indices": index_accessor }])).read();
        // Files with only degenerate triangles are rejected.
        prop_assume!(read.is_ok());
        let mesh = &read.unwrap().meshes[0];
        let want: Vec<[f32; 3]> = indices[..indices.len() / 3 * 3]
            .iter()
            .map(|&index| [0, 1, 2].map(|k| numbers[3 * usize::from(index) + k]))
            .collect();
        let found: Vec<[f32; 3]> =
            mesh.triangles.as_flattened().iter().map(|&corner| mesh.positions[corner as usize]).collect();
        prop_assert_eq!(found, want);
        let mut used = indices[..indices.len() / 3 * 3].to_vec();
        used.sort_unstable();
        used.dedup();
        prop_assert_eq!(mesh.positions.len(), used.len());
    }
}

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
