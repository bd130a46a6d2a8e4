use canted_fixtures as fixtures;
use canted_lbvh::{Child, Corners, NodeId, Tree};
use canted_obb::PrimId;
use canted_sah::{ReinsertConfig, reinsert};
use proptest::prelude::*;

use crate::build::{checked, corners, leaf_boxes, radix_tree};

/// Relative error of a sum of `n` positive `f64` terms, each with a few roundings, in another order.
fn sum_error(n: usize) -> f64 {
    (n + 8) as f64 * f64::EPSILON
}

/// Improves a tree and checks all guarantees; returns the cost before and after.
fn improved(tree: &Tree, corners: &[Corners], config: &ReinsertConfig) -> (f64, f64) {
    let better = reinsert(tree, &leaf_boxes(tree, corners), config);
    let ((before, cost), (after, new_cost)) = (checked(tree, corners), checked(&better, corners));
    assert_eq!(before.n_leaves, after.n_leaves);
    assert!(after.depth <= before.depth.max(96), "depth {} grew to {}", before.depth, after.depth);
    let bound = cost.sah * (1.0 + sum_error(2 * corners.len()));
    assert!(new_cost.sah <= bound, "cost {} rose to {}", cost.sah, new_cost.sah);
    (cost.sah, new_cost.sah)
}

#[test]
fn degenerate_meshes_stay_valid_without_more_cost() {
    let meshes = [
        fixtures::outlier(2_000),
        fixtures::soup(1, 3_000),
        fixtures::slivers(2, 3_000),
        fixtures::fan(2_000),
        fixtures::coplanar_quads(1_000),
        fixtures::grid(3, [40, 40]),
    ];
    for mesh in &meshes {
        let corners = corners(mesh);
        for config in [ReinsertConfig::FAST, ReinsertConfig::BALANCED] {
            improved(&radix_tree(&corners), &corners, &config);
        }
    }
}

#[test]
fn few_primitives() {
    for n in 0..20 {
        let corners = corners(&fixtures::soup(u64::from(n), n));
        improved(&radix_tree(&corners), &corners, &ReinsertConfig { iterations: 8, fraction: 1.0, min_gain: 0.0 });
    }
}

/// With equal boxes no move reduces the cost, so the tree is unchanged.
#[test]
fn duplicates_are_unchanged() {
    let corners = corners(&fixtures::identical(100_000));
    let tree = radix_tree(&corners);
    assert_eq!(reinsert(&tree, &leaf_boxes(&tree, &corners), &ReinsertConfig::BALANCED), tree);
}

#[test]
fn same_bits_on_any_number_of_threads() {
    let corners = corners(&fixtures::scaffold(1, false));
    let tree = radix_tree(&corners);
    let boxes = leaf_boxes(&tree, &corners);
    let on = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| reinsert(&tree, &boxes, &ReinsertConfig::FAST))
    };
    let one = on(1);
    assert_ne!(one, tree);
    assert_eq!(one, on(2));
    assert_eq!(one, on(4));
}

/// Scaling by a power of two is exact, so it changes no decision.
#[test]
fn same_tree_at_any_power_of_two() {
    let corners = corners(&fixtures::soup(5, 2_000));
    let tree = radix_tree(&corners);
    let at = |exponent: i32| {
        let scaled: Vec<_> = corners.iter().map(|c| c.map(|p| p.map(|x| x * 2.0f32.powi(exponent)))).collect();
        reinsert(&tree, &leaf_boxes(&tree, &scaled), &ReinsertConfig::BALANCED)
    };
    let one = at(0);
    assert_ne!(one, tree);
    for exponent in [-60, -20, 20, 60, 120] {
        assert_eq!(at(exponent), one, "at 2^{exponent}");
    }
}

#[test]
fn far_from_the_origin_and_at_extreme_scales() {
    let near = corners(&fixtures::soup(6, 2_000));
    for (scale, offset) in [(1.0, 1e7), (1e20, 0.0), (1e-20, -0.0), (1e-38, 0.0), (1e38, 0.0), (1e-44, 0.0), (0.0, 5.0)]
    {
        let corners: Vec<Corners> = near.iter().map(|c| c.map(|p| p.map(|x| scale * x + offset))).collect();
        improved(&radix_tree(&corners), &corners, &ReinsertConfig::BALANCED);
    }
}

/// A chain of `n` primitives along a line, in an order unrelated to space.
fn chain(n: u32) -> Tree {
    let children: Vec<_> = (0..n - 1)
        .map(|i| [Child::leaf(i), if i + 2 < n { Child::inner(NodeId(i + 1)) } else { Child::leaf(i + 1) }])
        .collect();
    Tree::from_children(&children).unwrap()
}

/// A random order costs about the depth of the tree times as much as a spatial order.
#[test]
fn improves_a_bad_tree() {
    let corners = corners(&fixtures::soup(7, 1_000));
    let (before, after) =
        improved(&chain(1_000), &corners, &ReinsertConfig { iterations: 20, fraction: 1.0, min_gain: 0.0 });
    let (radix, _) = improved(&radix_tree(&corners), &corners, &ReinsertConfig::FAST);
    assert!(10.0 * radix < before && after < 2.0 * radix, "{before} to {after} where the radix tree has {radix}");
}

/// Sabotage: a tree without one primitive is rejected.
#[test]
#[should_panic(expected = "is not in exactly one leaf")]
fn a_missing_primitive_is_detected() {
    let corners = corners(&fixtures::soup(8, 50));
    let tree = radix_tree(&corners);
    let mut better = reinsert(&tree, &leaf_boxes(&tree, &corners), &ReinsertConfig::FAST);
    better.leaves[0] = PrimId(better.leaves[1].0);
    checked(&better, &corners);
}

#[test]
#[should_panic(expected = "one box for each leaf")]
fn rejects_a_wrong_number_of_boxes() {
    let corners = corners(&fixtures::soup(8, 5));
    let tree = radix_tree(&corners);
    let _ = reinsert(&tree, &leaf_boxes(&tree, &corners)[1..], &ReinsertConfig::FAST);
}

proptest! {
    #[test]
    fn any_few_triangles_on_a_coarse_grid(
        cells in prop::collection::vec(prop::array::uniform9(-3i8..4), 0..60),
        share in 0.0f32..1.5,
    ) {
        let corners: Vec<Corners> = cells
            .iter()
            .map(|c| std::array::from_fn(|i| std::array::from_fn(|k| f32::from(c[3 * i + k]) * 0.25)))
            .collect();
        improved(&radix_tree(&corners), &corners, &ReinsertConfig { iterations: 5, fraction: share, min_gain: 0.0 });
    }
}
