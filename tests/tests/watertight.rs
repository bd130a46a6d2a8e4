//! Watertight: no ray leaves a closed mesh from inside, or enters it from outside, without a hit.
//!
//! Rays at shared vertices and edges, every strategy, one level and two, scales 1e-6 to 1e6, offsets of 1e7, and rotated, sheared
//! and mirrored instances. Not covered here: number of crossings (parity), meshes whose neighbors do not share vertices, and seams
//! between two instances, whose data have gaps.

use canted_bvh2::{BuildConfig, Bvh2, PairOrder};
use canted_fixtures::Mesh;
use canted_lbvh::{self as lbvh, Bits, Domain, Strategy, VolumeConfig};
use canted_obb::Affine;
use canted_tests::closed::{Placement, baked, closed, placements, rays};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{InstanceId, Ray, Watertight};

/// Rays from inside, and as many from outside, for each mesh, placement, strategy and number of levels.
const N_RAYS: usize = 5_000;

fn config(strategy: Strategy) -> BuildConfig {
    BuildConfig { bits: Bits::B63, volumes: VolumeConfig { strategy, fallback: true } }
}

#[expect(clippy::cast_possible_truncation, reason = "any large distance")]
fn far_off(mesh: &Mesh) -> f32 {
    (9.0 * mesh.diagonal()) as f32
}

/// Number of leaks with one level over the transformed mesh, and with two levels over the mesh itself.
fn leaks(mesh: &Mesh, world_from_object: &Affine, strategy: Strategy, rays: &[Ray]) -> [usize; 2] {
    let world = baked(mesh, world_from_object);
    let one = Bvh2::<Watertight>::build(&world.positions, &world.triangles, &config(strategy)).unwrap();
    let bottom = Bvh2::<Watertight>::build(&mesh.positions, &mesh.triangles, &config(strategy)).unwrap();
    let instance = Instance::new(0, *world_from_object);
    // The second instance, far away, gives the top level more than one leaf.
    let mut other = instance;
    other.world_from_object.columns[3][0] += far_off(&world);
    let two = Tlas::new(vec![bottom], &[instance, other], TopConfig::Binary(config(strategy).volumes)).unwrap();
    let leaks_one = |ray: &&Ray| one.closest_hit(ray).is_none() || !one.occluded(ray);
    let leaks_two =
        |ray: &&Ray| two.closest_hit(ray).is_none_or(|hit| hit.instance != InstanceId(0)) || !two.occluded(ray);
    [rays.iter().filter(leaks_one).count(), rays.iter().filter(leaks_two).count()]
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
        let blas = Bvh2::<Watertight>::new(tree.clone(), volumes, sorted.clone(), &bounds, PairOrder::Numbered);
        rays.iter().filter(|ray| blas.closest_hit(ray).is_none()).count()
    };
    assert_eq!(leaks(&volumes), 0);
    for aabb in &mut volumes.aabbs[1..] {
        aabb.max[2] -= 0.02;
    }
    assert!(leaks(&volumes) > 0);
}
