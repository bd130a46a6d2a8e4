//! Memory of a reader is bounded by the file size, and for real scenes by the size of the scene. The first bound does not
//! cover images, which have many texels per byte.

use std::alloc::{GlobalAlloc, Layout, System};
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use canted_fixtures::models;
use canted_scene::{Mesh, ReadError, Scene, read};

/// The system allocator with counters of bytes in use and their peak.
struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is forwarded to the system allocator with unchanged arguments.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let in_use = IN_USE.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        PEAK.fetch_max(in_use, Ordering::Relaxed);
        // SAFETY: the caller upholds the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller upholds the contract of `dealloc`.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The result of reading a file, and the peak of additional bytes in use.
fn peak_bytes(path: &Path) -> (Result<Scene, ReadError>, usize) {
    let before = IN_USE.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let scene = read(path);
    (scene, PEAK.load(Ordering::Relaxed) - before)
}

/// Largest number of bytes of memory per byte of file.
///
/// The worst case is an OBJ with one polygon and ` 1` per corner: two bytes become a corner (12 bytes), a position (12), a
/// projected point (16), two links (16), and a triangle of numbers (24), of corners (36) and of indices (12), plus unused
/// capacity of growing vectors.
const MAX_RATIO: usize = 128;

/// Memory independent of the file size: paths, messages, thread buffers.
const MAX_FIXED_BYTES: usize = 1 << 20;

fn assert_bounded(path: &Path) {
    let file_bytes = usize::try_from(fs::metadata(path).unwrap().len()).unwrap();
    let (_, peak) = peak_bytes(path);
    assert!(peak <= MAX_FIXED_BYTES + MAX_RATIO * file_bytes, "{}: {peak} for {file_bytes} bytes", path.display());
}

/// Largest ratio of peak memory, including the file, to the memory of the finished scene.
const MAX_OVER_DECODED: usize = 3;

/// Whether a mesh has normals, tangents, both texture coordinates and colors.
fn lists(mesh: &Mesh) -> [bool; 5] {
    let Mesh { normals, tangents, uvs, second_uvs, colors, .. } = mesh;
    [normals.is_some(), tangents.is_some(), uvs.is_some(), second_uvs.is_some(), colors.is_some()]
}

fn assert_bounded_by_scene(path: &Path) {
    let (scene, peak) = peak_bytes(path);
    let scene = scene.unwrap();
    // At most the bytes of the finished scene: vertices, indices and texels.
    let of_mesh = |mesh: &Mesh| {
        let n_numbers =
            3 + [3, 4, 2, 2, 4].into_iter().zip(lists(mesh)).map(|(n, has)| if has { n } else { 0 }).sum::<usize>();
        4 * (n_numbers * mesh.positions.len() + 3 * mesh.triangles.len())
    };
    let decoded = scene.meshes.iter().map(of_mesh).sum::<usize>()
        + scene.textures.iter().map(|texture| 4 * texture.texels.len()).sum::<usize>();
    assert!(peak <= MAX_OVER_DECODED * decoded, "{}: {peak} for {decoded} decoded bytes", path.display());
}

/// A single test, because the counters are global.
#[test]
fn memory_is_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let header = |vertices: u64, faces: u64| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
             property float z\nelement face {faces}\nproperty list uint int vertex_indices\nend_header\n"
        )
    };
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let n = 100_000;
    let each =
        |line: &dyn Fn(usize) -> String| (square.to_owned() + &(0..n).map(line).collect::<String>()).into_bytes();
    for (name, bytes) in [
        ("vertices.ply", header(u64::MAX, 1).into_bytes()),
        ("faces.ply", [header(0, u64::MAX).as_bytes(), &[0; 64]].concat()),
        ("list.ply", [header(1, 1).as_bytes(), &[0; 12], &[0xff; 8]].concat()),
        ("lists.ply", [header(0, n as u64).as_bytes(), &vec![0; 4 * n]].concat()),
        ("polygon.obj", format!("{square}f{}", " 1 2 3 4".repeat(n)).into_bytes()),
        ("faces.obj", format!("{square}{}", "f 1 2 3\n".repeat(n)).into_bytes()),
        ("index.obj", format!("{square}f 1 2 4294967295").into_bytes()),
        ("groups.obj", each(&|k| format!("g {k}\nf 1 2 3\n"))),
        ("materials.obj", each(&|k| format!("usemtl {k}\nf 1 2 3\n"))),
        ("word.obj", format!("v {}", "1".repeat(n)).into_bytes()),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        assert_bounded(&path);
    }
    let Some(models) = models("memory_is_bounded") else { return };
    for kind in ["obj", "ply"] {
        for entry in fs::read_dir(models.join("nasty").join(kind)).unwrap() {
            assert_bounded(&entry.unwrap().path());
        }
    }
    for file in ["kitchen/country_kitchen.glb", "sponza/sponza.gltf", "stanford/dragon_871k.glb"] {
        assert_bounded_by_scene(&models.join(file));
    }
}
