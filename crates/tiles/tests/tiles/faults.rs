//! Stores that are damaged: an error names the file, and no answer is wrong.

use std::fs;
use std::path::Path;

use canted_fixtures::{SplitMix64, soup};
use canted_tiles::{OpenOptions, TileError, TileErrorKind, TiledBvh};
use canted_trace::Intersect;

use crate::common::{rays, whole, write};

const AT_ONCE: OpenOptions = OpenOptions { memory: 1 << 30, check_up_to: u64::MAX, part: None };
const LATER: OpenOptions = OpenOptions { memory: 1 << 30, check_up_to: 0, part: None };

/// The error of opening, else that of a query that needs every tile.
fn error_of(store: &Path, options: OpenOptions) -> TileError {
    let bvh = match TiledBvh::open(store, options) {
        Ok(bvh) => bvh,
        Err(error) => return error,
    };
    let rays = rays(&soup(1, 300), 2_000);
    let error = bvh.try_closest_hits(&rays, &mut vec![None; rays.len()]).unwrap_err();
    // The check of all finds it, too.
    assert_eq!(bvh.check().unwrap_err().path(), error.path());
    error
}

fn with_store(change: impl FnOnce(&Path)) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &soup(1, 300), 7);
    change(folder.path());
    folder
}

/// What is done to a file.
type Change = Box<dyn Fn(&Path)>;

/// Damages a file in ways that the checks must find, when the store is opened or when the tile is read.
#[test]
fn a_damaged_tile_is_named() {
    for name in ["000003.bvh", "000003.numbers"] {
        for options in [AT_ONCE, LATER] {
            let changes: [(&str, Change); 5] = [
                ("the file of a tile is missing", Box::new(|path| fs::remove_file(path).unwrap())),
                (
                    "bytes, expected",
                    Box::new(|path| {
                        let bytes = fs::read(path).unwrap();
                        fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
                    }),
                ),
                ("bytes, expected", Box::new(|path| fs::write(path, []).unwrap())),
                (
                    "checksum mismatch",
                    Box::new(|path| {
                        let mut bytes = fs::read(path).unwrap();
                        let middle = bytes.len() / 2;
                        bytes[middle] ^= 4;
                        fs::write(path, bytes).unwrap();
                    }),
                ),
                (
                    "",
                    Box::new(|path| {
                        // The tile of another store.
                        let other = tempfile::tempdir().unwrap();
                        write(other.path(), &soup(2, 300), 7);
                        fs::copy(other.path().join(path.file_name().unwrap()), path).unwrap();
                    }),
                ),
            ];
            for (what, change) in changes {
                let store = with_store(|store| change(&store.join(name)));
                let error = error_of(store.path(), options);
                assert_eq!(error.kind(), TileErrorKind::Damaged, "{error}");
                assert_eq!(error.path(), Some(&*store.path().join(name)), "{error}");
                assert!(error.to_string().contains(what), "{error}");
                assert!(!error.to_string().contains('\n'));
            }
        }
    }
}

/// Single bits anywhere in the files of a store: an error, or the right answer.
#[test]
fn no_flipped_bit_changes_an_answer() {
    let (mesh, mut rng) = (soup(1, 300), SplitMix64::new(5));
    let (one, rays) = (whole(&mesh), rays(&mesh, 300));
    let mut want = vec![None; rays.len()];
    one.closest_hits(&rays, &mut want);
    let store = with_store(|_| ());
    let names: Vec<_> = fs::read_dir(store.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    let mut n_found = 0;
    for round in 0..200 {
        let path = &names[round % names.len()];
        let bytes = fs::read(path).unwrap();
        let mut changed = bytes.clone();
        let at = rng.below(bytes.len());
        changed[at] ^= 1 << rng.below(8);
        fs::write(path, &changed).unwrap();
        let mut hits = vec![None; rays.len()];
        match TiledBvh::open(store.path(), LATER).and_then(|bvh| bvh.try_closest_hits(&rays, &mut hits)) {
            Err(error) => {
                n_found += 1;
                assert!(error.path().is_some_and(|path| path.starts_with(store.path())), "{error}");
            }
            Ok(()) => assert_eq!(hits, want, "{}: byte {at}", path.display()),
        }
        fs::write(path, &bytes).unwrap();
    }
    assert!(n_found > 150, "{n_found}");
}

/// A tile that is held is compared with its files before rays are traced there.
#[test]
fn a_tile_that_is_written_while_the_store_is_open_is_named() {
    let mesh = soup(1, 300);
    let rays = rays(&mesh, 2_000);
    for (name, memory) in [("000003.bvh", 1 << 30), ("000003.numbers", 1 << 30), ("000003.bvh", 1)] {
        let store = with_store(|_| ());
        let (path, bvh) =
            (store.path().join(name), TiledBvh::open(store.path(), OpenOptions { memory, ..LATER }).unwrap());
        let (mut before, mut hits) = (vec![None; rays.len()], vec![None; rays.len()]);
        bvh.try_closest_hits(&rays, &mut before).unwrap();
        let bytes = fs::read(&path).unwrap();
        // Systems count time in ticks of some milliseconds.
        std::thread::sleep(std::time::Duration::from_millis(50));
        // The same content, under another name first: what is mapped stays as it is.
        fs::write(store.path().join("new"), &bytes).unwrap();
        fs::rename(store.path().join("new"), &path).unwrap();
        match bvh.try_closest_hits(&rays, &mut hits) {
            Err(error) => {
                assert!(memory > 1, "{error}");
                assert_eq!(error.path(), Some(&*store.path().join("000003.bvh")));
                assert!(error.to_string().contains("written while the store is open"), "{error}");
            }
            // A tile that was not held is checked again.
            Ok(()) => assert!(memory == 1 && hits == before),
        }
    }
}

#[test]
fn folders_that_are_no_store_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = |change: &dyn Fn(&Path)| {
        change(folder.path());
        TiledBvh::open(folder.path(), AT_ONCE).unwrap_err().to_string()
    };
    assert!(error(&|_| ()).ends_with("not a store of tiles: it has no manifest.json"));
    let manifest = folder.path().join("manifest.json");
    assert!(error(&|_| fs::write(&manifest, "{}").unwrap()).contains("not the manifest of a store of tiles"));
    let store = with_store(|_| ());
    let text = fs::read_to_string(store.path().join("manifest.json")).unwrap();
    for (from, to, what) in [
        ("\"version\": 1", "\"version\": 2", "unsupported version 2; expected 1"),
        ("\"triangles\": 300", "\"triangles\": 301", "checksum mismatch: the manifest is damaged"),
        ("000001.bvh", "../../etc/passwd", "checksum mismatch: the manifest is damaged"),
        ("\"canted tiles\"", "\"canted files\"", "format 'canted files'; expected 'canted tiles'"),
    ] {
        assert!(text.contains(from), "{from}");
        let found = error(&|_| fs::write(&manifest, text.replacen(from, to, 1)).unwrap());
        assert!(found.contains(what), "{found}");
    }
}

/// Without the pads of the bounds of tiles, or with a wrong order of tiles, answers would differ: the comparison finds a wrong number.
#[test]
fn a_wrong_number_is_found() {
    let mesh = soup(1, 300);
    let (one, rays) = (whole(&mesh), rays(&mesh, 300));
    let mut want = vec![None; rays.len()];
    one.closest_hits(&rays, &mut want);
    // A store of the same triangles in another order: every file is valid, the numbers are not those of the mesh.
    let mut other = mesh;
    other.triangles.reverse();
    let store = tempfile::tempdir().unwrap();
    write(store.path(), &other, 7);
    let mut hits = vec![None; rays.len()];
    TiledBvh::open(store.path(), AT_ONCE).unwrap().try_closest_hits(&rays, &mut hits).unwrap();
    assert_ne!(hits, want);
    assert!(hits.iter().zip(&want).all(|(a, b)| a.map(|hit| hit.t) == b.map(|hit| hit.t)));
}
