//! The files of `tests/files` give the outcomes in their table `EXPECT.tsv`.

use std::fs;
use std::path::PathBuf;

use canted_scene::{Scene, read};

/// A row: file, outcome, triangles, materials, words of a message.
struct Row<'a> {
    file: &'a str,
    expected: &'a str,
    n_triangles: usize,
    n_materials: usize,
    words: &'a str,
}

fn folder() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/files"))
}

fn rows(table: &str) -> Vec<Row<'_>> {
    let lines = table.lines().filter(|line| !line.starts_with('#')).skip(1);
    lines
        .map(|line| {
            let columns: Vec<&str> = line.split('\t').collect();
            assert_eq!(columns.len(), 7, "{line}");
            let number = |column: &str| column.parse().unwrap_or_else(|_| panic!("{line}"));
            let code = if columns[2] == "error" { "2" } else { "0" };
            assert_eq!(columns[3], code, "{line}");
            Row {
                file: columns[0],
                expected: columns[2],
                n_triangles: number(columns[4]),
                n_materials: number(columns[5]),
                words: columns[6],
            }
        })
        .collect()
}

/// What is wrong with the outcome of a row, if anything.
fn disagreement(row: &Row) -> Option<String> {
    let result = read(&folder().join(row.file));
    // Without its feature, a texture is skipped and a mesh is refused, and the message names the feature.
    let (expected, words, wanted) = match row.file.split_once('/') {
        Some(("ktx2", _)) if !cfg!(feature = "ktx2") => ("warn", "eature 'ktx2'", [row.n_triangles, row.n_materials]),
        Some(("meshopt", file)) if !cfg!(feature = "meshopt") && file != "fallback.gltf" => {
            ("error", "the feature 'meshopt'", [0; 2])
        }
        _ => (row.expected, row.words, [row.n_triangles, row.n_materials]),
    };
    let (got, messages, counts) = match &result {
        Ok(scene) if scene.warnings.is_empty() => ("load", String::new(), counts(scene)),
        Ok(scene) => ("warn", scene.warnings.join("\n"), counts(scene)),
        Err(error) => ("error", error.to_string(), [0; 2]),
    };
    let is_right = got == expected && messages.contains(words) && counts == wanted;
    (!is_right).then(|| format!("{}: {expected} expected, got {got} {counts:?} {messages}", row.file))
}

fn counts(scene: &Scene) -> [usize; 2] {
    [scene.n_placed_triangles(), scene.materials.len()]
}

#[test]
#[cfg(all(
    feature = "stl",
    feature = "off",
    feature = "gzip",
    feature = "bmp",
    feature = "tga",
    feature = "tiff",
    feature = "webp"
))]
fn files_give_the_results_of_their_table() {
    let table = fs::read_to_string(folder().join("EXPECT.tsv")).unwrap();
    let rows = rows(&table);
    assert!(rows.len() >= 60, "{} rows", rows.len());
    let wrong: Vec<String> = rows.iter().filter_map(disagreement).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_test_detects_a_wrong_row() {
    let row = |expected, n_triangles| Row { file: "off/plain.off", expected, n_triangles, n_materials: 1, words: "" };
    assert_eq!(disagreement(&row("load", 1)).is_none(), cfg!(feature = "off"));
    assert!(disagreement(&row("warn", 1)).is_some() && disagreement(&row("load", 2)).is_some());
}

/// Colors of vertices in linear light, with the same meaning in every format.
#[test]
#[cfg(feature = "off")]
fn vertex_colors_are_read() {
    for file in [
        "obj/colors_float.obj",
        "obj/colors_byte.obj",
        "obj/colors_alpha.obj",
        "ply/colors_uchar.ply",
        "ply/colors_alpha.ply",
        "ply/colors_float.ply",
        "ply/colors_ushort.ply",
        "ply/colors_diffuse.ply",
        "off/colors.off",
    ] {
        let scene = read(&folder().join(file)).unwrap();
        let want = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
        assert_eq!(scene.meshes[0].colors.as_deref(), Some(&want[..]), "{file}");
        assert_eq!(scene.materials[0].base_color, [1.0; 3], "{file}");
    }
    let some = read(&folder().join("obj/colors_some.obj")).unwrap();
    assert_eq!(some.meshes[0].colors.as_ref().unwrap()[1..], [[1.0; 4]; 2], "white without a color");
    assert!(read(&folder().join("obj/weights.obj")).unwrap().meshes[0].colors.is_none());
}

#[test]
fn strips_alternate_their_orientation() {
    let triangles = |file: &str| read(&folder().join(file)).unwrap().meshes[0].triangles.clone();
    assert_eq!(triangles("ply/strips.ply"), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
    assert_eq!(triangles("ply/strips_restart.ply"), [[0, 1, 2], [2, 3, 4]]);
    // Repeated indices keep the alternation of one strip: the sixth index makes an even triangle.
    assert_eq!(triangles("ply/strips_joined.ply"), [[0, 1, 2], [2, 3, 4]]);
}

#[test]
fn maps_of_obj_materials_are_read() {
    let material = |name: &str| read(&folder().join(format!("textures/{name}.obj"))).unwrap().materials[0].clone();
    let both = material("pr_pm");
    assert!(both.metallic_roughness_texture.is_some());
    assert_eq!([both.metallic, both.roughness, both.specular], [1.0; 3]);
    let rough = material("pr");
    assert_eq!([rough.metallic, rough.roughness], [0.0, 1.0]);
    assert_eq!(material("bump").normal_scale, 0.5);
    let scene = read(&folder().join("textures/norm.obj")).unwrap();
    assert_eq!(scene.textures.len(), 1, "heights are not read beside normals");
    assert_eq!(scene.textures[0].texels[1], [40, 0, 200, 255]);
    assert_eq!(material("bmp").base_color_texture.is_some(), cfg!(feature = "bmp"));
}

#[test]
fn cameras_have_names() {
    let scene = read(&folder().join("gltf/camera.gltf")).unwrap();
    assert_eq!(scene.camera_names, ["front", "flat"]);
    assert!(scene.environment.is_none());
}
