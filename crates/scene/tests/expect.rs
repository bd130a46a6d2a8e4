//! Malformed and unusual files do what the table `EXPECT.tsv` beside them says.

mod common;

use std::fs;
use std::path::Path;

use canted_scene::{ReadError, Scene, read};

/// What the table says of a file, and what the reader did with it; `None` where they agree.
fn disagreement(expected: &str, path: &Path, got: &Result<Scene, ReadError>) -> Option<String> {
    let file = path.file_name().unwrap().to_string_lossy();
    let got = match got {
        Ok(scene) if scene.warnings.is_empty() => "load".to_owned(),
        Ok(scene) => format!("warn {:?}", scene.warnings),
        Err(error) if error.to_string().contains(&*file) => format!("error {error}"),
        Err(error) => format!("an error that does not name the file: {error}"),
    };
    (got.split(' ').next() != Some(expected)).then(|| format!("{file}: {expected} expected, got {got}"))
}

/// Rows of the table whose file lies in `folder`: file and expected outcome.
fn rows<'a>(table: &'a str, folder: &str) -> Vec<(&'a str, &'a str)> {
    let columns = table.lines().filter(|line| !line.starts_with('#')).skip(1).map(|line| {
        let columns: Vec<&str> = line.split('\t').collect();
        (columns[0], columns[2])
    });
    columns.filter(|(file, _)| file.split('/').next() == Some(folder)).collect()
}

#[track_caller]
fn check(test: &str, folder: &str, n_rows_least: usize) {
    let Some(models) = common::models(test) else { return };
    let table = fs::read_to_string(models.join("nasty/EXPECT.tsv")).unwrap();
    let rows = rows(&table, folder);
    assert!(rows.len() >= n_rows_least, "{} rows", rows.len());
    let wrong: Vec<String> = rows
        .iter()
        .filter_map(|(file, expected)| {
            let path = models.join("nasty").join(file);
            disagreement(expected, &path, &read(&path))
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
