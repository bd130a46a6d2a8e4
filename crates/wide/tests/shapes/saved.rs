//! Files of shapes: what is written is read; what is damaged or forged is rejected or valid. Refits: results equal the loop over the moved
//! shapes.

use canted_fixtures::SplitMix64;
use canted_obb::{Aabb, PrimId};
use canted_trace::{Counts, Hit, Intersect, Sphere};
use canted_wide::{LoadError, PrimitiveError, RefitError, TriangleBvh, WideBvh};

use crate::agree::{configs, first_difference, paths};
use crate::shape::{Capsule, boxes, capsules, loop_over_all, rays, spheres, struts};

#[test]
fn what_is_written_is_read() {
    for shapes in [vec![], struts(1), struts(300), capsules(200, 1e-6, 0.0)] {
        for (name, config) in configs() {
            let bvh = WideBvh::over_with(shapes.clone(), config).unwrap();
            let bytes = bvh.to_bytes();
            let back = WideBvh::<Capsule>::from_bytes(&bytes).unwrap();
            assert_eq!(back.to_bytes(), bytes, "{name}");
            assert_eq!(back.primitives(), shapes.iter().collect::<Vec<_>>(), "{name}");
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
            let wants: Vec<Vec<Hit>> = rays.iter().map(|ray| loop_over_all(&bvh.primitives(), ray)).collect();
            assert_eq!(first_difference(&bvh, &rays, &wants), None);
            n_accepted += 1;
        }
    }
    assert!(n_accepted > 20, "{n_accepted} of 3,000 accepted");
}

fn moved(shapes: &[Capsule], size: f64, seed: u64) -> Vec<Capsule> {
    let mut rng = SplitMix64::new(seed);
    let mut step = |x: f32| (f64::from(x) + size * rng.signed()) as f32;
    shapes.iter().map(|shape| Capsule { ends: shape.ends.map(|end| end.map(&mut step)), ..*shape }).collect()
}

#[test]
fn hits_equal_the_loop_after_any_motion() {
    for shapes in [capsules(120, 1.0, 0.0), struts(200)] {
        for (name, config) in configs() {
            let mut bvh = WideBvh::over_with(shapes.clone(), config).unwrap();
            let flat = shapes.iter().map(|s| Capsule { ends: s.ends.map(|[x, y, _]| [x, y, -0.0]), radius: 0.0 });
            let motions = [moved(&shapes, 0.1, 1), moved(&shapes, 5.0, 2), flat.collect(), shapes.clone()];
            for shapes in motions {
                bvh.refit(shapes.clone()).unwrap();
                assert_eq!(bvh.primitives(), shapes.iter().collect::<Vec<_>>());
                let rays = rays(&shapes, 150);
                let wants: Vec<Vec<Hit>> = rays.iter().map(|ray| loop_over_all(&shapes, ray)).collect();
                for path in paths() {
                    let bvh = bvh.clone().with_path(path);
                    assert_eq!(first_difference(&bvh, &rays, &wants), None, "{name}");
                }
            }
        }
    }
}

#[test]
fn the_same_shapes_give_the_same_bvh() {
    let shapes = struts(500);
    for (name, config) in configs() {
        let mut bvh = WideBvh::over_with(shapes.clone(), config).unwrap();
        let records = |bvh: &WideBvh<Capsule>| bvh.to_bytes()[160..bvh.to_bytes().len() - 8].to_vec();
        let built = records(&bvh);
        let refit = bvh.refit(shapes.clone()).unwrap();
        assert_eq!((refit.drift, refit.cost_before), (1.0, refit.cost_built), "{name}");
        assert_eq!(records(&bvh), built, "{name}");
        let away = bvh.refit(moved(&shapes, 2.0, 3)).unwrap();
        assert!(away.drift > 1.0, "{name}: {}", away.drift);
        let back = bvh.refit(shapes.clone()).unwrap();
        assert_eq!((back.drift, back.cost_before), (1.0, away.cost_now), "{name}");
        assert_eq!(records(&bvh), built, "{name}");
    }
}

#[test]
fn a_bvh_that_is_not_refitted_is_detected() {
    let shapes = struts(200);
    let after = moved(&shapes, 0.5, 1);
    let bvh = WideBvh::over(shapes).unwrap();
    let rays = rays(&after, 150);
    let wants: Vec<Vec<Hit>> = rays.iter().map(|ray| loop_over_all(&after, ray)).collect();
    assert!(first_difference(&bvh, &rays, &wants).is_some());
}

#[test]
fn rejected_shapes_change_nothing() {
    let shapes = struts(50);
    let mut bvh = WideBvh::over(shapes.clone()).unwrap();
    let before = bvh.to_bytes();
    let mut bad = shapes.clone();
    bad[17].ends[1][2] = f32::NAN;
    let error = RefitError::Primitive(PrimitiveError::Bounds { primitive: PrimId(17) });
    assert_eq!(bvh.refit(bad), Err(error));
    assert_eq!(error.to_string(), "primitive 17 has bounds that are empty or not finite");
    assert_eq!(bvh.refit(shapes[1..].to_vec()), Err(RefitError::Count { n_primitives: 50, n_given: 49 }));
    assert_eq!(bvh.to_bytes(), before);
}
