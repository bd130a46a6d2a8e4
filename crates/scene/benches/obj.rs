//! Reading OBJ, compared with `tobj`. Ours also welds corners, finds copies of meshes and checks every triangle.

use std::fmt::Write;

use criterion::{Criterion, criterion_group, criterion_main};
use tobj::LoadOptions;

fn readers(criterion: &mut Criterion) {
    let mesh = canted_fixtures::grid(5, [200, 200]);
    let mut text = String::new();
    for [x, y, z] in &mesh.positions {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    for [a, b, c] in mesh.triangles.iter().map(|triangle| triangle.map(|index| index + 1)) {
        let _ = writeln!(text, "f {a} {b} {c}");
    }
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let path = folder.path().join("grid.obj");
    std::fs::write(&path, text).expect("a writable folder");
    let n = mesh.triangles.len();
    criterion.bench_function(&format!("obj/grid/{n}"), |b| b.iter(|| canted_scene::read(&path)));
    let options = LoadOptions { triangulate: true, single_index: true, ..LoadOptions::default() };
    criterion.bench_function(&format!("tobj/grid/{n}"), |b| b.iter(|| tobj::load_obj(&path, &options)));
}

criterion_group!(benches, readers);
criterion_main!(benches);
