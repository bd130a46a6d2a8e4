//! Grazing rays compared with exact arithmetic: certain hits are found, certain misses are not hit.
//!
//! The same as `exact.rs` for binary BVHs; all hits are requested.

use canted_tests::reference::{Tally, compare, corners, margin, meshes, rays};
use canted_trace::Watertight;

use super::setup::{build, few_variants, paths};

#[test]
fn certain_hits_are_found_and_certain_misses_are_not() {
    for (name, mesh) in meshes() {
        let mut tally = Tally::default();
        let mut hits = vec![];
        for ((variant, config), seed) in few_variants().iter().zip(170..) {
            for (path, seed) in paths().0.into_iter().zip((10 * seed)..) {
                let tree = build::<Watertight>(&mesh, config).with_path(path);
                for ray in rays(&mesh, 40, seed) {
                    tree.all_hits(&ray, &mut hits);
                    compare(&mesh, &ray, &hits, &mut tally)
                        .unwrap_or_else(|error| panic!("{name}, {variant}, {}: {error}", path.name()));
                    assert_eq!(tree.closest_hit(&ray), hits.first().copied(), "{name}, {variant}, {ray:?}");
                }
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
        let tree = build::<Watertight>(&mesh, &few_variants()[1].1);
        let mut n_seen = 0;
        let mut hits = vec![];
        for ray in rays(&mesh, 200, 6) {
            tree.all_hits(&ray, &mut hits);
            let mut moved = mesh.clone();
            let by = 100.0 * margin(&ray, &corners(&mesh, &mesh.triangles[0])).along;
            moved.positions.iter_mut().for_each(|p| *p = p.map(|x| x + by));
            n_seen += usize::from(compare(&moved, &ray, &hits, &mut Tally::default()).is_err());
        }
        assert!(n_seen > 10, "{name}: {n_seen} moved meshes were seen");
    }
}
