//! No ray leaves a closed mesh from inside or enters it from outside without a hit, through one level and two.

use canted_fixtures::Mesh;
use canted_obb::Affine;
use canted_tests::closed::{Placement, baked, closed, placements, rays};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{InstanceId, Ray, Watertight};
use canted_wide::{Config, TriangleBvh};

use super::setup::{build, every_variant, few_variants, paths};

/// Rays of each kind for each mesh, placement and configuration.
const N_RAYS: usize = 1_500;

fn leaks_of_one(tree: &TriangleBvh<Watertight>, rays: &[Ray]) -> usize {
    let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
    tree.closest_hits(rays, &mut hits);
    tree.occluded_many(rays, &mut occluded);
    hits.iter().zip(&occluded).filter(|&(hit, &occluded)| hit.is_none() || !occluded).count()
}

/// Leaks through an instance; a second one gives the top level more than one leaf.
#[expect(clippy::cast_possible_truncation, reason = "any large distance")]
fn leaks_of_two(mesh: &Mesh, world_from_object: &Affine, config: &Config, rays: &[Ray]) -> usize {
    let instance = Instance::new(0, *world_from_object);
    let mut other = instance;
    other.world_from_object.columns[3][0] += (9.0 * baked(mesh, world_from_object).diagonal()) as f32;
    let tlas = Tlas::new(vec![build::<Watertight>(mesh, config)], &[instance, other], TopConfig::default()).unwrap();
    let leaks =
        |ray: &&Ray| tlas.closest_hit(ray).is_none_or(|hit| hit.instance != InstanceId(0)) || !tlas.occluded(ray);
    rays.iter().filter(leaks).count()
}

#[test]
fn no_ray_leaks() {
    for closed in closed() {
        for (Placement { name, world_from_object }, seed) in placements().iter().zip(500..) {
            let world = baked(&closed.mesh, world_from_object);
            let rays = rays(&world, &closed, world_from_object, N_RAYS, seed);
            for (variant, config) in every_variant() {
                let tree = build::<Watertight>(&world, &config);
                for path in paths().0 {
                    let leaks = leaks_of_one(&tree.clone().with_path(path), &rays);
                    assert_eq!(leaks, 0, "{}, {name}, {variant}, {}", closed.name, path.name());
                }
            }
            for (variant, config) in few_variants() {
                let leaks = leaks_of_two(&closed.mesh, world_from_object, &config, &rays);
                assert_eq!(leaks, 0, "{}, {name}, {variant}, two levels", closed.name);
            }
        }
    }
}

#[test]
fn a_hole_is_detected() {
    for closed in closed() {
        for Placement { name, world_from_object } in placements() {
            let rays = rays(&baked(&closed.mesh, &world_from_object), &closed, &world_from_object, 5_000, 7);
            let mut open = closed.mesh.clone();
            open.triangles.pop();
            let config = Config::default();
            let one = leaks_of_one(&build(&baked(&open, &world_from_object), &config), &rays);
            let two = leaks_of_two(&open, &world_from_object, &config, &rays);
            assert!(one > 0 && two > 0, "{}, {name}: {one}, {two}", closed.name);
        }
    }
}
