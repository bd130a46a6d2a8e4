//! Changes of single shapes: results equal the loop over all shapes, boxes are those of a build, depth and memory stay bounded.

use std::fmt::Debug;

use canted_fixtures::SplitMix64;
use canted_obb::{Aabb, PrimId};
use canted_trace::{Counts, Intersect, Ray, Sphere};
use canted_wide::{Config, Costs, EditError, PrimitiveError, SavedPrimitive, WideBvh};

use crate::agree::{configs, first_difference, paths};
use crate::shape::{Capsule, boxes, capsules, loop_over_all, rays, spheres, struts};

/// Changes a BVH at random, and a list as its documentation says.
fn change<P: SavedPrimitive + Clone + PartialEq + Debug>(
    bvh: &mut WideBvh<P>,
    list: &mut Vec<P>,
    new: &P,
    rng: &mut SplitMix64,
) {
    let kind = if list.is_empty() { 0 } else { rng.below(4) };
    if kind == 0 {
        assert_eq!(bvh.insert(new.clone()), Ok(PrimId(list.len() as u32)));
        list.push(new.clone());
        return;
    }
    let i = rng.below(list.len());
    let id = PrimId(i as u32);
    if kind == 1 {
        assert_eq!(bvh.remove(id), Ok(list.swap_remove(i)));
    } else {
        let old = std::mem::replace(&mut list[i], new.clone());
        assert_eq!(bvh.move_one(id, new.clone()), Ok(old));
    }
}

/// The primitives in input order.
fn given<P: SavedPrimitive + Clone>(bvh: &WideBvh<P>) -> Vec<P> {
    bvh.primitives().into_iter().cloned().collect()
}

/// Rays hit what they hit in a loop; the file of the BVH passes all checks, which compare every box with that of a build.
fn check<P: SavedPrimitive + Clone + PartialEq + Debug>(bvh: &WideBvh<P>, list: &[P], what: &str) {
    assert_eq!(bvh.primitives(), list.iter().collect::<Vec<_>>(), "{what}");
    let rays = if list.is_empty() { vec![Ray::new([0.0; 3], [1.0; 3])] } else { rays(list, 40) };
    let wants: Vec<_> = rays.iter().map(|ray| loop_over_all(list, ray)).collect();
    assert_eq!(first_difference(bvh, &rays, &wants), None, "{what}");
    let loaded = WideBvh::<P>::from_bytes(&bvh.to_bytes()).unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_eq!(first_difference(&loaded, &rays, &wants), None, "{what}, loaded");
    let bounds = list.iter().fold(Aabb::EMPTY, |all, shape| all.union(shape.bounds()));
    assert_eq!(bvh.aabb(), bounds, "{what}");
}

fn edited<P: SavedPrimitive + Clone + PartialEq + Debug>(name: &str, shapes: &[P]) {
    for (config_name, config) in configs() {
        let mut rng = SplitMix64::new(shapes.len() as u64);
        let mut list = shapes[..shapes.len() / 2].to_vec();
        let mut bvh = WideBvh::over_with(list.clone(), config).unwrap();
        for round in 0..6 {
            for _ in 0..25 {
                let new = &shapes[rng.below(shapes.len())];
                change(&mut bvh, &mut list, new, &mut rng);
            }
            let what = format!("{name}, {config_name}, round {round}");
            check(&bvh, &list, &what);
            if round == 3 {
                let before = bvh.n_bytes();
                bvh.refit(list.clone()).unwrap();
                check(&bvh, &list, &format!("{what}, refitted"));
                assert!(bvh.n_bytes() < before, "{what}");
            }
        }
        let copy = bvh.clone();
        while !list.is_empty() {
            list.pop();
            bvh.remove(PrimId(list.len() as u32)).unwrap();
        }
        check(&bvh, &list, name);
        assert_eq!((bvh.sizes().depth, bvh.root()), (0, None));
        for new in shapes.iter().take(30) {
            change(&mut bvh, &mut list, new, &mut rng);
        }
        check(&bvh, &list, name);
        assert!(copy.n_primitives() > 20, "a copy stays as it was");
        check(&copy, &given(&copy), name);
    }
}

#[test]
fn changed_shapes_are_hit_as_by_the_loop() {
    edited("struts", &struts(300));
    edited("capsules", &capsules(120, 1e-6, 0.0));
    edited("distant capsules", &capsules(120, 1.0, 1e4));
    edited("spheres", &spheres(120, 1.0, 0.0));
    edited("boxes", &boxes(120, 1e6, 0.0));
}

#[test]
fn paths_agree_on_a_changed_bvh() {
    let shapes = struts(200);
    let (mut rng, mut list) = (SplitMix64::new(3), shapes[..100].to_vec());
    let mut bvh = WideBvh::over(list.clone()).unwrap();
    (0..200).for_each(|_| change(&mut bvh, &mut list, &shapes[rng.below(200)], &mut rng));
    let rays = rays(&list, 100);
    let wants: Vec<_> = rays.iter().map(|ray| loop_over_all(&list, ray)).collect();
    for path in paths() {
        bvh = bvh.with_path(path);
        assert_eq!(first_difference(&bvh, &rays, &wants), None, "{}", path.name());
    }
}

fn at(x: f32, y: f32) -> Sphere {
    Sphere { center: [x, y, 0.0], radius: 0.25 }
}

/// A new BVH with a sphere in each leaf, as edits make them: what differs is the hierarchy.
fn built_alike(shapes: &[Sphere]) -> WideBvh<Sphere> {
    let costs = Costs { max_leaf: 1, ..Costs::default() };
    WideBvh::over_with(shapes.to_vec(), Config { costs, ..Config::default() }).unwrap()
}

/// A path in which each node has one node below would be as long as the number of shapes over seven.
#[test]
fn depth_and_memory_are_bounded_whatever_the_order() {
    const N: u32 = 3000;
    let place = |i: u32| i as f32;
    // In a row, in one place, and away from it.
    let patterns: [&dyn Fn(u32) -> Sphere; 3] =
        [&|i| at(place(i), 0.0), &|_| at(1.0, 0.0), &|i| at(1.0 / place(i + 1), place(i % 2))];
    for (number, pattern) in patterns.into_iter().enumerate() {
        let mut bvh = WideBvh::over(vec![]).unwrap();
        let bound = |n: u32| n.max(1).ilog2() + 2;
        for i in 0..N {
            bvh.insert(pattern(i)).unwrap();
            assert!(bvh.sizes().depth <= bound(i + 1), "{number}, {i}: {}", bvh.sizes().depth);
        }
        let fresh = built_alike(&given(&bvh));
        let full = bvh.n_bytes();
        assert!(full < 6 * fresh.n_bytes(), "{number}: {full} instead of {}", fresh.n_bytes());
        // The window goes on: the oldest leaves as a new one comes.
        let mut ids: std::collections::VecDeque<u32> = (0..N).collect();
        for i in N..4 * N {
            let oldest = ids.pop_front().unwrap();
            bvh.remove(PrimId(oldest)).unwrap();
            // The last shape took its number.
            ids.iter_mut().filter(|id| **id == N - 1).for_each(|id| *id = oldest);
            ids.push_back(bvh.insert(pattern(i)).unwrap().0);
            assert!(bvh.sizes().depth <= bound(N), "{number}, {i}: {}", bvh.sizes().depth);
            assert!(bvh.n_bytes() <= 2 * full, "{number}, {i}: {} of {full}", bvh.n_bytes());
        }
        // The file holds what is used.
        let loaded = WideBvh::<Sphere>::from_bytes(&bvh.to_bytes()).unwrap();
        assert!(loaded.sizes().depth <= bvh.sizes().depth && loaded.n_bytes() < bvh.n_bytes());
        assert_eq!(loaded.primitives(), bvh.primitives());
    }
}

#[test]
fn drift_grows_with_disorder_and_advises_a_rebuild() {
    let mut bvh = WideBvh::over((0..1000_u16).map(|i| at(f32::from(i), 0.0)).collect()).unwrap();
    assert_eq!((bvh.drift(), bvh.rebuild_advised()), (1.0, false));
    bvh.move_one(PrimId(500), at(500.0, 0.125)).unwrap();
    assert!((bvh.drift() - 1.0).abs() < 0.1, "{}", bvh.drift());
    let built = bvh.drift();
    // There and back.
    bvh.move_one(PrimId(500), at(0.0, 1e6)).unwrap();
    bvh.move_one(PrimId(500), at(500.0, 0.125)).unwrap();
    assert!((bvh.drift() - built).abs() < 0.05, "{} after {built}", bvh.drift());
    // Neighbors that part find others: rays visit hardly more than in a new BVH.
    let mut rng = SplitMix64::new(9);
    for _ in 0..20 {
        for i in 0..1000 {
            let Sphere { center: [x, y, z], radius } = *bvh.primitives()[i];
            let [dx, dy, dz] = rng.signed3().map(|d| 20.0 * d as f32);
            bvh.move_one(PrimId(i as u32), Sphere { center: [x + dx, y + dy, z + dz], radius }).unwrap();
        }
    }
    let rebuilt = built_alike(&given(&bvh));
    let n_boxes = |bvh: &WideBvh<Sphere>| {
        let mut counts = Counts::default();
        for ray in rays(&given(bvh), 500) {
            bvh.closest_hit_with(&ray, &mut counts);
        }
        counts.boxes
    };
    let (moved, new) = (n_boxes(&bvh), n_boxes(&rebuilt));
    assert!(moved < 2 * new, "{moved} instead of {new}");
    // Shapes that all overlap.
    for i in 0..1000 {
        bvh.move_one(PrimId(i), Sphere { radius: 400.0, ..*bvh.primitives()[i as usize] }).unwrap();
    }
    assert!(bvh.rebuild_advised(), "{}", bvh.drift());
    let rebuilt = WideBvh::over(given(&bvh)).unwrap();
    assert!(!rebuilt.rebuild_advised());
}

#[test]
fn changes_that_are_invalid_are_rejected() {
    let mut bvh = WideBvh::over(struts(5)).unwrap();
    let bytes = bvh.to_bytes();
    let [good, mut bad] = [struts(6)[5]; 2];
    bad.ends[0][1] = f32::NAN;
    let missing = EditError::NoSuchPrimitive { primitive: PrimId(5), n_primitives: 5 };
    assert_eq!(bvh.remove(PrimId(5)), Err(missing));
    assert_eq!(bvh.move_one(PrimId(5), good), Err(missing));
    assert_eq!(missing.to_string(), "there is no primitive 5: the BVH has 5 primitives");
    assert_eq!(bvh.insert(bad), Err(PrimitiveError::Bounds { primitive: PrimId(5) }));
    let invalid = EditError::Primitive(PrimitiveError::Bounds { primitive: PrimId(2) });
    assert_eq!(bvh.move_one(PrimId(2), bad), Err(invalid));
    assert_eq!(invalid.to_string(), "primitive 2 has bounds that are empty or not finite");
    assert_eq!(bvh.to_bytes(), bytes);
    assert_eq!(WideBvh::<Capsule>::over(vec![]).unwrap().remove(PrimId(0)).map(drop), {
        Err(EditError::NoSuchPrimitive { primitive: PrimId(0), n_primitives: 0 })
    });
}
