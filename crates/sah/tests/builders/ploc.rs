//! Trees built by PLOC.

use canted_fixtures as fixtures;
use canted_lbvh::{Corners, Leaf, Tree, in_leaf_order};
use canted_sah::{PlocConfig, ReinsertConfig, ploc, reinsert};

use crate::inputs::{checked_triangles, corners, leaf_boxes, radix_tree, sorted};

/// The PLOC tree over triangles.
pub(crate) fn ploc_tree(corners: &[Corners], config: &PlocConfig) -> Tree {
    let sorted = sorted(corners);
    let boxes: Vec<_> = in_leaf_order(corners, &sorted.leaves).iter().map(Leaf::aabb).collect();
    ploc(sorted, &boxes, config)
}

#[test]
fn handles_degenerate_meshes() {
    let meshes = [
        fixtures::outlier(2_000),
        fixtures::soup(1, 3_000),
        fixtures::slivers(2, 3_000),
        fixtures::fan(2_000),
        fixtures::coplanar_quads(1_000),
    ];
    for mesh in &meshes {
        let corners = corners(mesh);
        for config in [PlocConfig::default(), PlocConfig { radius: 0, near_iterations: 0 }] {
            checked_triangles(&ploc_tree(&corners, &config), &corners);
        }
    }
}

#[test]
fn few_primitives() {
    for n in 0..40 {
        let corners = corners(&fixtures::soup(u64::from(n), n));
        let (stats, _) = checked_triangles(&ploc_tree(&corners, &PlocConfig::default()), &corners);
        assert_eq!(stats.n_leaves, n as usize);
    }
}

/// Equal boxes pair up in every iteration, so the tree is balanced.
#[test]
fn duplicates_make_a_balanced_tree() {
    let tree = ploc_tree(&corners(&fixtures::identical(100_000)), &PlocConfig::default());
    assert_eq!(tree.depth, 1 + 17);
}

/// Boxes that grow along the curve each prefer the previous one, which would give a chain in quadratic time.
#[test]
fn nested_boxes_make_no_chain() {
    let corners: Vec<Corners> =
        (0..50_000u16).map(|i| f32::from(i) + 1.0).map(|r| [[-r, -r, -r], [r, r, -r], [0.0, 0.0, 2.0 * r]]).collect();
    let tree = ploc_tree(&corners, &PlocConfig::default());
    assert!(tree.depth < 1_000, "depth {}", tree.depth);
}

#[test]
fn same_bits_on_any_number_of_threads() {
    let corners = corners(&fixtures::scaffold(1, false));
    let on = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| ploc_tree(&corners, &PlocConfig::default()))
    };
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one, on(4));
}

/// Costs of the builders on a mesh with much overlap.
#[test]
fn each_stage_reduces_the_cost() {
    let corners = corners(&fixtures::scaffold(1, true));
    let cost = |tree: &Tree| checked_triangles(tree, &corners).1.sah;
    let (radix, ploc) = (radix_tree(&corners), ploc_tree(&corners, &PlocConfig::default()));
    let better = reinsert(&ploc, &leaf_boxes(&ploc, &corners), &ReinsertConfig::FAST);
    let costs = [cost(&radix), cost(&ploc), cost(&better)];
    assert!(costs.is_sorted_by(|a, b| a > b), "{costs:?}");
}
