//! Grazing rays compared with exact arithmetic: certain hits are found, certain misses are not hit.
//!
//! Exact arithmetic classifies each triangle as hit or missed for every displacement that rounding may cause. Binary BVHs of every
//! strategy and wide ones of every preset and SIMD path, offsets of 1e7, scales 1e-20 and 1e15. Not covered here: rays within the
//! margin, which only `watertight.rs` tests; instances, for which `instances/geometry.rs` has bounds.

use canted_tests::{
    brute::in_order,
    reference::{Tally, compare, corners, margin, meshes, rays},
    variants::every_bvh,
};
use canted_trace::{Accept, Hit, Intersect};

#[test]
fn certain_hits_are_found_and_certain_misses_are_not() {
    for (name, mesh) in meshes() {
        let mut tally = Tally::default();
        for ((variant, bvh), seed) in every_bvh(&mesh).iter().zip(70..) {
            let mut hits = vec![];
            for ray in rays(&mesh, 50, seed) {
                bvh.all_hits(&ray, &mut hits);
                compare(&mesh, &ray, &hits, &mut tally).unwrap_or_else(|error| panic!("{name}, {variant}: {error}"));
                assert_eq!(bvh.closest_hit(&ray), hits.first().copied(), "{name}, {variant}, {ray:?}");
                // A query that rejects every hit sees all of them.
                let mut seen: Vec<Hit> = vec![];
                let reject = |hit: &Hit| {
                    seen.push(*hit);
                    false
                };
                assert_eq!(bvh.closest_hit_with(&ray, &mut Accept(reject)), None);
                assert_eq!(in_order(seen), hits, "{name}, {variant}, {ray:?}");
            }
        }
        let Tally { n_pierced, n_missed, n_open } = tally;
        assert!(n_missed > 1000 && n_open < n_pierced + n_missed, "{name}: {tally:?}");
        // Slivers are so thin that rounding may always move the ray off them.
        assert_eq!(n_pierced > 100, name != "slivers", "{name}: {tally:?}");
    }
}

#[test]
fn a_vertex_moved_by_a_hundred_margins_is_detected() {
    for (name, mesh) in meshes() {
        for (variant, bvh) in every_bvh(&mesh).iter().step_by(6) {
            let mut n_seen = 0;
            let mut hits = vec![];
            for ray in rays(&mesh, 200, 6) {
                bvh.all_hits(&ray, &mut hits);
                let by = 100.0 * margin(&ray, &corners(&mesh, &mesh.triangles[0])).along;
                let moved = mesh.placed(|p| p.map(|x| x + by));
                n_seen += usize::from(compare(&moved, &ray, &hits, &mut Tally::default()).is_err());
            }
            assert!(n_seen > 10, "{name}, {variant}: {n_seen} moved meshes were seen");
        }
    }
}
