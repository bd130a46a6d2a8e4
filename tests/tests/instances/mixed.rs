//! Mixed kinds of bottom levels: builders, volumes and triangle tests.

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::Mesh;
use canted_lbvh::{self as lbvh, Strategy, VolumeConfig};
use canted_obb::Obb;
use canted_renderer::obvhs_tree;
use canted_tests::{brute, instances as oracle};
use canted_tlas::{Blas, Instance, Tlas, TopConfig};
use canted_trace::{BaldwinWeber, HIT_ERROR, Hit, InstanceId, Kernel, MollerTrumbore, Query, Ray, Watertight};

use super::setup::{all_rays, build, crowd, meshes};

/// A bottom level of either kind.
enum Mixed {
    Watertight(Bvh2<Watertight>),
    MollerTrumbore(Bvh2<MollerTrumbore>),
    BaldwinWeber(Bvh2<BaldwinWeber>),
}

impl Blas for Mixed {
    fn bounds(&self) -> Obb {
        match self {
            Self::Watertight(blas) => blas.bounds(),
            Self::MollerTrumbore(blas) => blas.bounds(),
            Self::BaldwinWeber(blas) => blas.bounds(),
        }
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
    }

    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        match self {
            Self::Watertight(blas) => blas.closest_hit_with(ray_object, instance, query),
            Self::MollerTrumbore(blas) => blas.closest_hit_with(ray_object, instance, query),
            Self::BaldwinWeber(blas) => blas.closest_hit_with(ray_object, instance, query),
        }
    }

    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        match self {
            Self::Watertight(blas) => blas.occluded_with(ray_object, instance, query),
            Self::MollerTrumbore(blas) => blas.occluded_with(ray_object, instance, query),
            Self::BaldwinWeber(blas) => blas.occluded_with(ray_object, instance, query),
        }
    }

    fn all_hits_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        match self {
            Self::Watertight(blas) => blas.all_hits_with(ray_object, instance, query, hits),
            Self::MollerTrumbore(blas) => blas.all_hits_with(ray_object, instance, query, hits),
            Self::BaldwinWeber(blas) => blas.all_hits_with(ray_object, instance, query, hits),
        }
    }
}

/// A bottom level over the topology of `obvhs`, with our volumes.
fn foreign<K: Kernel>(mesh: &Mesh, strategy: Strategy) -> Bvh2<K> {
    let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let tree = obvhs_tree(&corners, obvhs::BvhBuildParams::medium_build()).unwrap();
    let volumes = VolumeConfig { strategy, fallback: true };
    Bvh2::over(tree, &corners, &bounds, &BuildConfig { volumes, ..BuildConfig::default() })
}

/// Several kinds with the watertight test, then one of each other test; even ones over the soup.
fn kinds() -> Vec<Mixed> {
    let [soup, torus] = meshes();
    vec![
        Mixed::Watertight(build(&soup, Strategy::Aabb)),
        Mixed::Watertight(foreign(&torus, Strategy::Dop)),
        Mixed::Watertight(foreign(&soup, Strategy::Quaternion)),
        Mixed::Watertight(build(&torus, Strategy::PcaUnbounded)),
        Mixed::MollerTrumbore(foreign(&soup, Strategy::PcaBounded)),
        Mixed::BaldwinWeber(build(&torus, Strategy::Dop)),
    ]
}

/// A top level whose instances cycle through these bottom levels.
fn tlas(order: &[u32]) -> Tlas<Mixed> {
    let instances: Vec<Instance> = crowd()
        .into_iter()
        .zip(order.iter().cycle())
        .map(|(world_from_object, &blas)| Instance::new(blas, world_from_object))
        .collect();
    Tlas::new(kinds(), &instances, TopConfig::Binary(VolumeConfig { strategy: Strategy::Combined, fallback: true }))
        .unwrap()
}

fn hits(tlas: &Tlas<Mixed>, rays: &[Ray]) -> Vec<Option<Hit>> {
    rays.iter().map(|ray| tlas.closest_hit(ray)).collect()
}

#[test]
fn mixed_builders_and_volumes_change_no_bit() {
    let rays = all_rays(&crowd(), 10);
    let same = hits(&tlas(&[0, 1]), &rays);
    assert_eq!(hits(&tlas(&[2, 3]), &rays), same);
    assert_eq!(hits(&tlas(&[0, 1, 2, 3]), &rays), same);
    assert_ne!(hits(&tlas(&[1, 0]), &rays), same);
}

#[test]
fn mixed_triangle_tests_match_the_loop() {
    let (placed, [soup, torus]) = (crowd(), meshes());
    let rays = all_rays(&placed, 10);
    let of = |mesh: &Mesh| brute::records::<Watertight>(&mesh.positions, &mesh.triangles);
    let watertight = [of(&soup), of(&torus)];
    let moller_trumbore = brute::records::<MollerTrumbore>(&soup.positions, &soup.triangles);
    let baldwin_weber = brute::records::<BaldwinWeber>(&torus.positions, &torus.triangles);
    let order = [4, 5, 0, 1, 2, 3];
    let trace = |i: usize, ray: &Ray| match order[i % order.len()] {
        4 => brute::closest_hit::<MollerTrumbore>(&moller_trumbore, ray),
        5 => brute::closest_hit::<BaldwinWeber>(&baldwin_weber, ray),
        kind => brute::closest_hit::<Watertight>(&watertight[kind % 2], ray),
    };
    let mixed = tlas(&order.map(|kind| u32::try_from(kind).unwrap()));
    for ray in &rays {
        let want = oracle::closest_hit(&placed, ray, trace);
        assert_eq!(mixed.closest_hit(ray), want, "{ray:?}");
        assert_eq!(mixed.occluded(ray), want.is_some(), "{ray:?}");
    }
}
