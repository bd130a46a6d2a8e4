//! No file makes a reader take memory out of proportion to its size, nor a real scene much more than it holds in the end.
//! In the first promise images, whose texels are many a byte, are not covered.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use canted_scene::{ReadError, Scene, SceneStats, read};

/// The system's allocator, with the bytes in use and their peak.
struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator with its arguments unchanged; counting touches no memory of others.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let in_use = IN_USE.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        PEAK.fetch_max(in_use, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What reading a file gives, and the peak of bytes that it adds to what was in use.
fn peak_bytes(path: &Path) -> (Result<Scene, ReadError>, usize) {
    let before = IN_USE.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let scene = read(path);
    (scene, PEAK.load(Ordering::Relaxed) - before)
}

/// Bytes of memory for a byte of file.
///
/// The worst is an OBJ of one polygon, ` 1` for each corner: two bytes become a corner (12 bytes), a position (12), a
/// projected point (16), two links (16), a triangle of numbers (24), of corners (36) and of indices (12), with what
/// doubling vectors leave free.
const MAX_RATIO: usize = 128;

/// What a file of no bytes may take: paths, messages, threads' buffers.
const MAX_FIXED_BYTES: usize = 1 << 20;

fn assert_bounded(path: &Path) {
    let file_bytes = usize::try_from(fs::metadata(path).unwrap().len()).unwrap();
    let (_, peak) = peak_bytes(path);
    assert!(peak <= MAX_FIXED_BYTES + MAX_RATIO * file_bytes, "{}: {peak} for {file_bytes} bytes", path.display());
}

/// Peak of memory while a scene is read, over what it holds in the end: geometry and texels. The file itself is among it.
const MAX_OVER_DECODED: usize = 3;

fn assert_lean(path: &Path) {
    let (scene, peak) = peak_bytes(path);
    let scene = scene.unwrap();
    let counts = SceneStats::of(&scene);
    let decoded = counts.geometry_bytes + counts.texture_bytes;
    assert!(peak <= MAX_OVER_DECODED * decoded, "{}: {peak} for {decoded} decoded bytes", path.display());
}

/// One test: the counters are those of the whole process.
#[test]
fn memory_is_in_proportion_to_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let header = |vertices: u64, faces: u64| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
             property float z\nelement face {faces}\nproperty list uint int vertex_indices\nend_header\n"
        )
    };
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let n = 100_000;
    for (name, bytes) in [
        ("vertices.ply", header(u64::MAX, 1).into_bytes()),
        ("faces.ply", [header(0, u64::MAX).as_bytes(), &[0; 64]].concat()),
        ("list.ply", [header(1, 1).as_bytes(), &[0; 12], &[0xff; 8]].concat()),
        ("lists.ply", [header(0, n as u64).as_bytes(), &vec![0; 4 * n]].concat()),
        ("polygon.obj", format!("{square}f{}", " 1 2 3 4".repeat(n)).into_bytes()),
        ("faces.obj", format!("{square}{}", "f 1 2 3\n".repeat(n)).into_bytes()),
        ("index.obj", format!("{square}f 1 2 4294967295").into_bytes()),
        (
            "groups.obj",
            square
                .to_owned()
                .into_bytes()
                .into_iter()
                .chain((0..n).flat_map(|k| format!("g {k}\nf 1 2 3\n").into_bytes()))
                .collect(),
        ),
        (
            "materials.obj",
            square
                .to_owned()
                .into_bytes()
                .into_iter()
                .chain((0..n).flat_map(|k| format!("usemtl {k}\nf 1 2 3\n").into_bytes()))
                .collect(),
        ),
        ("word.obj", format!("v {}", "1".repeat(n)).into_bytes()),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        assert_bounded(&path);
    }
    let Some(models) = common::models("memory_is_in_proportion_to_the_file") else { return };
    for kind in ["obj", "ply"] {
        for entry in fs::read_dir(models.join("nasty").join(kind)).unwrap() {
            assert_bounded(&entry.unwrap().path());
        }
    }
    for file in ["kitchen/country_kitchen.glb", "sponza/sponza.gltf", "stanford/dragon_871k.glb"] {
        assert_lean(&models.join(file));
    }
}
