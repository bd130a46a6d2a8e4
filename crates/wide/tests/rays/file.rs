//! BVHs as bytes: what is written is read, what is damaged is rejected. Forged files are tested inside the crate.

use canted_fixtures::{self as fixtures, Mesh};
use canted_trace::{Counts, Intersect, TriangleTest};
use canted_wide::{LoadError, Preset, SimdPath, TriangleBvh};

use crate::common::{build, build_for, grazing_rays};

fn meshes() -> Vec<(&'static str, Mesh)> {
    vec![
        ("nothing", Mesh::default()),
        ("one", fixtures::soup(1, 1)),
        ("few", fixtures::soup(1, 5)),
        ("soup", fixtures::soup(2, 1_000)),
        ("slivers", fixtures::slivers(3, 500)),
        ("identical", fixtures::identical(300)),
        ("outlier", fixtures::outlier(200)),
        ("scaffold", fixtures::scaffold_of(1, true, 4)),
        ("rotated", fixtures::coplanar_quads(500).off_axis()),
        ("grid", fixtures::grid(5, [30, 20])),
    ]
}

#[test]
fn what_is_written_is_read_bit_for_bit() {
    for (name, mesh) in meshes() {
        let n_presets = if mesh.triangles.len() < 1_000 { 3 } else { 1 };
        for preset in [Preset::Balanced, Preset::Fast, Preset::Quality].into_iter().take(n_presets) {
            let wide = build(&mesh, preset);
            let bytes = wide.to_bytes();
            let back = TriangleBvh::from_bytes(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(back.to_bytes(), bytes, "{name}");
            assert_eq!(
                (back.aabb(), back.frame(), back.n_primitives()),
                (wide.aabb(), wide.frame(), wide.n_primitives())
            );
            assert_eq!((back.sizes(), back.predicted()), (wide.sizes(), wide.predicted()), "{name}");
            for path in SimdPath::ALL {
                let [wide, back] = [&wide, &back].map(|bvh| bvh.clone().with_path(path));
                for ray in grazing_rays(&mesh, 40, 3) {
                    // The same bvh: not only the same hits but the same way to them.
                    let [mut a, mut b] = [Counts::default(); 2];
                    let hit = wide.closest_hit_with(&ray, &mut a);
                    assert_eq!(back.closest_hit_with(&ray, &mut b), hit, "{name} {path:?}");
                    assert_eq!(a, b, "{name} {path:?}");
                }
            }
        }
    }
}

#[test]
fn a_file_can_be_read_for_any_triangle_test() {
    let mesh = fixtures::soup(2, 500);
    let wanted = build_for(TriangleTest::MollerTrumbore, &mesh, Preset::default());
    let bytes = build(&mesh, Preset::default()).to_bytes();
    let back = TriangleBvh::from_bytes_with(&bytes, TriangleTest::MollerTrumbore).unwrap();
    assert!(grazing_rays(&mesh, 40, 3).iter().all(|ray| back.closest_hit(ray) == wanted.closest_hit(ray)));
    // Without a choice it is that of the writer.
    assert_eq!(back.to_bytes(), wanted.to_bytes());
    let tests = [&bytes, &back.to_bytes()].map(|bytes| TriangleBvh::from_bytes(bytes).unwrap().test());
    assert_eq!(tests, [TriangleTest::Watertight, TriangleTest::MollerTrumbore]);
}

#[test]
fn truncated_files_are_rejected_by_length() {
    let bytes = build(&fixtures::soup(1, 20), Preset::Fast).to_bytes();
    for n in 0..bytes.len() {
        let error = TriangleBvh::from_bytes(&bytes[..n]).unwrap_err();
        assert!(matches!(error, LoadError::Length { n_bytes, .. } if n_bytes == n), "{n}: {error}");
    }
    let mut longer = bytes;
    longer.push(0);
    assert!(matches!(TriangleBvh::from_bytes(&longer), Err(LoadError::Length { .. })));
}

#[test]
fn every_changed_byte_is_detected() {
    let bytes = build(&fixtures::soup(1, 20), Preset::Fast).to_bytes();
    for i in 0..bytes.len() {
        for change in [1, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[i] ^= change;
            assert!(TriangleBvh::from_bytes(&damaged).is_err(), "byte {i}");
        }
    }
}

#[test]
fn other_files_and_other_versions_are_reported() {
    let bytes = build(&fixtures::soup(1, 20), Preset::Fast).to_bytes();
    let with = |at: usize, new: &[u8]| {
        let mut bytes = bytes.clone();
        bytes[at..at + new.len()].copy_from_slice(new);
        TriangleBvh::from_bytes(&bytes).unwrap_err()
    };
    assert_eq!(with(0, b"\x7fELF").to_string(), "not a BVH file: it begins with \"\\x7fELFWIDE\"");
    let text = TriangleBvh::from_bytes(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap_err();
    assert_eq!(text.to_string(), "not a BVH file: it begins with \"v 0 0 0\\n\"");
    assert_eq!(with(8, &[1]).to_string(), "unsupported format version 1; expected 7");
}

#[test]
fn a_wrong_checksum_is_reported_with_that_of_the_contents() {
    let mut bytes = build(&fixtures::soup(1, 20), Preset::Fast).to_bytes();
    let stored = bytes.last_chunk_mut().unwrap();
    let expected = u64::from_le_bytes(*stored);
    *stored = 7u64.to_le_bytes();
    assert_eq!(
        TriangleBvh::from_bytes(&bytes).unwrap_err().to_string(),
        format!("checksum mismatch: the file says 0x0000000000000007, its contents give {expected:#018x}")
    );
}

#[test]
fn huge_counts_are_rejected_before_anything_is_allocated() {
    let bytes = build(&fixtures::soup(1, 20), Preset::Fast).to_bytes();
    for at in [24, 32] {
        for count in [u64::MAX, u64::MAX / 64, 1 << 40] {
            let mut bytes = bytes.clone();
            bytes[at..at + 8].copy_from_slice(&count.to_le_bytes());
            assert!(matches!(TriangleBvh::from_bytes(&bytes), Err(LoadError::Length { .. })));
        }
    }
    // The number of triangles does not follow from the length: the checksum is corrected, by the definition of FNV-1a.
    let mut bytes = bytes;
    bytes[40..48].copy_from_slice(&(1_u64 << 40).to_le_bytes());
    let end = bytes.len() - 8;
    let mut sum = 0xcbf2_9ce4_8422_2325_u64;
    for &byte in &bytes[..end] {
        sum = (sum ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
    }
    bytes[end..].copy_from_slice(&sum.to_le_bytes());
    let error = TriangleBvh::from_bytes(&bytes).unwrap_err();
    assert_eq!(error, LoadError::Count { n_expected: 1 << 40, n_found: 20 });
}

/// Coordinates beyond 2^62 are built with finite boxes, and saved, up to the greatest; hits are not promised there.
#[test]
fn coordinates_of_any_size_are_saved() {
    for scale in [2.0_f32.powi(61), 2.0_f32.powi(64), 1e30, 0.5 * f32::MAX, f32::MAX] {
        for mesh in [fixtures::soup(4, 60), fixtures::coplanar_quads(30).off_axis()] {
            let [min, max] = mesh.bounds();
            let reach = min.iter().chain(&max).fold(0.0_f32, |most, x| most.max(x.abs()));
            let huge = mesh.placed(|p| p.map(|x| (x / reach).clamp(-1.0, 1.0) * scale));
            for preset in [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality] {
                let bytes = build(&huge, preset).to_bytes();
                let back = TriangleBvh::from_bytes(&bytes).unwrap_or_else(|error| panic!("{scale}: {error}"));
                assert_eq!(back.to_bytes(), bytes, "{scale} {preset:?}");
            }
        }
    }
}

/// A file of the test, removed on drop.
struct File(std::path::PathBuf);

impl File {
    fn of(name: &str, bytes: &[u8]) -> Self {
        let path = std::env::temp_dir().join(format!("canted-wide-{}-{name}.bvh", std::process::id()));
        std::fs::write(&path, bytes).unwrap();
        Self(path)
    }
}

impl Drop for File {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// From the start of a file, and behind 64 bytes of something else; where it is not aligned, it is copied.
#[test]
fn a_mapped_bvh_answers_as_the_one_that_was_written() {
    for (name, mesh) in meshes() {
        let bvh = build(&mesh, Preset::Balanced);
        let bytes = bvh.to_bytes();
        for first in [0, 64, 4] {
            let file = File::of(&format!("{name}-{first}"), &[vec![7; first], bytes.clone()].concat());
            let mut mapped = TriangleBvh::map_part(&file.0, first as u64, None).unwrap();
            assert_eq!(mapped.to_bytes(), bytes, "{name}");
            for ray in grazing_rays(&mesh, 20, 1) {
                assert_eq!(mapped.closest_hit(&ray), bvh.closest_hit(&ray), "{name} {ray:?}");
            }
            // A refit copies what it changes; the file stays as it is.
            mapped.refit(&mesh.positions, &mesh.triangles).unwrap();
            let moved: Vec<[f32; 3]> = mesh.positions.iter().map(|[x, y, z]| [x + 1.0, *y, *z]).collect();
            mapped.refit(&moved, &mesh.triangles).unwrap();
            drop(mapped);
            assert_eq!(TriangleBvh::map_part(&file.0, first as u64, None).unwrap().to_bytes(), bytes, "{name}");
        }
    }
}

#[test]
fn damaged_files_are_not_mapped() {
    let bytes = build(&fixtures::soup(2, 100), Preset::Balanced).to_bytes();
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 1;
    for (name, content, what) in [
        ("flipped", &flipped[..], "checksum mismatch"),
        ("short", &bytes[..bytes.len() - 1], "expected"),
        ("empty", &[], "0 bytes"),
        ("other", b"OFF\n3 1 0", "not a BVH file"),
    ] {
        let file = File::of(name, content);
        let error = TriangleBvh::map(&file.0).unwrap_err().to_string();
        assert!(error.contains(what), "{name}: {error}");
    }
    assert!(TriangleBvh::map("absent.bvh").is_err());
}
