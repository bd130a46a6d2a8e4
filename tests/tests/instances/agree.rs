//! The same hits as a loop over all instances, each looping over all triangles.

use canted_fixtures::{Mesh, Rotation, thin_box};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::{Affine, PrimId};
use canted_tests::{brute, instances as oracle};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Counts, Hit, InstanceId, Kernel, MollerTrumbore, Ray, Watertight};
use canted_wide::{Config, Preset};

use super::setup::{affine, all_rays, blas_of, build, crowd, instances, meshes};

pub(crate) fn loop_over_all<K: Kernel>(placed: &[Affine], rays: &[Ray]) -> Vec<Option<Hit>> {
    let records = meshes().map(|mesh| brute::records::<K>(&mesh.positions, &mesh.triangles));
    let trace = |i: usize, ray: &Ray| brute::closest_hit::<K>(&records[blas_of(i)], ray);
    rays.iter().map(|ray| oracle::closest_hit(placed, ray, trace)).collect()
}

/// The first ray for which the two levels differ from `wants`.
fn first_difference<K: Kernel>(
    tlas: &Tlas<canted_bvh2::Bvh2<K>>,
    rays: &[Ray],
    wants: &[Option<Hit>],
) -> Option<String> {
    rays.iter().zip(wants).find_map(|(ray, want)| {
        let got = tlas.closest_hit(ray);
        let occluded = tlas.occluded(ray);
        (got != *want || occluded != want.is_some()).then(|| format!("{ray:?}: {got:?}, {occluded}, not {want:?}"))
    })
}

fn agrees<K: Kernel>(n: usize) {
    let (placed, [soup, torus]) = (crowd(), meshes());
    let rays = all_rays(&placed, n);
    let wants = loop_over_all::<K>(&placed, &rays);
    assert!(wants.iter().flatten().count() * 3 > rays.len(), "too few rays hit");
    for strategy in Strategy::ALL {
        let binary = |fallback| TopConfig::Binary(VolumeConfig { strategy, fallback });
        let wide = |preset| TopConfig::Wide(Config::preset(preset));
        for top in [binary(true), binary(false), wide(Preset::Fast), wide(Preset::Quality)] {
            let bottom = vec![build::<K>(&soup, strategy), build::<K>(&torus, strategy)];
            let tlas = Tlas::new(bottom, &instances(&placed), top).unwrap();
            assert_eq!(first_difference(&tlas, &rays, &wants), None, "{strategy:?} under {top:?}");
        }
    }
}

#[test]
fn watertight_agrees_to_the_bit() {
    agrees::<Watertight>(30);
}

#[test]
fn moller_trumbore_agrees_to_the_bit() {
    agrees::<MollerTrumbore>(8);
}

#[test]
fn a_slightly_moved_instance_is_detected() {
    let (placed, [soup, torus]) = (crowd(), meshes());
    let rays = all_rays(&placed, 4);
    let wants = loop_over_all::<Watertight>(&placed, &rays);
    let mut moved = instances(&placed);
    moved[1].world_from_object.columns[3][0] += 1e-5;
    let bottom = vec![build::<Watertight>(&soup, Strategy::Dop), build(&torus, Strategy::Dop)];
    let tlas = Tlas::new(bottom, &moved, TopConfig::default()).unwrap();
    assert!(first_difference(&tlas, &rays, &wants).is_some());
}

#[test]
fn the_top_level_skips_most_instances() {
    let (placed, [soup, torus]) = (crowd(), meshes());
    let rays = all_rays(&placed, 10);
    for top in [TopConfig::default(), TopConfig::Binary(VolumeConfig::default())] {
        let bottom = vec![build::<Watertight>(&soup, Strategy::Dop), build(&torus, Strategy::Dop)];
        let tlas = Tlas::new(bottom, &instances(&placed), top).unwrap();
        let mut counts = Counts::default();
        for ray in &rays {
            tlas.closest_hit_with(ray, &mut counts);
        }
        let all = (rays.len() * placed.len() * 120) as u64;
        assert!(counts.triangles * 20 < all, "{counts:?} of {all}");
    }
}

#[test]
fn ties_go_to_the_lowest_instance_then_primitive() {
    // Two coincident triangles in each mesh, two coincident meshes, each instanced twice with each transform.
    let [soup, _] = meshes();
    let doubled =
        Mesh { positions: soup.positions.clone(), triangles: [&soup.triangles[..], &soup.triangles].concat() };
    let transforms = [affine(&Rotation::off_axis(), [2.0, 1.0, 0.5], [1.0, 2.0, 3.0]), Affine::IDENTITY];
    for order in [[0, 1, 1, 0], [1, 0, 0, 1], [1, 1, 0, 0]] {
        let instances: Vec<Instance> = order
            .into_iter()
            .zip([0, 1, 1, 0])
            .map(|(transform, blas)| Instance::new(blas, transforms[transform]))
            .collect();
        for strategy in [Strategy::Aabb, Strategy::Dop] {
            for top in [TopConfig::default(), TopConfig::Binary(VolumeConfig { strategy, fallback: true })] {
                let bottom = vec![build::<Watertight>(&doubled, strategy), build(&doubled, Strategy::Aabb)];
                let tlas = Tlas::new(bottom, &instances, top).unwrap();
                let mut n_hits = 0;
                for hit in all_rays(&transforms, 40).iter().filter_map(|ray| tlas.closest_hit(ray)) {
                    let transform = order[hit.instance.0 as usize];
                    assert_eq!(hit.instance.0 as usize, order.iter().position(|&p| p == transform).unwrap(), "{hit:?}");
                    assert!(hit.primitive < PrimId(120), "{hit:?}");
                    n_hits += 1;
                }
                assert!(n_hits > 100, "{n_hits} hits");
            }
        }
    }
}

#[test]
fn t_is_the_same_at_every_scale() {
    let plate = thin_box(0.0);
    let at = |scale: f64, z: f32| Instance::new(0, affine(&Rotation::IDENTITY, [scale; 3], [0.0, 0.0, z]));
    let instances = [at(1024.0, 16.0), at(1.0 / 1024.0, 5.0), at(-1.0, 7.0)];
    let tlas = Tlas::new(vec![build::<Watertight>(&plate, Strategy::Aabb)], &instances, TopConfig::default()).unwrap();
    for length in [1.0, 8.0, 1.0 / 64.0] {
        let nearest = |x: f32| {
            let hit = tlas.closest_hit(&Ray::new([x, 0.0, 0.0], [0.0, 0.0, length])).unwrap();
            (hit.t * length, hit.instance)
        };
        assert_eq!(nearest(0.0), (5.0, InstanceId(1)));
        assert_eq!(nearest(0.125), (7.0, InstanceId(2)));
        assert_eq!(nearest(100.0), (16.0, InstanceId(0)));
    }
}

#[test]
fn an_empty_top_level_is_never_hit() {
    for top in [TopConfig::default(), TopConfig::Binary(VolumeConfig::default())] {
        let mut tlas = Tlas::<canted_bvh2::Bvh2<Watertight>>::new(vec![], &[], top).unwrap();
        let ray = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
        assert_eq!((tlas.closest_hit(&ray), tlas.occluded(&ray)), (None, false));
        assert!(tlas.set_instances(&[]).is_ok());
        assert!(tlas.aabb().is_empty());
        let nothing = build::<Watertight>(&Mesh::default(), Strategy::Dop);
        let tlas = Tlas::new(vec![nothing], &[Instance::new(0, Affine::IDENTITY)], top).unwrap();
        assert_eq!((tlas.closest_hit(&ray), tlas.occluded(&ray)), (None, false));
    }
}
