//! Watertight: no ray leaves a closed mesh from inside, or enters it from outside, without a hit, and crossings alternate.
//!
//! Rays at shared vertices and edges, a million of them through every tracer; every volume strategy and every wide configuration; one
//! level and two, scales 1e-6 to 1e6, offsets of 1e7, and rotated, sheared and mirrored instances. `cargo xtask watertight` traces more
//! rays, also at the bunny. Not covered here: meshes whose neighbors do not share vertices, and seams between two instances, whose data
//! have gaps.

use canted_bvh2::{Bvh2, PairOrder};
use canted_fixtures::Mesh;
use canted_lbvh::{self as lbvh, Bits, Domain, Strategy, VolumeConfig};
use canted_obb::Affine;
use canted_tests::{
    closed::{Found, Placement, all_placements, closed, placements, rays, search},
    scenes::{baked, with_another},
    tracers,
    variants::{binary, binary_top, build, every_variant, few_variants, paths},
};
use canted_tlas::{Tlas, TopConfig};
use canted_trace::{InstanceId, Intersect, Ray, TriangleTest};
use canted_wide::{Config, TriangleBvh};

const N_OF_SEARCH: usize = 1_000_000;

#[test]
#[expect(clippy::print_stderr, reason = "unavailable features are reported")]
fn a_million_rays_find_no_leak() {
    let (methods, missing) = tracers::ours();
    for name in missing {
        eprintln!("not tested: {name} is not available");
    }
    let found = search(&closed(), &all_placements(), &methods, N_OF_SEARCH, &mut |_| ());
    let leaks: Vec<&Found> = found.iter().filter(|found| found.n_leaks > 0).collect();
    assert!(leaks.is_empty(), "{leaks:#?}");
    assert!(found.iter().map(|found| found.n_rays).sum::<usize>() >= N_OF_SEARCH);
    for method in ["binary dop", "two-level binary", "wide scalar", "two-level wide"] {
        assert!(found.iter().any(|found| found.method == format!("crossings, {method}")), "{method}");
    }
}

/// Rays from inside, and as many from outside, for each mesh, placement, strategy and number of levels.
const N_RAYS: usize = 5_000;

/// Number of leaks through one of two instances.
fn leaks_of_two<B: Intersect>(blas: B, mesh: &Mesh, world_from_object: &Affine, top: TopConfig, rays: &[Ray]) -> usize {
    let tlas = Tlas::new(vec![blas], &with_another(mesh, world_from_object), top).unwrap();
    let leaks =
        |ray: &&Ray| tlas.closest_hit(ray).is_none_or(|hit| hit.instance != InstanceId(0)) || !tlas.occluded(ray);
    rays.iter().filter(leaks).count()
}

/// Number of leaks with one level over the transformed mesh, and with two levels over the mesh itself.
fn leaks(mesh: &Mesh, world_from_object: &Affine, strategy: Strategy, rays: &[Ray]) -> [usize; 2] {
    let world = baked(mesh, world_from_object);
    let [one, bottom] = [&world, mesh].map(|mesh| binary(mesh, strategy, TriangleTest::Watertight));
    let leaks_of_one = rays.iter().filter(|ray| one.closest_hit(ray).is_none() || !one.occluded(ray)).count();
    let top = binary_top(VolumeConfig { strategy, fallback: true });
    [leaks_of_one, leaks_of_two(bottom, mesh, world_from_object, top, rays)]
}

#[test]
fn no_ray_leaks() {
    let mut n_rays = 0;
    for closed in closed() {
        assert_eq!(closed.mesh.open_edge(), None);
        for (Placement { name, world_from_object }, seed) in placements().iter().zip(400..) {
            let world = baked(&closed.mesh, world_from_object);
            for strategy in Strategy::ALL {
                let rays = rays(&world, &closed, world_from_object, N_RAYS, seed);
                let leaks = leaks(&closed.mesh, world_from_object, strategy, &rays);
                assert_eq!(leaks, [0, 0], "{}, {name}, {strategy:?}", closed.name);
                n_rays += 2 * rays.len();
            }
        }
    }
    assert!(n_rays >= 1_000_000, "{n_rays} rays");
}

#[test]
fn a_hole_is_detected() {
    for closed in closed() {
        for Placement { name, world_from_object } in placements() {
            let rays = rays(&baked(&closed.mesh, &world_from_object), &closed, &world_from_object, N_RAYS, 7);
            let mut open = closed.mesh.clone();
            open.triangles.pop();
            let leaks = leaks(&open, &world_from_object, Strategy::Dop, &rays);
            assert!(leaks.iter().all(|&n| n > 0), "{}, {name}: {leaks:?}", closed.name);
        }
    }
}

#[test]
fn a_box_too_small_is_detected() {
    let closed = &closed()[0];
    let (corners, bounds) = lbvh::triangle_corners(&closed.mesh.positions, &closed.mesh.triangles).unwrap();
    let tree =
        lbvh::radix(lbvh::sort_by_code(&lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners), Bits::B63));
    let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
    let mut volumes = lbvh::volumes(&tree, &sorted, &VolumeConfig::default());
    let rays = rays(&closed.mesh, closed, &Affine::IDENTITY, N_RAYS, 7);
    let leaks = |volumes: &lbvh::Volumes| {
        let blas =
            Bvh2::new(tree.clone(), volumes, sorted.clone(), &bounds, PairOrder::Numbered, TriangleTest::Watertight);
        rays.iter().filter(|ray| blas.closest_hit(ray).is_none()).count()
    };
    assert_eq!(leaks(&volumes), 0);
    for aabb in &mut volumes.aabbs[1..] {
        aabb.max[2] -= 0.02;
    }
    assert!(leaks(&volumes) > 0);
}

/// Rays of each kind for each mesh, placement and configuration.
const N_RAYS_WIDE: usize = 1_500;

fn leaks_of_one(tree: &TriangleBvh, rays: &[Ray]) -> usize {
    let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
    tree.closest_hits(rays, &mut hits);
    tree.occluded_many(rays, &mut occluded);
    hits.iter().zip(&occluded).filter(|&(hit, &occluded)| hit.is_none() || !occluded).count()
}

/// Leaks through one of two instances of a wide BVH.
fn leaks_of_wide_instances(mesh: &Mesh, world_from_object: &Affine, config: &Config, rays: &[Ray]) -> usize {
    leaks_of_two(build(mesh, config), mesh, world_from_object, TopConfig::default(), rays)
}

#[test]
fn no_ray_leaks_from_wide_bvhs() {
    for closed in closed() {
        for (Placement { name, world_from_object }, seed) in placements().iter().zip(500..) {
            let world = baked(&closed.mesh, world_from_object);
            let rays = rays(&world, &closed, world_from_object, N_RAYS_WIDE, seed);
            for (variant, config) in every_variant() {
                let tree = build(&world, &config);
                for path in paths().0 {
                    let leaks = leaks_of_one(&tree.clone().with_path(path), &rays);
                    assert_eq!(leaks, 0, "{}, {name}, {variant}, {}", closed.name, path.name());
                }
            }
            for (variant, config) in few_variants() {
                let leaks = leaks_of_wide_instances(&closed.mesh, world_from_object, &config, &rays);
                assert_eq!(leaks, 0, "{}, {name}, {variant}, two levels", closed.name);
            }
        }
    }
}

#[test]
fn a_hole_of_a_wide_bvh_is_detected() {
    for closed in closed() {
        for Placement { name, world_from_object } in placements() {
            let rays = rays(&baked(&closed.mesh, &world_from_object), &closed, &world_from_object, 5_000, 7);
            let mut open = closed.mesh.clone();
            open.triangles.pop();
            let config = Config::default();
            let one = leaks_of_one(&build(&baked(&open, &world_from_object), &config), &rays);
            let two = leaks_of_wide_instances(&open, &world_from_object, &config, &rays);
            assert!(one > 0 && two > 0, "{}, {name}: {one}, {two}", closed.name);
        }
    }
}
