//! Watertight: from inside a closed mesh no ray gets out, and from outside none gets in, unseen.
//!
//! Rays at shared vertices and edges, every strategy, one level and two, scales 1e-6 to 1e6, offsets of 1e7, and
//! instances that turn, shear and mirror. Not covered here: how often a ray crosses (parity), meshes whose neighbours
//! do not share vertices, seams between two instances; both of these have gaps in their data.

use canted_fixtures::{Mesh, Rotation, SplitMix64, displaced_icosphere, icosphere, thin_box, torus};
use canted_lbvh::{self as lbvh, Bits, Domain, Strategy, VolumeConfig};
use canted_obb::Affine;
use canted_tlas::{Blas, BuildConfig, Instance, MeshBlas, PairOrder, Tlas};
use canted_trace::{InstanceId, Ray, Watertight};

/// Rays from inside, and as many from outside, for each mesh, place, strategy and number of levels.
const N_RAYS: usize = 5_000;

/// A closed mesh, star-shaped as seen from `heart` but for the torus, which is only tight around it.
struct Closed {
    name: &'static str,
    mesh: Mesh,
    heart: [f64; 3],
    /// Every point within this of `heart`, along each axis, is inside.
    room: [f64; 3],
}

fn closed() -> Vec<Closed> {
    let origin = [0.0; 3];
    vec![
        Closed { name: "icosphere", mesh: icosphere(2), heart: origin, room: [0.5; 3] },
        Closed { name: "displaced icosphere", mesh: displaced_icosphere(3, 2), heart: origin, room: [0.4; 3] },
        Closed { name: "torus", mesh: torus(24, 8), heart: [1.0, 0.0, 0.0], room: [0.2; 3] },
        Closed { name: "thin box", mesh: thin_box(0.01), heart: origin, room: [0.4, 0.4, 0.004] },
    ]
}

/// Where a closed mesh stands in the world.
struct Place {
    name: &'static str,
    world_from_object: Affine,
}

#[expect(clippy::cast_possible_truncation, reason = "any numbers near these will do")]
fn places() -> Vec<Place> {
    let place = |name, turn: Rotation, scale: [f64; 3], shift: f32| {
        let column = |j: usize| turn.rows.map(|row| (row[j] * scale[j]) as f32);
        Place { name, world_from_object: Affine { columns: [column(0), column(1), column(2), [shift, -shift, shift]] } }
    };
    let mut sheared = place("sheared and mirrored", Rotation::turn(), [1.0, -0.5, 2.0], 0.3);
    sheared.world_from_object.columns[1][0] += 0.7;
    vec![
        place("as it is", Rotation::IDENTITY, [1.0; 3], 0.0),
        place("at 1e-6, turned", Rotation::turn(), [1e-6; 3], 0.0),
        place("at 1e6, turned", Rotation::turn(), [1e6; 3], 0.0),
        // Steps of f32 are 1 there, and the thin box is 20 thick.
        place("at 1e7", Rotation::turn(), [2e3; 3], 1e7),
        sheared,
    ]
}

/// The mesh in world space, vertices rounded: neighbours still share them.
fn baked(mesh: &Mesh, world_from_object: &Affine) -> Mesh {
    let positions = mesh.positions.iter().map(|&p| world_from_object.point(p)).collect();
    Mesh { positions, triangles: mesh.triangles.clone() }
}

/// `a + by·(b - a)`.
fn between(a: [f64; 3], b: [f64; 3], by: f64) -> [f64; 3] {
    std::array::from_fn(|k| a[k] + by * (b[k] - a[k]))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// Rays through a vertex or an edge of `mesh` (in world space): even ones from inside, odd ones from far outside
/// through the edge to a point inside.
#[expect(clippy::cast_possible_truncation, reason = "rays are rounded like everything")]
fn rays(mesh: &Mesh, closed: &Closed, world_from_object: &Affine, n: usize, seed: u64) -> Vec<Ray> {
    let mut rng = SplitMix64::new(seed);
    (0..n)
        .map(|i| {
            // A third from the heart itself: there coordinates repeat, and rays meet vertices exactly.
            let offset = if i % 3 == 0 { [0.0; 3] } else { rng.signed3() };
            let inside_object = std::array::from_fn(|k| closed.heart[k] + offset[k] * closed.room[k]);
            let inside = world_from_object.point_f64(inside_object);
            let corners = mesh.corners(rng.below(mesh.triangles.len()));
            let first = rng.below(3);
            let along_edge = [0.0, 0.5, rng.unit()][i / 2 % 3];
            let target = between(corners[first], corners[(first + 1) % 3], along_edge);
            // The mesh ends within a diagonal of the target.
            let outside = between(inside, target, 1.0 + mesh.diagonal() / distance(inside, target));
            let (from, to) = if i % 2 == 0 { (inside, target) } else { (outside, inside) };
            let origin = from.map(|x| x as f32);
            let direction = std::array::from_fn(|k| (to[k] - f64::from(origin[k])) as f32);
            Ray::new(origin, direction)
        })
        .collect()
}

fn config(strategy: Strategy) -> BuildConfig {
    BuildConfig { bits: Bits::B63, volumes: VolumeConfig { strategy, fallback: true } }
}

#[expect(clippy::cast_possible_truncation, reason = "far off will do")]
fn far_off(mesh: &Mesh) -> f32 {
    (9.0 * mesh.diagonal()) as f32
}

/// How many rays leak through one level over the baked mesh, and through two levels over the mesh itself.
fn leaks(mesh: &Mesh, world_from_object: &Affine, strategy: Strategy, rays: &[Ray]) -> [usize; 2] {
    let world = baked(mesh, world_from_object);
    let one = MeshBlas::<Watertight>::build(&world.positions, &world.triangles, &config(strategy)).unwrap();
    let bottom = MeshBlas::<Watertight>::build(&mesh.positions, &mesh.triangles, &config(strategy)).unwrap();
    let instance = Instance { blas: 0, world_from_object: *world_from_object };
    // A second instance far off makes the top level a tree.
    let mut other = instance;
    other.world_from_object.columns[3][0] += far_off(&world);
    let two = Tlas::new(vec![bottom], &[instance, other], config(strategy).volumes).unwrap();
    let leaks_one = |ray: &&Ray| {
        one.closest_hit(ray, InstanceId(0), &mut ()).is_none() || !one.occluded(ray, InstanceId(0), &mut ())
    };
    let leaks_two = |ray: &&Ray| {
        two.closest_hit(ray, &mut ()).is_none_or(|hit| hit.instance != InstanceId(0)) || !two.occluded(ray, &mut ())
    };
    [rays.iter().filter(leaks_one).count(), rays.iter().filter(leaks_two).count()]
}

#[test]
fn no_ray_leaks() {
    let mut n_rays = 0;
    for closed in closed() {
        assert_eq!(closed.mesh.open_edge(), None);
        for (Place { name, world_from_object }, seed) in places().iter().zip(400..) {
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
fn a_hole_is_seen() {
    for closed in closed() {
        for Place { name, world_from_object } in places() {
            let rays = rays(&baked(&closed.mesh, &world_from_object), &closed, &world_from_object, N_RAYS, 7);
            let mut open = closed.mesh.clone();
            open.triangles.pop();
            let leaks = leaks(&open, &world_from_object, Strategy::Dop, &rays);
            assert!(leaks.iter().all(|&n| n > 0), "{}, {name}: {leaks:?}", closed.name);
        }
    }
}

#[test]
fn a_box_too_small_is_seen() {
    let closed = &closed()[0];
    let (corners, bounds) = lbvh::gather(&closed.mesh.positions, &closed.mesh.triangles).unwrap();
    let tree = lbvh::radix(lbvh::by_code(&lbvh::codes(&Domain::new(&bounds, 3, Bits::B63), &corners), Bits::B63));
    let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
    let mut volumes = lbvh::volumes(&tree, &sorted, &VolumeConfig::default());
    let rays = rays(&closed.mesh, closed, &Affine::IDENTITY, N_RAYS, 7);
    let leaks = |volumes: &lbvh::Volumes| {
        let blas = MeshBlas::<Watertight>::new(tree.clone(), volumes, sorted.clone(), &bounds, PairOrder::Numbered);
        rays.iter().filter(|ray| blas.closest_hit(ray, InstanceId(0), &mut ()).is_none()).count()
    };
    assert_eq!(leaks(&volumes), 0);
    for aabb in &mut volumes.aabbs[1..] {
        aabb.max[2] -= 0.02;
    }
    assert!(leaks(&volumes) > 0);
}
