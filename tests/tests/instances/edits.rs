//! A changed TLAS gives the hits of a new one and touches only what a change concerns; invalid instances are reported with their index.

use std::panic::{AssertUnwindSafe, catch_unwind};

use canted_bvh2::Bvh2;
use canted_fixtures::{Mesh, Rotation, SplitMix64, soup, torus};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::Affine;
use canted_tlas::{Instance, InstanceError, MAX_CONDITION, Tlas, TopConfig};
use canted_trace::{Hit, InstanceId, Intersect, Ray};
use canted_wide::TriangleBvh;

use super::setup::{Altered, affine, all_rays, binary_top, build, crowd, instances, meshes};

fn tops() -> [TopConfig; 3] {
    let binary = |strategy| binary_top(VolumeConfig { strategy, fallback: true });
    [TopConfig::default(), binary(Strategy::Aabb), binary(Strategy::Dop)]
}

fn bvh(mesh: &Mesh) -> TriangleBvh {
    TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap()
}

fn random_affine(rng: &mut SplitMix64) -> Affine {
    let turn = Rotation::euler(6.0 * rng.unit(), 6.0 * rng.unit(), 6.0 * rng.unit());
    let shift = rng.signed3().map(|x| (8.0 * x) as f32);
    affine(&turn, std::array::from_fn(|_| 0.2 + rng.unit()), shift)
}

/// Every hit of every ray.
fn hits(tlas: &dyn Intersect, rays: &[Ray]) -> Vec<(Option<Hit>, bool, Vec<Hit>)> {
    let mut all = vec![];
    let mut ask = |ray| {
        tlas.all_hits(ray, &mut all);
        (tlas.closest_hit(ray), tlas.occluded(ray), all.clone())
    };
    rays.iter().map(&mut ask).collect()
}

#[test]
fn edits_equal_a_new_tlas() {
    for top in tops() {
        let mut rng = SplitMix64::new(17);
        let [soup, torus] = meshes();
        let mut placed = instances(&crowd());
        let mut blas = vec![bvh(&soup), bvh(&torus)];
        let mut tlas = Tlas::new(blas.clone(), &placed, top.clone()).unwrap();
        let (mut before, mut n_changed) = (vec![], 0);
        for round in 0..12 {
            let mut edit = tlas.edit();
            for _ in 0..=rng.below(4) {
                let i = u32::try_from(rng.below(placed.len())).unwrap();
                match rng.below(5) {
                    0 | 1 => {
                        let moved = random_affine(&mut rng);
                        placed[i as usize] =
                            Instance { mask: placed[i as usize].mask, ..Instance::new(placed[i as usize].blas, moved) };
                        edit.set_transform(InstanceId(i), moved).unwrap();
                    }
                    2 => {
                        placed[i as usize].mask ^= 1;
                        edit.set_mask(InstanceId(i), placed[i as usize].mask).unwrap();
                    }
                    3 => {
                        let open = placed[i as usize].world_from_object;
                        let mut close = open;
                        close.columns[3][1] += 1.0;
                        placed[i as usize] = Instance::moving(u32::from(rng.below(2) == 0), open, close);
                        edit.set_instance(InstanceId(i), placed[i as usize]).unwrap();
                    }
                    _ => {
                        let scale = 0.5 + rng.unit() as f32;
                        let positions: Vec<_> = torus.positions.iter().map(|p| p.map(|x| x * scale)).collect();
                        blas[1] = blas[1].clone();
                        blas[1].refit(&positions, &torus.triangles).unwrap();
                        edit.update_blas(1, |bvh| bvh.refit(&positions, &torus.triangles)).unwrap().unwrap();
                    }
                }
            }
            if round % 3 == 0 {
                edit.rebuild();
                assert_eq!((tlas.drift(), tlas.rebuild_advised()), (1.0, false));
            } else if round % 3 == 1 {
                edit.refit();
            } else {
                drop(edit);
            }
            let transforms: Vec<Affine> = placed.iter().map(|instance| instance.world_from_object).collect();
            let rays = all_rays(&transforms, 2);
            let fresh = Tlas::new(blas.clone(), &placed, top.clone()).unwrap();
            assert_eq!(tlas.instances(), placed);
            assert_eq!(tlas.aabb().union(fresh.aabb()), tlas.aabb());
            let found = hits(&tlas, &rays);
            assert!(found == hits(&fresh, &rays), "{top:?}, round {round}");
            n_changed += usize::from(found != before);
            before = found;
        }
        assert!(n_changed > 10, "{n_changed}");
    }
}

#[test]
fn single_changes_update_the_top_level() {
    let plate = |z: f32| {
        let positions = vec![[-1.0, -1.0, z], [3.0, -1.0, z], [-1.0, 3.0, z]];
        bvh(&Mesh { positions, triangles: vec![[0, 1, 2]] })
    };
    let at = |z: f32| affine(&Rotation::IDENTITY, [1.0; 3], [0.0, 0.0, z]);
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    for top in tops() {
        let mut tlas = Tlas::new(vec![plate(0.0)], &[5.0, 7.0].map(|z| Instance::new(0, at(z))), top.clone()).unwrap();
        let hit = |tlas: &Tlas<_>| tlas.closest_hit(&ray).map(|hit| (hit.t, hit.instance.0));
        assert_eq!(hit(&tlas), Some((5.0, 0)));
        tlas.set_transform(InstanceId(1), at(100.0)).unwrap();
        tlas.set_transform(InstanceId(0), at(200.0)).unwrap();
        assert_eq!(hit(&tlas), Some((100.0, 1)));
        let old = tlas.replace_blas(0, plate(1000.0)).unwrap();
        assert_eq!((hit(&tlas), old.aabb().max[2]), (Some((1100.0, 1)), 0.0));
        tlas.update_blas(0, |bvh| *bvh = plate(2.0)).unwrap();
        assert_eq!(hit(&tlas), Some((102.0, 1)));
        tlas.rebuild();
        assert_eq!(hit(&tlas), Some((102.0, 1)));
    }
}

#[test]
fn drift_advises_a_rebuild() {
    for top in tops() {
        let mut rng = SplitMix64::new(5);
        let near = |i: usize| affine(&Rotation::IDENTITY, [0.3; 3], [i as f32, 0.0, 0.0]);
        let placed: Vec<Instance> = (0..200).map(|i| Instance::new(0, near(i))).collect();
        let mut tlas = Tlas::new(vec![bvh(&torus(10, 6))], &placed, top.clone()).unwrap();
        assert_eq!((tlas.drift(), tlas.rebuild_advised()), (1.0, false));
        tlas.set_transform(InstanceId(3), affine(&Rotation::IDENTITY, [0.3; 3], [3.0, 0.1, 0.0])).unwrap();
        assert!(!tlas.rebuild_advised(), "{}", tlas.drift());
        let mut edit = tlas.edit();
        for i in 0..200 {
            let shift = rng.signed3().map(|x| (100.0 * x) as f32);
            edit.set_transform(InstanceId(i), affine(&Rotation::IDENTITY, [0.3; 3], shift)).unwrap();
        }
        edit.refit();
        assert!(tlas.rebuild_advised(), "{}", tlas.drift());
        tlas.rebuild();
        assert_eq!((tlas.drift(), tlas.rebuild_advised()), (1.0, false));
    }
}

#[test]
fn a_change_reads_the_bounds_of_no_other_bvh() {
    let counted = |mesh: &Mesh| Altered::unchanged(bvh(mesh));
    let [soup, torus] = meshes();
    let mut tlas =
        Tlas::new(vec![counted(&soup), counted(&torus)], &instances(&crowd()), TopConfig::default()).unwrap();
    let n_reads = |tlas: &Tlas<Altered<TriangleBvh>>| [0, 1].map(|i| tlas.blas()[i].take_counts().0);
    // The first change finds the bounds of all instances.
    tlas.edit().refit();
    n_reads(&tlas);
    tlas.set_transform(InstanceId(3), Affine::IDENTITY).unwrap();
    assert_eq!(n_reads(&tlas), [0, 1]);
    tlas.replace_blas(0, counted(&soup)).unwrap();
    assert_eq!(n_reads(&tlas), [1, 0]);
    tlas.update_blas(1, |_| ()).unwrap();
    assert_eq!(n_reads(&tlas), [0, 1]);
    let n_bytes = tlas.n_bytes();
    assert!(n_bytes > 100 * tlas.n_instances(), "{n_bytes}");
    assert_eq!(tlas.into_blas().len(), 2);
}

#[test]
fn changes_that_do_not_exist_are_rejected() {
    let mut tlas =
        Tlas::new(vec![bvh(&soup(5, 20))], &[Instance::new(0, Affine::IDENTITY)], TopConfig::default()).unwrap();
    let no_instance = InstanceError::NoSuchInstance { instance: 4, n_instances: 1 };
    assert_eq!(tlas.set_transform(InstanceId(4), Affine::IDENTITY), Err(no_instance));
    assert_eq!(no_instance.to_string(), "there is no instance 4: the TLAS has 1 instances");
    let no_blas = InstanceError::UnknownBlas { blas: 2, n_blas: 1 };
    assert_eq!(tlas.update_blas(2, |_| ()), Err(no_blas));
    assert_eq!(tlas.replace_blas(2, bvh(&soup(5, 20))).map(|_| ()), Err(no_blas));
    assert_eq!(no_blas.to_string(), "there is no bottom-level BVH 2: the TLAS has 1");
    let other = Instance::new(3, Affine::IDENTITY);
    let result = tlas.edit().set_instance(InstanceId(0), other);
    assert_eq!(result, Err(InstanceError::NoSuchBlas { instance: 0, blas: 3 }));
    let mut flat = Affine::IDENTITY;
    flat.columns[0] = [0.0; 3];
    assert!(matches!(tlas.set_transform(InstanceId(0), flat), Err(InstanceError::IllConditioned { instance: 0, .. })));
}

/// Where a change fails, old hits stay or the instances are hidden; never does a ray see stale bounds.
#[test]
fn failed_changes_lose_no_hits() {
    let small = soup(5, 20);
    let huge = small.placed(|p| p.map(|x| x * 1e30));
    let large = affine(&Rotation::IDENTITY, [1e10; 3], [0.0; 3]);
    let placed = [Instance::new(0, large), Instance::new(1, Affine::IDENTITY), Instance::new(0, Affine::IDENTITY)];
    let rays = all_rays(&placed.map(|instance| instance.world_from_object), 8);
    for top in tops() {
        let mut tlas = Tlas::new(vec![bvh(&small), bvh(&small)], &placed, top.clone()).unwrap();
        let before = hits(&tlas, &rays);
        let out_of_range = InstanceError::OutOfRange { instance: 0 };
        assert_eq!(tlas.replace_blas(0, bvh(&huge)).map(|_| ()), Err(out_of_range));
        assert!(hits(&tlas, &rays) == before);

        assert_eq!(tlas.update_blas(0, |blas| *blas = bvh(&huge)), Err(out_of_range));
        let hidden = hits(&tlas, &rays);
        assert!(hidden.iter().all(|(_, _, all)| all.iter().all(|hit| hit.instance == InstanceId(1))));
        assert!(hidden.iter().any(|(hit, ..)| hit.is_some()));
        tlas.update_blas(0, |blas| *blas = bvh(&small)).unwrap();
        assert!(hits(&tlas, &rays) == before);

        let panicked = catch_unwind(AssertUnwindSafe(|| {
            let _ = tlas.update_blas(0, |blas| {
                *blas = bvh(&huge);
                panic!("a change that fails half-way");
            });
        }));
        assert!(panicked.is_err());
        assert!(hits(&tlas, &rays) == hidden);
        tlas.edit().set_instance(InstanceId(2), placed[2]).unwrap();
        assert_eq!(tlas.replace_blas(0, bvh(&small)).unwrap().sizes(), bvh(&small).sizes());
        assert!(hits(&tlas, &rays) == before);
    }
}

#[test]
fn a_clone_is_independent() {
    let [soup, torus] = meshes();
    let placed = crowd();
    let rays = all_rays(&placed, 1);
    let mut tlas = Tlas::new(vec![bvh(&soup), bvh(&torus)], &instances(&placed), TopConfig::default()).unwrap();
    let copy = tlas.clone();
    let before = hits(&tlas, &rays);
    tlas.set_instances(&[]).unwrap();
    assert!(hits(&copy, &rays) == before && hits(&tlas, &rays) != before);
    let printed = format!("{tlas:?}");
    assert!(printed.starts_with("Tlas { blas: [") && printed.contains("n_instances: 0"), "{printed}");
}

/// More instances than one job places.
#[test]
fn many_changes_at_once_equal_a_new_tlas() {
    for top in tops() {
        let mut rng = SplitMix64::new(23);
        let mut random = || Instance::new(0, random_affine(&mut rng));
        let blas = vec![bvh(&torus(10, 6))];
        let mut placed: Vec<Instance> = (0..1000).map(|_| random()).collect();
        let mut tlas = Tlas::new(blas.clone(), &placed, top.clone()).unwrap();
        let mut changes: Vec<_> = (0..900).map(|i| (InstanceId(i), random())).collect();
        // The last change of an instance counts.
        changes.push((InstanceId(7), random()));
        changes.iter().for_each(|(id, new)| placed[id.0 as usize] = *new);
        let rays = all_rays(&std::array::from_fn::<Affine, 8, _>(|i| placed[i].world_from_object), 1);
        let before = hits(&tlas, &rays);
        let mut bad = changes.clone();
        (bad[500].1.blas, bad[700].0) = (3, InstanceId(4000));
        assert_eq!(tlas.edit().set_each(&bad), Err(InstanceError::NoSuchBlas { instance: 500, blas: 3 }));
        assert!(hits(&tlas, &rays) == before);
        tlas.edit().set_each(&changes).unwrap();
        assert_eq!(tlas.instances(), placed);
        let after = hits(&tlas, &rays);
        assert!(
            after == hits(&Tlas::new(blas.clone(), &placed, top.clone()).unwrap(), &rays) && after != before,
            "{top:?}"
        );
    }
}

/// A TLAS over bottom levels that count calls; `set_instances` has no way to rebuild them.
fn counted(instances: &[Instance]) -> Tlas<Altered<Bvh2>> {
    let [soup, torus] = meshes();
    let bottom = [build(&soup, Strategy::Dop), build(&torus, Strategy::Combined)].map(Altered::unchanged);
    let [.., top] = tops();
    Tlas::new(bottom.into(), instances, top).unwrap()
}

fn closest_hits(tlas: &dyn Intersect, rays: &[Ray]) -> Vec<Option<Hit>> {
    rays.iter().map(|ray| tlas.closest_hit(ray)).collect()
}

/// All instances rotated by a quarter turn about z and shifted.
fn moved(placed: &[Affine]) -> Vec<Affine> {
    let next = Affine::from_columns([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.5, -0.25, 1.0]]);
    placed.iter().map(|affine| affine.then(&next)).collect()
}

#[test]
fn set_instances_queries_each_bound_once_and_traces_nothing() {
    let placed = crowd();
    let mut tlas = counted(&instances(&placed));
    let asked = |tlas: &Tlas<Altered<Bvh2>>| tlas.blas().iter().map(Altered::take_counts).collect::<Vec<_>>();
    assert_eq!(asked(&tlas), [(placed.len() / 2, 0); 2]);
    let before: Vec<*const Altered<Bvh2>> = tlas.blas().iter().map(std::ptr::from_ref).collect();
    tlas.set_instances(&instances(&moved(&placed))).unwrap();
    assert_eq!(asked(&tlas), [(placed.len() / 2, 0); 2]);
    assert_eq!(tlas.blas().iter().map(std::ptr::from_ref).collect::<Vec<_>>(), before);
    // The counters work.
    closest_hits(&tlas, &all_rays(&moved(&placed), 1));
    assert!(asked(&tlas).iter().all(|&(n_bounds, n_rays)| n_bounds == 0 && n_rays > 100));
}

#[test]
fn moved_instances_equal_a_fresh_build() {
    let placed = crowd();
    let after = moved(&placed);
    let rays = [all_rays(&placed, 5), all_rays(&after, 5)].concat();
    let mut tlas_moved = counted(&instances(&placed));
    let before = closest_hits(&tlas_moved, &rays);
    tlas_moved.set_instances(&instances(&after)).unwrap();
    let fresh = closest_hits(&counted(&instances(&after)), &rays);
    assert_eq!(closest_hits(&tlas_moved, &rays), fresh);
    assert_ne!(before, fresh);
    // Fewer instances, then none, then all again.
    tlas_moved.set_instances(&instances(&placed[..3])).unwrap();
    assert_eq!(closest_hits(&tlas_moved, &rays), closest_hits(&counted(&instances(&placed[..3])), &rays));
    tlas_moved.set_instances(&[]).unwrap();
    assert_eq!((tlas_moved.n_instances(), closest_hits(&tlas_moved, &rays)), (0, vec![None; rays.len()]));
    tlas_moved.set_instances(&instances(&placed)).unwrap();
    assert_eq!(closest_hits(&tlas_moved, &rays), before);
}

#[test]
fn rejected_instances_leave_the_old_ones() {
    let placed = crowd();
    let rays = all_rays(&placed, 2);
    let mut tlas = counted(&instances(&placed));
    let before = closest_hits(&tlas, &rays);
    let mut bad = instances(&moved(&placed));
    bad[9].world_from_object.columns[0] = [0.0; 3];
    assert!(tlas.set_instances(&bad).is_err());
    assert_eq!((tlas.n_instances(), closest_hits(&tlas, &rays)), (placed.len(), before));
}

fn add(blas: u32, third: Affine) -> Result<(), InstanceError> {
    let [soup, torus] = meshes();
    let bottom = vec![build(&soup, Strategy::Aabb), build(&torus, Strategy::Aabb)];
    let sound = Instance::new(0, Affine::IDENTITY);
    let instances = [sound, sound, Instance::new(blas, third)];
    Tlas::new(bottom, &instances, TopConfig::default()).map(|_| ())
}

#[test]
fn a_missing_blas_is_reported() {
    assert_eq!(add(2, Affine::IDENTITY), Err(InstanceError::NoSuchBlas { instance: 2, blas: 2 }));
    assert_eq!(add(1, Affine::IDENTITY), Ok(()));
}

#[test]
fn transforms_that_are_not_finite_are_rejected() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for place_of_bad in 0..12 {
            let mut affine = Affine::IDENTITY;
            affine.columns[place_of_bad / 3][place_of_bad % 3] = bad;
            assert_eq!(add(0, affine), Err(InstanceError::NotFinite { instance: 2 }));
        }
    }
}

#[test]
fn singular_transforms_are_rejected_at_any_scale() {
    let flat = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    for scale in [1e-30, 1e-6, 1.0, 1e6, 1e30] {
        let scaled = |columns: [[f32; 3]; 3]| {
            let [x, y, z] = columns.map(|column| column.map(|c| c * scale));
            Affine { columns: [x, y, z, [0.0; 3]] }
        };
        // A scale by zero hides an instance.
        assert_eq!(add(0, scaled([[0.0; 3]; 3])), Ok(()));
        for columns in [flat, [flat[0], flat[0], flat[1]], [flat[0], flat[1], [0.0; 3]], [flat[0], [0.0; 3], [0.0; 3]]]
        {
            let error = add(0, scaled(columns)).unwrap_err();
            assert!(matches!(error, InstanceError::IllConditioned { instance: 2, .. }), "{scale:e}: {error}");
        }
    }
}

#[test]
fn the_condition_number_decides_not_the_determinant() {
    for scale in [1e-6f64, 1e-3, 1.0, 1e3, 1e6] {
        assert_eq!(add(0, affine(&Rotation::off_axis(), [scale, scale, -scale], [1e7, 0.0, 0.0])), Ok(()), "{scale:e}");
    }
    let stretched = |ratio: f64| add(1, affine(&Rotation::IDENTITY, [1.0, 1.0, ratio], [0.0; 3]));
    assert_eq!(stretched(MAX_CONDITION), Ok(()));
    assert_eq!(stretched(1.0 / MAX_CONDITION), Ok(()));
    let condition = 2.0 * MAX_CONDITION;
    for ratio in [condition, 1.0 / condition] {
        assert_eq!(stretched(ratio), Err(InstanceError::IllConditioned { instance: 2, condition }));
    }
}

#[test]
fn error_messages_name_instance_and_limit() {
    let sentence = |result: Result<(), InstanceError>| result.unwrap_err().to_string();
    assert_eq!(sentence(add(7, Affine::IDENTITY)), "instance 2 refers to bottom-level BVH 7, which does not exist");
    let shift = Affine::translation([0.0, f32::NAN, 0.0]);
    assert_eq!(sentence(add(0, shift)), "the transform of instance 2 is not finite");
    assert_eq!(
        sentence(add(0, Affine::scale([1.0, 0.0, 0.0]))),
        "the transform of instance 2 is too close to singular: its condition number is inf, at most 1.048576e6 is supported"
    );
}

#[test]
fn bounds_out_of_range_are_rejected() {
    let affine = Affine::scale([1e38; 3]).then(&Affine::translation([3e38; 3]));
    assert_eq!(add(0, affine), Err(InstanceError::OutOfRange { instance: 2 }));
}
