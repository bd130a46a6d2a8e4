//! Trees improved by reinsertion: on soups, grids, lattices, needles, duplicates and boxes of any scale. Costs compared with the medium
//! trees of `obvhs`, which also use reinsertion.

use std::{path::PathBuf, time::Duration};

use canted_fixtures as fixtures;
use canted_lbvh::{Child, ChildKind, Corners, NodeId, Tree};
use canted_obb::{Aabb, PrimId};
use canted_sah::{PlocConfig, ReinsertConfig, reinsert};
use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2};
use proptest::prelude::*;

use crate::{checked_triangles, corners, grouped::ploc_tree, leaf_boxes, radix_tree};

/// Relative error of a sum of `n` positive `f64` terms, each with a few roundings, in another order.
fn sum_error(n: usize) -> f64 {
    (n + 8) as f64 * f64::EPSILON
}

/// Improves a tree and checks all guarantees; returns the cost before and after.
fn improved(tree: &Tree, corners: &[Corners], config: &ReinsertConfig) -> (f64, f64) {
    let better = reinsert(tree, &leaf_boxes(tree, corners), config);
    let ((before, cost), (after, new_cost)) = (checked_triangles(tree, corners), checked_triangles(&better, corners));
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
    checked_triangles(&better, &corners);
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

/// Maximum cost relative to the baseline.
const MAX_RATIO: f64 = 1.05;

fn obvhs_tree(corners: &[Corners]) -> Tree {
    let boxes: Vec<_> =
        corners.iter().map(|c| obvhs::aabb::Aabb::from_points(&c.map(glam::Vec3A::from_array))).collect();
    let params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
    let bvh = build_bvh2(&boxes, params, &mut Duration::default());
    let (mut children, mut inner) = (vec![], vec![0]);
    while let Some(&node) = inner.get(children.len()) {
        let first = bvh.nodes[node as usize].first_index;
        children.push([first, first + 1].map(|child| {
            let node = &bvh.nodes[child as usize];
            if node.is_leaf() {
                return Child::leaf(bvh.primitive_indices[node.first_index as usize]);
            }
            inner.push(child);
            Child::inner(NodeId(u32::try_from(inner.len()).unwrap() - 1))
        }));
    }
    Tree::from_children(&children).unwrap()
}

/// Sum of the areas of the inner nodes over that of the root.
fn cost(tree: &Tree, corners: &[Corners]) -> f64 {
    let leaves = leaf_boxes(tree, corners);
    let mut boxes = vec![Aabb::EMPTY; tree.nodes.len()];
    for &id in &tree.bottom_up {
        let node = tree.nodes[id.index()];
        let [left, right] = [node.left, node.right].map(|child| match child.kind() {
            ChildKind::Leaf(position) => leaves[position as usize],
            ChildKind::Inner(below) => boxes[below.index()],
        });
        boxes[id.index()] = left.union(right);
    }
    boxes.iter().map(Aabb::area).sum::<f64>() / boxes[0].area()
}

fn compare(corners: &[Corners]) {
    let tree = ploc_tree(corners, &PlocConfig::default());
    let ours = cost(&reinsert(&tree, &leaf_boxes(&tree, corners), &ReinsertConfig::FAST), corners);
    let baseline = cost(&obvhs_tree(corners), corners);
    assert!(ours <= MAX_RATIO * baseline, "{ours} vs {baseline}");
}

#[test]
fn near_the_baseline_on_terrain() {
    compare(&corners(&fixtures::grid(5, [120, 120])));
}

/// Triangles of the Sponza OBJ file if it is available.
fn sponza() -> Option<Vec<Corners>> {
    let folder = std::env::var_os("CANTED_SCENES")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes")), PathBuf::from);
    let text = std::fs::read(folder.join("sponza/sponza.obj")).ok()?;
    let (mut points, mut triangles) = (vec![], vec![]);
    for line in String::from_utf8_lossy(&text).lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let xyz: Vec<f32> = words.map(|word| word.parse().unwrap()).collect();
                points.push([xyz[0], xyz[1], xyz[2]]);
            }
            Some("f") => {
                let index = |word: &str| word.split('/').next().unwrap().parse::<usize>().unwrap() - 1;
                let face: Vec<_> = words.map(|word| points[index(word)]).collect();
                triangles.extend((2..face.len()).map(|i| [face[0], face[i - 1], face[i]]));
            }
            _ => {}
        }
    }
    Some(triangles)
}

#[test]
fn near_the_baseline_on_sponza() {
    match sponza() {
        Some(corners) => compare(&corners),
        None => assert!(std::env::var_os("CANTED_SCENES").is_none(), "no sponza/sponza.obj in CANTED_SCENES"),
    }
}
