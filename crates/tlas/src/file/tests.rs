use canted_bvh2::Bvh2Boxes;
use canted_lbvh::VolumeConfig;
use canted_trace::Ray;
use canted_wide::{LoadError, TriangleBvh};

use super::*;
use crate::InstanceError;

type Saved = Tlas<TriangleBvh>;

fn triangle(z: f32) -> TriangleBvh {
    let positions = [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
    TriangleBvh::build(&positions, &[[0, 1, 2]]).unwrap()
}

fn at(x: f32) -> Affine {
    let mut affine = Affine::IDENTITY;
    affine.columns[3][0] = x;
    affine
}

/// Two BVHs; a static, a moving and a masked instance.
fn tlas() -> Saved {
    let instances =
        [Instance::new(1, at(0.0)), Instance::moving(0, at(2.0), at(4.0)), Instance::new(0, at(-3.0)).with_mask(6)];
    Tlas::new(vec![triangle(0.0), triangle(-0.0)], &instances, TopConfig::default()).unwrap()
}

fn load(bytes: &[u8]) -> Result<Saved, TlasLoadError<LoadError>> {
    Tlas::from_bytes(bytes, TopConfig::default())
}

fn with_checksum(mut content: Vec<u8>) -> Vec<u8> {
    let sum = checksum(&content);
    content.extend(sum.to_le_bytes());
    content
}

#[test]
fn a_loaded_tlas_saves_the_same_bytes() {
    let bytes = tlas().to_bytes();
    for config in [TopConfig::default(), TopConfig::other(Bvh2Boxes::builder(VolumeConfig::default()))] {
        let loaded = Saved::from_bytes(&bytes, config.clone()).unwrap();
        assert_eq!((loaded.instances(), loaded.config()), (tlas().instances(), &config));
        assert_eq!(loaded.to_bytes(), bytes);
        for x in [0.2, 2.2, 4.2, -2.8, 9.0] {
            let ray = Ray::new([x, 0.2, 1.0], [0.0, 0.0, -1.0]);
            assert_eq!(loaded.closest_hit(&ray), tlas().closest_hit(&ray));
        }
    }
    let empty = Saved::new(vec![], &[], TopConfig::default()).unwrap().to_bytes();
    assert_eq!((empty.len(), load(&empty).unwrap().n_instances()), (HEADER_BYTES + CHECKSUM_BYTES, 0));
}

/// A byte changed at any position is found, and so is one lost or added.
#[test]
fn damage_is_reported() {
    let bytes = tlas().to_bytes();
    for position in 0..bytes.len() {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[position] ^= 1 << bit;
            assert!(load(&damaged).is_err(), "bit {bit} of byte {position}");
        }
        assert!(load(&bytes[..position]).is_err(), "{position} bytes");
    }
    assert!(load(&[&bytes[..], &[0]].concat()).is_err());
    let mut changed = bytes;
    let stored = changed.last_chunk_mut().unwrap();
    let expected = u64::from_le_bytes(*stored);
    *stored = 7u64.to_le_bytes();
    assert_eq!(
        load(&changed).map(|_| ()).unwrap_err().to_string(),
        format!("checksum mismatch: the file says 0x0000000000000007, its contents give {expected:#018x}")
    );
}

/// With a valid checksum, every change is either found or makes another valid TLAS; none panics.
#[test]
fn changed_bytes_with_a_valid_checksum_never_panic() {
    let bytes = tlas().to_bytes();
    let content = &bytes[..bytes.len() - CHECKSUM_BYTES];
    let mut n_loaded = 0;
    for position in 0..content.len() {
        for value in [0, 1, 0x7f, 0x80, 0xff] {
            let mut changed = content.to_vec();
            changed[position] = value;
            if let Ok(loaded) = load(&with_checksum(changed.clone())) {
                n_loaded += 1;
                let saved = loaded.to_bytes();
                assert_eq!(saved[..saved.len() - CHECKSUM_BYTES], changed, "{value} at {position}");
                let _ = loaded.closest_hit(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]));
            }
        }
        let _ = load(&with_checksum(content[..position].to_vec()));
    }
    assert!(n_loaded > 100, "{n_loaded}");
}

#[test]
fn each_flaw_has_its_error() {
    let content = {
        let bytes = tlas().to_bytes();
        bytes[..bytes.len() - CHECKSUM_BYTES].to_vec()
    };
    let changed = |position: usize, value: &[u8]| {
        let mut content = content.clone();
        content[position..position + value.len()].copy_from_slice(value);
        load(&with_checksum(content)).map(|_| ()).unwrap_err()
    };
    let [first, moves] = [HEADER_BYTES, HEADER_BYTES + 8];
    assert!(matches!(changed(0, b"X"), TlasLoadError::Magic { found } if found == *b"XANTTLAS"));
    assert!(matches!(changed(8, &[2]), TlasLoadError::Version { found: 2 }));
    assert!(matches!(changed(12, &[5]), TlasLoadError::Header { found: 5 }));
    assert!(matches!(changed(16, &[0xff; 8]), TlasLoadError::Length { .. }));
    assert!(matches!(changed(24, &[0xff; 8]), TlasLoadError::Length { .. }));
    assert!(matches!(changed(16, &[1]), TlasLoadError::Length { .. }));
    assert!(matches!(
        changed(first, &[9]),
        TlasLoadError::Instance(InstanceError::NoSuchBlas { instance: 0, blas: 9 })
    ));
    assert!(matches!(changed(moves, &[2]), TlasLoadError::Motion { instance: 0 }));
    assert!(matches!(changed(moves + INSTANCE_BYTES, &[0]), TlasLoadError::Motion { instance: 1 }));
    let nan = f32::NAN.to_le_bytes();
    assert!(matches!(changed(first + 12, &nan), TlasLoadError::Instance(InstanceError::NotFinite { instance: 0 })));
    let blas = HEADER_BYTES + 3 * INSTANCE_BYTES + 8;
    let error = changed(blas, b"X");
    assert!(matches!(error, TlasLoadError::Blas { blas: 0, error: LoadError::Magic { .. } }), "{error}");
    assert!(error.to_string().starts_with("bottom-level BVH 0: "), "{error}");
}
