//! Input files that are missing, empty, malformed, or state false counts.

use std::{
    fs,
    path::{Path, PathBuf},
};

use canted_fixtures::skip;

use crate::support::Folder;

#[test]
fn missing_and_empty_files_are_reported_by_name() {
    let folder = Folder::with_small();
    for name in ["empty.obj", "empty.ply", "empty.gltf", "empty.glb", "empty"] {
        folder.write(name, "");
    }
    for name in ["missing.obj", "missing.ply", "empty.obj", "empty.ply", "empty.gltf", "empty.glb", "empty", "."] {
        folder.run(&format!("stats {name}")).refused(&[name]);
        folder.run(&format!("render {name} -o out.png")).refused(&[name]);
        folder.run(&format!("tree {name} --codes codes.csv --nodes nodes.csv")).refused(&[name]);
        folder.run(&format!("compare {name} {name}")).refused(&[name]);
    }
    folder.run("cast small.obj --rays missing.csv --hits hits.csv").refused(&["missing.csv"]);
    assert!(!folder.names().iter().any(|name| name.starts_with("out") || name.ends_with(".csv")));
}

#[test]
fn false_counts_are_rejected_quickly() {
    let folder = Folder::new();
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\n\
                  property float z\nelement face 4000000000\nproperty list uchar int vertex_indices\nend_header\n";
    folder.write("huge.ply", header);
    folder.write("huge.glb", [b"glTF\x02\0\0\0".as_slice(), &[255; 8], b"JSON{}"].concat());
    folder.write("huge.png", b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\x7f\xff\xff\xff\x7f\xff\xff\xff\x08\x02\0\0\0");
    let start = std::time::Instant::now();
    folder.run("stats huge.ply").refused(&["huge.ply"]);
    folder.run("stats huge.glb").refused(&["huge.glb"]);
    folder.run("compare huge.png huge.png").refused(&["huge.png"]);
    assert!(start.elapsed().as_secs() < 10, "three files took {:?}", start.elapsed());
}

#[test]
fn warnings_go_to_standard_error_and_results_to_standard_output() {
    let folder = Folder::new();
    folder.write("nan.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nf 1 2 3\nf 1 2 4\n");
    let run = folder.run("stats nan.obj --json").done();
    assert_eq!(run.n_warnings(), 1, "{}", run.stderr);
    assert_eq!(run.json()["placed_triangles"], 1);
    assert!(!run.stdout.contains("warning"));
}

/// No camera position is representable outside such a scene, so it is seen from its edge.
#[test]
fn coordinates_near_the_largest_float_are_rendered() {
    let folder = Folder::new();
    folder.write("huge.obj", "v -3e38 0 0\nv 3e38 0 0\nv 0 3e38 -3e38\nf 1 2 3\n");
    let run = folder.run("render huge.obj -o out.png --size 8x8 --spp 1").done();
    assert_eq!(run.n_warnings(), 1, "{}", run.stderr);
}

/// A row of the table of malformed files.
struct Row {
    path: PathBuf,
    expected: String,
    code: i32,
}

/// Rows of `EXPECT.tsv` that are program inputs: models of the three formats, the OBJ file that refers to every image, and
/// environments.
fn table(folder: &Path) -> Vec<Row> {
    let table = fs::read_to_string(folder.join("EXPECT.tsv")).unwrap();
    let rows = table.lines().filter(|line| !line.starts_with('#')).skip(1);
    rows.map(|line| line.split('\t').collect::<Vec<_>>())
        .filter(|row| !row[0].starts_with("img/") || row[0].ends_with(".obj") || is_environment(Path::new(row[0])))
        .map(|mut row| {
            // Superseded: sound geometry is drawn without the attributes that are not.
            if row[0] == "obj/vt_index_out_of_range.obj" {
                (row[2], row[3]) = ("warn", "0");
            }
            row
        })
        .map(|row| Row { path: folder.join(row[0]), expected: row[2].to_owned(), code: row[3].parse().unwrap() })
        .collect()
}

fn is_environment(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "hdr" || ending == "exr")
}

#[test]
fn malformed_files_give_the_results_of_their_table() {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");
    let models = std::env::var_os("CANTED_SCENES").map_or_else(|| PathBuf::from(beside), PathBuf::from);
    let nasty = models.join("nasty");
    if !nasty.is_dir() {
        let reason = format_args!("there is no folder {}", nasty.display());
        skip::<()>("malformed_files_give_the_results_of_their_table", reason);
        return;
    }
    let folder = Folder::with_small();
    folder.write("rays.csv", "0,0,100,0,0,-1,inf\n");
    let rows = table(&nasty);
    assert!(rows.len() > 100, "the table has only {} rows", rows.len());
    let mut wrong = vec![];
    for Row { path, expected, code } in rows {
        let line = if is_environment(&path) {
            "render small.obj --size 8x8 --spp 1 -o env.png --env"
        } else {
            "cast --rays rays.csv --hits hits.csv"
        };
        let output = folder
            .command(line)
            .arg(&path)
            .output()
            .map(|output| (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned()));
        let (got, stderr) = output.unwrap();
        let n_warnings = stderr.lines().filter(|line| line.starts_with("warning: ")).count();
        let is_named = stderr.contains(path.file_name().unwrap().to_str().unwrap());
        let is_right = match expected.as_str() {
            "load" => n_warnings == 0,
            "warn" => n_warnings > 0,
            "error" => stderr.matches("error: ").count() == 1 && is_named,
            other => panic!("{}: no such expectation: {other}", path.display()),
        };
        if got != Some(code) || !is_right {
            wrong.push(format!("{}: {expected} with {code}, but {got:?}: {stderr}", path.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
