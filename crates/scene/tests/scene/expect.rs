//! Malformed and unusual files give the outcomes in their table `EXPECT.tsv`.

use std::fs;
use std::path::Path;

use canted_scene::{ReadError, read, read_environment};

use crate::folder::models;

/// Warnings of a scene file.
fn scene(path: &Path) -> Result<Vec<String>, ReadError> {
    read(path).map(|scene| scene.warnings)
}

/// Warnings of an environment map.
fn environment(path: &Path) -> Result<Vec<String>, ReadError> {
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

/// Outcomes that differ from the table: sound geometry is drawn without the attributes that are not.
fn superseded(file: &str) -> Option<&'static str> {
    (file == "obj/vt_index_out_of_range.obj").then_some("warn")
}

/// Rows for files in `folder`: file and expected outcome.
fn rows<'a>(table: &'a str, folder: &str) -> Vec<(&'a str, &'a str)> {
    let columns = table.lines().filter(|line| !line.starts_with('#')).skip(1).map(|line| {
        let columns: Vec<&str> = line.split('\t').collect();
        (columns[0], superseded(columns[0]).unwrap_or(columns[2]))
    });
    columns.filter(|(file, _)| file.split('/').next() == Some(folder)).collect()
}

#[track_caller]
fn check(test: &str, folder: &str, min_rows: usize) {
    let Some(models) = models(test) else { return };
    let table = fs::read_to_string(models.join("nasty/EXPECT.tsv")).unwrap();
    let rows = rows(&table, folder);
    assert!(rows.len() >= min_rows, "{} rows", rows.len());
    let wrong: Vec<String> = rows
        .iter()
        .filter_map(|(file, expected)| {
            let path = models.join("nasty").join(file);
            disagreement(expected, &path, &scene(&path))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn obj() {
    check("obj", "obj", 36);
}

#[test]
fn ply() {
    check("ply", "ply", 15);
}

#[test]
fn gltf() {
    check("gltf", "gltf", 47);
}

/// HDR and EXR files are environment maps, not textures.
fn is_environment(file: &str) -> bool {
    file.ends_with(".hdr") || file.ends_with(".exr")
}

#[test]
fn environments() {
    let Some(models) = models("environments") else { return };
    let table = fs::read_to_string(models.join("nasty/EXPECT.tsv")).unwrap();
    let rows: Vec<_> = rows(&table, "img").into_iter().filter(|(file, _)| is_environment(file)).collect();
    assert!(rows.len() >= 7, "{} rows", rows.len());
    let outcome = |(file, expected): &(&str, &str)| {
        let path = models.join("nasty").join(file);
        disagreement(expected, &path, &environment(&path))
    };
    let wrong: Vec<String> = rows.iter().filter_map(outcome).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Every row is covered by one of the other tests.
#[test]
fn all_rows_are_covered() {
    let Some(models) = models("all_rows_are_covered") else { return };
    let table = fs::read_to_string(models.join("nasty/EXPECT.tsv")).unwrap();
    let n_rows = table.lines().filter(|line| !line.starts_with('#')).count() - 1;
    assert_eq!(["obj", "ply", "gltf", "img"].map(|folder| rows(&table, folder).len()).iter().sum::<usize>(), n_rows);
    let is_covered = |file: &str| [".png", ".jpg", ".hdr", ".exr", "/images.obj"].iter().any(|end| file.ends_with(end));
    assert!(rows(&table, "img").iter().all(|(file, _)| is_covered(file)));
}

/// Each image as the texture of a triangle.
#[test]
fn img() {
    let Some(models) = models("img") else { return };
    let table = fs::read_to_string(models.join("nasty/EXPECT.tsv")).unwrap();
    let rows: Vec<_> =
        rows(&table, "img").into_iter().filter(|(file, _)| file.ends_with(".png") || file.ends_with(".jpg")).collect();
    assert!(rows.len() >= 10, "{} rows", rows.len());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.obj");
    fs::write(&path, "mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let outcome = |(file, expected): &(&str, &str)| {
        let name = file.trim_start_matches("img/");
        fs::copy(models.join("nasty").join(file), folder.path().join(name)).unwrap();
        fs::write(folder.path().join("m.mtl"), format!("newmtl a\nmap_Kd {name}\n")).unwrap();
        disagreement(expected, &path, &scene(&path)).map(|difference| format!("{name}: {difference}"))
    };
    let wrong: Vec<String> = rows.iter().filter_map(outcome).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));

    let scene = read(&models.join("nasty/img/images.obj")).unwrap();
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
