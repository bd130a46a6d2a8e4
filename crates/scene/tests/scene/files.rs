//! The files of `tests/files`, and malformed and unusual files of the optional folder of real models, give the outcomes in their tables
//! `EXPECT.tsv`; real models load without warnings and with known counts.

use std::fs;
use std::path::{Path, PathBuf};

use canted_fixtures::models;
use canted_scene::{ReadError, Scene, builtin, read, read_environment};

use crate::flaw::{flaw, is_numbered};

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
fn row_disagreement(row: &Row) -> Option<String> {
    let result = read(&folder().join(row.file));
    // Without its feature, a texture is skipped and a mesh is refused, and the message names the feature.
    let (expected, words, wanted) = match row.file.split_once('/') {
        Some(("ktx2", _)) if !cfg!(feature = "ktx2") => ("warn", "eature 'ktx2'", [row.n_triangles, row.n_materials]),
        Some(("draco", file)) if !cfg!(feature = "draco") && file != "fallback.gltf" => {
            ("error", "the feature 'draco'", [0; 2])
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
    let wrong: Vec<String> = rows.iter().filter_map(row_disagreement).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_test_detects_a_wrong_row() {
    let row = |expected, n_triangles| Row { file: "off/plain.off", expected, n_triangles, n_materials: 1, words: "" };
    assert_eq!(row_disagreement(&row("load", 1)).is_none(), cfg!(feature = "off"));
    assert!(row_disagreement(&row("warn", 1)).is_some() && row_disagreement(&row("load", 2)).is_some());
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

/// Reads a model that must load without a warning.
fn load(test: &str, file: &str) -> Option<Scene> {
    let scene = read(&models(test)?.join(file)).unwrap();
    assert_eq!(scene.warnings, [""; 0], "{file}");
    Some(scene)
}

#[test]
fn ply_models() {
    for (file, n_triangles, n_vertices) in [
        ("stanford/bunny.ply", 69_451, 35_947),
        ("stanford/dragon_res2.ply", 202_520, 100_250),
        ("stanford/dragon_res4_be.ply", 11_102, 5_205),
        ("ply/cube_ascii.ply", 12, 8),
        ("ply/cube_le.ply", 12, 8),
        ("ply/cube_be.ply", 12, 8),
        ("ply/teapot.ply", 2_256, 1_177),
        ("ply/rectangle_normals_uv.ply", 2, 4),
        ("ply/triangle_face_colors.ply", 1, 3),
    ] {
        let Some(scene) = load("ply_models", file) else { return };
        let found = (scene.n_placed_triangles(), scene.meshes[0].positions.len());
        assert_eq!(found, (n_triangles, n_vertices), "{file}");
        assert!(is_numbered(&scene));
    }
}

#[test]
fn sponza() {
    let Some(scene) = load("sponza", "sponza/sponza.obj") else { return };
    assert_eq!(scene.n_placed_triangles(), 262_267);
    assert_eq!((scene.materials.len(), scene.textures.len()), (25, 27), "24 color images and 3 masks");
    assert_eq!(scene.materials.iter().filter(|material| material.alpha_texture.is_some()).count(), 3);
    assert_eq!(scene.instances.len(), 393, "381 groups, some with several materials");
    for mesh in &scene.meshes {
        let is_textured = scene.materials[mesh.material_of(0).0 as usize].base_color_texture.is_some();
        assert_eq!((mesh.uvs.is_some(), mesh.normals.is_some()), (is_textured, false), "{}", mesh.name);
    }
    assert!(is_numbered(&scene));
}

#[test]
fn cornell_boxes() {
    let Some(scene) = load("cornell_boxes", "cornell/cornellBox.obj") else { return };
    assert_eq!((scene.n_placed_triangles(), scene.instances.len()), (32, 8));
    assert_eq!(scene.materials[0].emission, [1.0; 3]);
    assert!(is_numbered(&scene));

    let Some(scene) = load("cornell_boxes", "cornell/cornell_box_suzanne.obj") else { return };
    assert_eq!((scene.n_placed_triangles(), scene.materials.len()), (3_968, 4));
    assert!(is_numbered(&scene));
}

/// Warnings of a scene file.
fn read_scene(path: &Path) -> Result<Vec<String>, ReadError> {
    read(path).map(|scene| scene.warnings)
}

/// Warnings of an environment map.
fn read_map(path: &Path) -> Result<Vec<String>, ReadError> {
    let mut warnings = Vec::new();
    read_environment(path, &mut warnings).map(|_| warnings)
}

/// The difference between the expected and the actual outcome, if any.
fn disagreement(expected: &str, path: &Path, got: &Result<Vec<String>, ReadError>) -> Option<String> {
    let file = path.file_name().unwrap().to_string_lossy();
    let got = match got {
        Ok(warnings) if warnings.is_empty() => "load".to_owned(),
        Ok(warnings) => format!("warn {warnings:?}"),
        Err(error) if error.to_string().contains(&*file) => format!("error {error}"),
        Err(error) => format!("an error that does not name the file: {error}"),
    };
    (got.split(' ').next() != Some(expected)).then(|| format!("{file}: {expected} expected, got {got}"))
}

/// Outcomes that differ from the table: sound geometry is drawn without the attributes that are not, and the geometry of a file which requires
/// Draco is plain.
fn superseded(file: &str) -> Option<&'static str> {
    match file {
        "obj/vt_index_out_of_range.obj" => Some("warn"),
        "gltf/draco_required.glb" => Some("load"),
        _ => None,
    }
}

/// Rows for files in `folder`: file and expected outcome.
fn rows_of<'a>(table: &'a str, folder: &str) -> Vec<(&'a str, &'a str)> {
    let columns = table.lines().filter(|line| !line.starts_with('#')).skip(1).map(|line| {
        let columns: Vec<&str> = line.split('\t').collect();
        (columns[0], superseded(columns[0]).unwrap_or(columns[2]))
    });
    columns.filter(|(file, _)| file.split('/').next() == Some(folder)).collect()
}

#[test]
fn malformed_models_give_the_results_of_their_table() {
    let Some((folder, table)) = nasty("malformed_models_give_the_results_of_their_table") else { return };
    for (format, min_rows) in [("obj", 36), ("ply", 15), ("gltf", 47)] {
        let rows = rows_of(&table, format);
        assert!(rows.len() >= min_rows, "{} rows", rows.len());
        agree(&rows, |file| (folder.join(file), read_scene(&folder.join(file))));
    }
}

/// The folder of malformed models and its table.
fn nasty(test: &str) -> Option<(PathBuf, String)> {
    let folder = models(test)?.join("nasty");
    let table = fs::read_to_string(folder.join("EXPECT.tsv")).unwrap();
    Some((folder, table))
}

/// Asserts that files have the expected outcomes; `read` gives the path that an error names, and the outcome.
#[track_caller]
fn agree(rows: &[(&str, &str)], read: impl Fn(&str) -> (PathBuf, Result<Vec<String>, ReadError>)) {
    let outcome = |(file, expected): &(&str, &str)| {
        let (path, got) = read(file);
        disagreement(expected, &path, &got).map(|difference| format!("{file}: {difference}"))
    };
    let wrong: Vec<String> = rows.iter().filter_map(outcome).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// HDR and EXR files are environment maps, not textures.
fn is_environment(file: &str) -> bool {
    file.ends_with(".hdr") || file.ends_with(".exr")
}

#[test]
fn environments() {
    let Some((folder, table)) = nasty("environments") else { return };
    let rows: Vec<_> = rows_of(&table, "img").into_iter().filter(|(file, _)| is_environment(file)).collect();
    assert!(rows.len() >= 7, "{} rows", rows.len());
    agree(&rows, |file| (folder.join(file), read_map(&folder.join(file))));
}

/// Every row is covered by one of the other tests.
#[test]
fn all_rows_are_covered() {
    let Some((_, table)) = nasty("all_rows_are_covered") else { return };
    let n_rows = table.lines().filter(|line| !line.starts_with('#')).count() - 1;
    assert_eq!(["obj", "ply", "gltf", "img"].map(|folder| rows_of(&table, folder).len()).iter().sum::<usize>(), n_rows);
    let is_covered = |file: &str| [".png", ".jpg", ".hdr", ".exr", "/images.obj"].iter().any(|end| file.ends_with(end));
    assert!(rows_of(&table, "img").iter().all(|(file, _)| is_covered(file)));
}

/// Each image as the texture of a triangle.
#[test]
fn img() {
    let Some((models, table)) = nasty("img") else { return };
    let is_image = |(file, _): &(&str, &str)| file.ends_with(".png") || file.ends_with(".jpg");
    let rows: Vec<_> = rows_of(&table, "img").into_iter().filter(is_image).collect();
    assert!(rows.len() >= 10, "{} rows", rows.len());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.obj");
    fs::write(&path, "mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    agree(&rows, |file| {
        let name = file.trim_start_matches("img/");
        fs::copy(models.join(file), folder.path().join(name)).unwrap();
        fs::write(folder.path().join("m.mtl"), format!("newmtl a\nmap_Kd {name}\n")).unwrap();
        (path.clone(), read_scene(&path))
    });

    let scene = read(&models.join("img/images.obj")).unwrap();
    let bad = rows.iter().filter(|(_, expected)| *expected == "warn").count();
    assert_eq!(scene.warnings.len(), bad, "one warning for each bad image: {:?}", scene.warnings);
    assert_eq!(scene.textures.len(), rows.len() - bad);
    assert_eq!(scene.n_placed_triangles(), 2 * rows.len(), "a quad for each image");
}

/// Triangle counts from the table's descriptions.
#[test]
fn triangle_counts() {
    let Some(models) = models("triangle_counts") else { return };
    for (file, n_triangles) in [
        ("obj/negative_ok.obj", 2),
        ("obj/nan_inf_vertex.obj", 1),
        ("obj/odd_values.obj", 14),
        ("obj/concave_polygons.obj", 6),
        ("obj/nonplanar_polygon.obj", 2),
        ("obj/polygon_1500.obj", 1498),
        ("obj/mixed_faces.obj", 5),
        ("obj/duplicate_triangles.obj", 64),
        ("obj/same_centroid_5000.obj", 5000),
        ("obj/exponential_positions.obj", 121),
        ("obj/degenerate_triangles.obj", 4),
        ("ply/list_lengths.ply", 3),
        ("ply/double_extra_edges.ply", 12),
        ("ply/faces_first.ply", 1),
    ] {
        let scene = read(&models.join("nasty").join(file)).unwrap();
        assert_eq!(scene.n_placed_triangles(), n_triangles, "{file}");
    }
}

#[test]
fn flaw_detects_each_error() {
    assert_eq!(flaw(&builtin()), None);
    let spoiled: [fn(&mut Scene); 12] = [
        |scene| scene.meshes[3].positions[2][1] = f32::NAN,
        |scene| scene.meshes[3].triangles[5][0] = 1 << 20,
        |scene| scene.meshes[3].normals = Some(vec![[0.0; 3]]),
        |scene| scene.meshes[3].parts[0].first_triangle = 1,
        |scene| scene.meshes[0].parts[1].first_triangle = 0,
        |scene| scene.meshes[0].parts.clear(),
        |scene| scene.materials.truncate(5),
        |scene| scene.materials[0].ior = 0.5,
        |scene| scene.meshes.truncate(5),
        |scene| scene.instances[9].world_from_object.columns[1] = [0.0; 3],
        |scene| scene.instances.clear(),
        |scene| scene.cameras[0].target = scene.cameras[0].eye,
    ];
    for (k, spoil) in spoiled.iter().enumerate() {
        let mut scene = builtin();
        spoil(&mut scene);
        assert!(flaw(&scene).is_some(), "{k}");
    }
    let mut scene = builtin();
    assert!(is_numbered(&scene));
    scene.instances[9].first_primitive += 1;
    assert!(!is_numbered(&scene));
}

#[test]
fn disagreement_detects_every_mismatch() {
    let path = Path::new("a.obj");
    let read = |warnings: &[&str]| Ok(warnings.iter().map(|&warning| warning.to_owned()).collect());
    let error = |path: &str| Err(ReadError::UnknownFormat { path: path.into() });
    let agree = [("load", read(&[])), ("warn", read(&["w"])), ("error", error("a.obj"))];
    for (k, (expected, _)) in agree.iter().enumerate() {
        for (j, (_, got)) in agree.iter().enumerate() {
            assert_eq!(disagreement(expected, path, got).is_none(), j == k, "{expected} {got:?}");
        }
    }
    assert!(disagreement("error", path, &error("b.obj")).is_some());
}
