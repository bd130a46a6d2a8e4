//! Binary BVHs: the same bits as a loop over all triangles, and certain results by exact arithmetic.
//!
//! Every strategy, with and without fallback, every kernel, trees of other builders; rays through vertices and edges, in face planes,
//! axis-parallel, from far away; offsets of 1e7, scales 1e-20 and 1e15. Not covered here: rays within the margin of the exact reference,
//! which only `watertight.rs` tests.

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::{Grazing, Mesh, fan, grazing, outlier, slivers, soup};
use canted_lbvh::{Bits, Leaf, Strategy, VolumeConfig, check, in_leaf_order, triangle_corners, volumes};
use canted_tests::{
    brute,
    reference::{self, Tally, compare, corners, margin, meshes},
    scenes,
};
use canted_trace::{BaldwinWeber, Counts, Hit, InstanceId, Kernel, MollerTrumbore, Query, Ray, Watertight};

fn rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    if mesh.triangles.is_empty() {
        return vec![Ray::new([0.0; 3], [1.0, 0.0, 0.0])];
    }
    let mut rays = vec![];
    for (class, seed) in Grazing::ALL.into_iter().zip(20..) {
        rays.extend(grazing(mesh, class, n, seed).into_iter().map(|ray| Ray {
            origin: ray.origin,
            direction: ray.direction,
            t_min: 0.0,
            t_max: ray.t_max,
        }));
    }
    // Signs of zero and powers of two in the direction's length must not matter.
    let variants: Vec<Ray> = rays
        .iter()
        .step_by(5)
        .map(|ray| Ray { direction: ray.direction.map(|d| if d == 0.0 { -0.0 } else { d * 2.0f32.powi(-40) }), ..*ray })
        .collect();
    rays.extend(variants);
    rays
}

fn agrees<K: Kernel>(name: &str, mesh: &Mesh, configs: &[VolumeConfig], n: usize) {
    let rays = rays(mesh, n);
    let records = brute::records::<K>(&mesh.positions, &mesh.triangles);
    let wants: Vec<_> = rays.iter().map(|ray| brute::closest_hit::<K>(&records, ray)).collect();
    for &volumes in configs {
        let config = BuildConfig { bits: Bits::B63, volumes };
        let blas = Bvh2::<K>::build(&mesh.positions, &mesh.triangles, &config).unwrap();
        for (ray, want) in rays.iter().zip(&wants) {
            let got = blas.closest_hit(ray);
            assert_eq!(got, *want, "{name}, {volumes:?}, {ray:?}");
            assert_eq!(blas.occluded(ray), want.is_some(), "{name}, {volumes:?}, {ray:?}");
        }
    }
}

fn every_strategy() -> Vec<VolumeConfig> {
    Strategy::ALL
        .into_iter()
        .flat_map(|strategy| [true, false].map(|fallback| VolumeConfig { strategy, fallback }))
        .collect()
}

#[test]
fn watertight_loses_no_hit() {
    for case in scenes::cases() {
        agrees::<Watertight>(&case.name, &case.mesh, &every_strategy(), 40);
    }
}

#[test]
fn moller_trumbore_loses_no_hit() {
    for case in scenes::cases() {
        agrees::<MollerTrumbore>(&case.name, &case.mesh, &every_strategy(), 15);
    }
}

#[test]
fn baldwin_weber_loses_no_hit() {
    for case in scenes::cases() {
        agrees::<BaldwinWeber>(&case.name, &case.mesh, &every_strategy(), 15);
    }
}

#[test]
fn scales_by_powers_of_two_change_no_bit() {
    let mesh = &scenes::shapes()[0].mesh;
    let config = BuildConfig {
        volumes: VolumeConfig { strategy: Strategy::Combined, fallback: true },
        ..BuildConfig::default()
    };
    let hits = |exponent: i32| -> Vec<_> {
        let scale = 2.0f32.powi(exponent);
        let positions: Vec<_> = mesh.positions.iter().map(|p| p.map(|x| x * scale)).collect();
        let blas = Bvh2::<Watertight>::build(&positions, &mesh.triangles, &config).unwrap();
        let scaled = |ray: &Ray| Ray { origin: ray.origin.map(|x| x * scale), ..*ray };
        let mut counts = Counts::default();
        let hits: Vec<_> = rays(mesh, 50)
            .iter()
            .map(|ray| {
                blas.closest_hit_with(&scaled(ray), InstanceId(0), &mut counts)
                    .map(|h| (h.t / scale, h.u, h.v, h.primitive))
            })
            .collect();
        assert!(hits.iter().flatten().count() > 100);
        hits
    };
    for exponent in [-40, -20, 20, 40] {
        assert_eq!(hits(exponent), hits(0), "2^{exponent}");
    }
}

#[test]
fn traversal_does_fewer_tests_than_the_loop() {
    let mesh = &scenes::shapes()[2].mesh;
    let blas = Bvh2::<Watertight>::build(&mesh.positions, &mesh.triangles, &BuildConfig::default()).unwrap();
    let rays = rays(mesh, 100);
    let (mut closest, mut any) = (Counts::default(), Counts::default());
    for ray in &rays {
        blas.closest_hit_with(ray, InstanceId(0), &mut closest);
        blas.occluded_with(ray, InstanceId(0), &mut any);
    }
    let all = (rays.len() * mesh.triangles.len()) as u64;
    assert!(closest.triangles * 10 < all, "{closest:?} of {all}");
    assert!(any.triangles <= closest.triangles, "{any:?} {closest:?}");
}

/// Rejects every hit, so that the query reports all of them.
#[derive(Default)]
struct Collect(Vec<Hit>);

impl Query for Collect {
    fn accepts(&mut self, hit: &Hit) -> bool {
        self.0.push(*hit);
        false
    }
}

fn build(mesh: &Mesh, strategy: Strategy) -> Bvh2<Watertight> {
    let volumes = VolumeConfig { strategy, fallback: true };
    Bvh2::build(&mesh.positions, &mesh.triangles, &BuildConfig { volumes, ..BuildConfig::default() }).unwrap()
}

#[test]
fn certain_hits_are_found_and_certain_misses_are_not() {
    for (name, mesh) in meshes() {
        let mut tally = Tally::default();
        for (strategy, seed) in Strategy::ALL.into_iter().zip(70..) {
            let blas = build(&mesh, strategy);
            for ray in reference::rays(&mesh, 60, seed) {
                let mut all = Collect::default();
                assert_eq!(blas.closest_hit_with(&ray, InstanceId(0), &mut all), None);
                compare(&mesh, &ray, &all.0, &mut tally).unwrap_or_else(|e| panic!("{name}, {strategy:?}: {e}"));
            }
        }
        let Tally { n_pierced, n_missed, n_open } = tally;
        assert!(n_missed > 1000 && n_open < n_pierced + n_missed, "{name}: {tally:?}");
        // Slivers are so thin that rounding may always move the ray off them.
        assert_eq!(n_pierced > 100, name != "slivers", "{name}: {tally:?}");
    }
}

#[test]
fn the_closest_hit_is_the_nearest_of_all_hits() {
    for (name, mesh) in meshes() {
        let blas = build(&mesh, Strategy::Dop);
        for ray in reference::rays(&mesh, 60, 5) {
            let hit = blas.closest_hit(&ray);
            let mut all = Collect::default();
            blas.closest_hit_with(&ray, InstanceId(0), &mut all);
            let least = all.0.into_iter().reduce(|a, b| if b.before(&a) { b } else { a });
            assert_eq!(hit, least, "{name}: {ray:?}");
        }
    }
}

#[test]
fn a_vertex_moved_by_a_hundred_margins_is_detected() {
    for (name, mesh) in meshes() {
        let mut n_seen = 0;
        for ray in reference::rays(&mesh, 300, 6) {
            let blas = build(&mesh, Strategy::Aabb);
            let mut all = Collect::default();
            blas.closest_hit_with(&ray, InstanceId(0), &mut all);
            let mut moved = mesh.clone();
            let by = 100.0 * margin(&ray, &corners(&mesh, &mesh.triangles[0])).along;
            moved.positions.iter_mut().for_each(|p| *p = p.map(|x| x + by));
            n_seen += usize::from(compare(&moved, &ray, &all.0, &mut Tally::default()).is_err());
        }
        assert!(n_seen > 10, "{name}: {n_seen} moved meshes were seen");
    }
}

fn holds(name: &str, mesh: &Mesh) {
    let (corners, bounds) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let obvhs = canted_renderer::obvhs_tree(&corners, obvhs::BvhBuildParams::fast_build()).unwrap();
    let boxes: Vec<_> = corners.iter().map(Leaf::aabb).collect();
    let records = brute::records::<Watertight>(&mesh.positions, &mesh.triangles);
    for (builder, tree) in
        [("ploc", canted_sah::build(&boxes, &bounds, &canted_sah::Builder::default())), ("obvhs", obvhs)]
    {
        let leaves = in_leaf_order(&corners, &tree.leaves);
        for strategy in [Strategy::Aabb, Strategy::PcaUnbounded, Strategy::Combined, Strategy::Dop] {
            let config = VolumeConfig { strategy, fallback: true };
            let fitted = volumes(&tree, &leaves, &config);
            check(&tree, &fitted, &leaves).unwrap_or_else(|flaw| panic!("{name}, {builder}, {strategy:?}: {flaw}"));
            let config = BuildConfig { volumes: config, ..BuildConfig::default() };
            let blas = Bvh2::<Watertight>::over(tree.clone(), &corners, &bounds, &config);
            for class in Grazing::ALL {
                for ray in grazing(mesh, class, 6, 9) {
                    let ray = Ray { origin: ray.origin, direction: ray.direction, t_min: 0.0, t_max: ray.t_max };
                    let want = brute::closest_hit::<Watertight>(&records, &ray);
                    let got = blas.closest_hit(&ray);
                    assert_eq!(got, want, "{name}, {builder}, {strategy:?}, {ray:?}");
                }
            }
        }
    }
}

#[test]
fn trees_of_other_builders_are_valid_and_lose_no_hit() {
    holds("soup", &soup(4, 9_000));
    holds("outlier", &outlier(9_000));
    holds("slivers", &slivers(5, 9_000));
    holds("fan", &fan(6_000));
}
