//! What a writer leaves: a complete store, or a folder to go on with.

use std::fs;
use std::path::{Path, PathBuf};

use canted_fixtures::soup;
use canted_tiles::{TileError, TileErrorKind, TileWriter, WriteOptions, Written, is_store};

use crate::common::{corners, open, whole, write};

fn options(tile_triangles: usize) -> WriteOptions {
    WriteOptions { tile_triangles, ..WriteOptions::default() }
}

fn partial(store: &Path) -> PathBuf {
    store.with_file_name("store.partial")
}

/// Names and contents of the files of a folder.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entry = |entry: fs::DirEntry| (entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap());
    let mut all: Vec<_> = fs::read_dir(folder).unwrap().map(|found| entry(found.unwrap())).collect();
    all.sort();
    all
}

/// What the caller subtracted, exactly, and whether it chose that; a manifest that does not say the latter is one that did not.
#[test]
fn the_origin_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let store = folder.path().join("store");
    for (origin, is_near) in [([0.0; 3], false), ([4e6 + 0.3, -1.0 / 3.0, 5e-324], true)] {
        let mut writer = TileWriter::create(&store, WriteOptions { origin, is_near, ..options(1 << 10) }).unwrap();
        writer.push(&corners(&soup(1, 100))).unwrap();
        writer.finish(&mut |_| ()).unwrap();
        let tiled = open(&store, 1 << 30);
        assert_eq!((tiled.origin(), tiled.is_near()), (origin, is_near));
        let manifest = fs::read_to_string(store.join("manifest.json")).unwrap();
        assert_eq!(manifest.contains("is_near"), is_near);
    }
}

/// Every triangle is in one tile, whatever the memory: with little, parts are divided on disk first.
#[test]
fn triangles_are_neither_lost_nor_doubled() {
    for (name, mesh, memory) in [
        ("in memory", soup(1, 5_000), 1 << 30),
        ("on disk", soup(1, 40_000), 160_000),
        ("equal centroids on disk", canted_fixtures::equal_centroids(10_000), 160_000),
        ("one far away", canted_fixtures::outlier(20_000), 160_000),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let store = folder.path().join("store");
        let mut writer =
            TileWriter::create(&store, WriteOptions { tile_triangles: 100, memory, ..WriteOptions::default() })
                .unwrap();
        corners(&mesh).chunks(999).for_each(|part| writer.push(part).unwrap());
        let written = writer.finish(&mut |_| ()).unwrap();
        let files = contents(&store);
        let mut numbers: Vec<u32> = vec![];
        for (_, bytes) in files.iter().filter(|(name, _)| name.ends_with(".numbers")) {
            let own = bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word));
            assert!(own.len() <= 100, "{name}");
            numbers.extend(own);
        }
        numbers.sort_unstable();
        assert!(numbers.iter().copied().eq(0..mesh.triangles.len() as u32), "{name}");
        assert_eq!(files.len(), 2 * written.tiles + 1, "{name}");
        // Few more tiles than are needed.
        assert!(written.tiles <= 3 * mesh.triangles.len().div_ceil(100), "{name}: {written:?}");
        let (tiled, one) = (open(&store, 1 << 30), whole(&mesh));
        for ray in crate::common::rays(&mesh, 50) {
            assert_eq!(
                canted_trace::Intersect::closest_hit(&tiled, &ray),
                canted_trace::Intersect::closest_hit(&one, &ray)
            );
        }
    }
}

/// Writes until `n` tiles are finished, then stops as if killed.
fn killed_after(store: &Path, mesh: &canted_fixtures::Mesh, tile: usize, n: usize) {
    let mut writer = TileWriter::create(store, options(tile)).unwrap();
    writer.push(&corners(mesh)).unwrap();
    let mut n_done = 0;
    let stopped = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        writer.finish(&mut |_| {
            n_done += 1;
            // The first call is that of the start.
            if n_done > n {
                std::panic::resume_unwind(Box::new("killed"));
            }
        })
    }));
    assert!(stopped.is_err());
}

fn go_on(store: &Path, mesh: &canted_fixtures::Mesh, tile: usize) -> Written {
    let mut writer = TileWriter::create(store, options(tile)).unwrap();
    writer.push(&corners(mesh)).unwrap();
    writer.finish(&mut |_| ()).unwrap()
}

#[test]
fn a_killed_writer_is_continued() {
    let mesh = soup(3, 640);
    let folder = tempfile::tempdir().unwrap();
    let (store, complete) = (folder.path().join("store"), folder.path().join("complete"));
    go_on(&complete, &mesh, 10);
    killed_after(&store, &mesh, 10, 20);
    assert!(!store.exists() && !is_store(&partial(&store)));
    // A tile that was damaged since, and a last line that was cut off.
    fs::write(partial(&store).join("000015.bvh"), b"other").unwrap();
    let journal = partial(&store).join("finished");
    let text = fs::read_to_string(&journal).unwrap();
    fs::write(&journal, &text[..text.len() - 9]).unwrap();
    let written = go_on(&store, &mesh, 10);
    assert_eq!((written.tiles, written.resumed), (64, 15));
    assert!(!partial(&store).exists());
    assert_eq!(contents(&store), contents(&complete));
    // Other triangles or other options start from the beginning.
    for (mesh, tile) in [(soup(4, 640), 10), (soup(3, 640), 11)] {
        let store = folder.path().join(format!("other-{tile}"));
        killed_after(&store, &soup(3, 640), 10, 20);
        assert_eq!(go_on(&store, &mesh, tile).resumed, 0);
    }
}

#[test]
fn a_store_replaces_a_store_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let store = folder.path().join("store");
    fs::create_dir(&store).unwrap();
    write(&store, &soup(1, 10), 2);
    let written = write(&store, &soup(2, 30), 3);
    assert_eq!(open(&store, 0).n_primitives(), written.triangles);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    let other = folder.path().join("other");
    fs::create_dir(&other).unwrap();
    fs::write(other.join("letter.txt"), "dear").unwrap();
    let error = TileWriter::create(&other, options(9)).unwrap_err();
    assert_eq!(
        error.to_string(),
        format!("{}: the folder exists and is not a store of tiles; use another name", other.display())
    );
    let file = folder.path().join("file");
    fs::write(&file, "text").unwrap();
    let error = TileWriter::create(&file, options(9)).unwrap_err();
    assert_eq!(error.to_string(), format!("{}: it exists and is not a folder", file.display()));
    // A second writer waits for nobody.
    let _first = TileWriter::create(&store, options(9)).unwrap();
    let error = TileWriter::create(&store, options(9)).unwrap_err();
    assert!(error.to_string().ends_with("store.partial: another process writes this store"), "{error}");
}

#[test]
fn invalid_input_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let store = folder.path().join("store");
    let of = |options| TileWriter::create(&store, options).unwrap_err().to_string();
    assert_eq!(of(options(0)), "a tile of 0 triangles is not supported; use 1 to 134217728");
    let little = WriteOptions { memory: 1 << 20, ..WriteOptions::default() };
    assert_eq!(
        of(little),
        "tiles of 262144 triangles take about 320 MiB of memory to build, 1 MiB are allowed; use tiles of at most 819 triangles"
    );
    let mut writer = TileWriter::create(&store, options(10)).unwrap();
    writer.push(&corners(&soup(1, 5))).unwrap();
    let error: TileError = writer.push(&[[[0.0; 3]; 3], [[0.0, f32::NAN, 0.0]; 3]]).unwrap_err();
    assert_eq!(
        (error.kind(), &*error.to_string()),
        (TileErrorKind::Input, "triangle 6 has a vertex that is not finite")
    );
    let error = writer.place(1, canted_obb::Affine::IDENTITY, &[[0, 0]]).unwrap_err();
    assert_eq!(error.to_string(), "mesh 1 of 0 is placed");
}
