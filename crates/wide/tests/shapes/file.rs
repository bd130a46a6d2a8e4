//! Files of shapes: what is written is read; what is damaged or forged is rejected or valid.

use canted_fixtures::SplitMix64;
use canted_obb::Aabb;
use canted_trace::{Counts, Hit, Intersect, Sphere};
use canted_wide::{LoadError, TriangleBvh, WideBvh};

use crate::agree::{configs, first_difference};
use crate::scenes::{boxes, capsules, rays, spheres, struts};
use crate::shape::{Capsule, loop_over_all};

#[test]
fn what_is_written_is_read() {
    for shapes in [vec![], struts(1), struts(300), capsules(200, 1e-6, 0.0)] {
        for (name, config) in configs() {
            let bvh = WideBvh::over_with(shapes.clone(), config).unwrap();
            let bytes = bvh.to_bytes();
            let back = WideBvh::<Capsule>::from_bytes(&bytes).unwrap();
            assert_eq!(back.to_bytes(), bytes, "{name}");
            assert_eq!(back.primitives(), shapes, "{name}");
            assert_eq!((back.sizes(), back.predicted(), back.aabb()), (bvh.sizes(), bvh.predicted(), bvh.aabb()));
            let rays = if shapes.is_empty() { vec![] } else { rays(&shapes, 100) };
            for ray in rays {
                let [mut a, mut b] = [Counts::default(); 2];
                let hit = bvh.closest_hit_with(&ray, &mut a);
                assert_eq!(back.closest_hit_with(&ray, &mut b), hit, "{name}");
                assert_eq!(a, b, "{name}");
            }
        }
    }
}

#[test]
fn spheres_and_boxes_are_saved_too() {
    let bvh = WideBvh::over(spheres(50, 1.0, 0.0)).unwrap();
    assert_eq!(WideBvh::<Sphere>::from_bytes(&bvh.to_bytes()).unwrap().primitives(), bvh.primitives());
    let bvh = WideBvh::over(boxes(50, 1.0, 0.0)).unwrap();
    assert_eq!(WideBvh::<Aabb>::from_bytes(&bvh.to_bytes()).unwrap().primitives(), bvh.primitives());
}

#[test]
fn files_of_other_primitives_are_rejected() {
    let capsules = WideBvh::over(struts(20)).unwrap().to_bytes();
    let error = WideBvh::<Sphere>::from_bytes(&capsules).unwrap_err();
    assert_eq!(error, LoadError::Primitives { found: [4, 28], expected: [4, 16] });
    assert!(matches!(TriangleBvh::from_bytes(&capsules), Err(LoadError::Primitives { .. })));
    let mesh = canted_fixtures::soup(1, 20);
    let triangles = TriangleBvh::build(&mesh.positions, &mesh.triangles);
    assert!(matches!(
        WideBvh::<Capsule>::from_bytes(&triangles.unwrap().to_bytes()),
        Err(LoadError::Primitives { .. })
    ));
}

#[test]
fn every_changed_byte_is_detected() {
    let bytes = WideBvh::over(struts(12)).unwrap().to_bytes();
    for i in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[i] ^= 0x40;
        assert!(WideBvh::<Capsule>::from_bytes(&damaged).is_err(), "byte {i}");
        assert!(WideBvh::<Capsule>::from_bytes(&bytes[..i]).is_err(), "{i} bytes");
    }
}

/// FNV-1a, as the format defines it.
fn sign(bytes: &mut [u8]) {
    let end = bytes.len() - 8;
    let sum = bytes[..end]
        .iter()
        .fold(0xcbf2_9ce4_8422_2325_u64, |sum, &byte| (sum ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    bytes[end..].copy_from_slice(&sum.to_le_bytes());
}

#[test]
fn mangled_files_with_correct_checksums_are_rejected_or_valid() {
    const SPECIAL: [u32; 6] = [0, u32::MAX, 0x7fff_ffff, 0x7fc0_0000, 0x7f80_0000, 0x8000_0000];
    let shapes = struts(40);
    let rays = rays(&shapes, 60);
    let bytes = WideBvh::over(shapes).unwrap().to_bytes();
    let n_words = (bytes.len() - 8) / 4;
    let mut rng = SplitMix64::new(2);
    let mut n_accepted = 0;
    for _ in 0..3_000 {
        let mut mangled = bytes.clone();
        for _ in 0..=rng.below(3) {
            let [at, other] = [(); 2].map(|()| 4 * rng.below(n_words));
            let word = |i: usize| u32::from_le_bytes(bytes[i..i + 4].try_into().unwrap());
            let new = match rng.below(4) {
                0 => word(at) ^ 1 << rng.below(32),
                1 => word(other),
                2 => SPECIAL[rng.below(6)],
                _ => word(at).wrapping_add(1),
            };
            mangled[at..at + 4].copy_from_slice(&new.to_le_bytes());
        }
        sign(&mut mangled);
        if let Ok(bvh) = WideBvh::<Capsule>::from_bytes(&mangled) {
            let wants: Vec<Vec<Hit>> = rays.iter().map(|ray| loop_over_all(bvh.primitives(), ray)).collect();
            assert_eq!(first_difference(&bvh, &rays, &wants), None);
            n_accepted += 1;
        }
    }
    assert!(n_accepted > 20, "{n_accepted} of 3,000 accepted");
}
