//! Grazing rays compared with exact arithmetic: certain hits are found, certain misses are not hit.
//!
//! Each ray collects every triangle that the BVH offers; exact arithmetic classifies each triangle as hit or missed for every
//! displacement that rounding may cause. Every strategy, offsets of 1e7, scales 1e-20 and 1e15. Not covered here: rays within
//! the margin, which only `watertight.rs` tests; instances, for which `instances.rs` has bounds.

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::Mesh;
use canted_lbvh::{Strategy, VolumeConfig};
use canted_tests::reference::{Tally, compare, corners, margin, meshes, rays};
use canted_trace::{Hit, InstanceId, Query, Watertight};

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
            for ray in rays(&mesh, 60, seed) {
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
        for ray in rays(&mesh, 60, 5) {
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
        for ray in rays(&mesh, 300, 6) {
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
