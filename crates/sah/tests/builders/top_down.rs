use canted_fixtures as fixtures;
use canted_lbvh::{ChildKind, NodeId, Tree};
use canted_obb::Aabb;
use canted_sah::{Axes, Split, TopDownConfig, top_down};
use proptest::prelude::*;

use crate::{boxes, checked, corners, degenerate, weigh};

const SPLITS: [Split; 5] = [
    Split::Midpoint,
    Split::Median,
    Split::Sweep,
    Split::Binned { bins: 32, sweep_threshold: 16 },
    Split::Binned { bins: 7, sweep_threshold: 0 },
];

/// Every split method with every choice of axes.
fn configs() -> impl Iterator<Item = TopDownConfig> {
    SPLITS.into_iter().flat_map(|split| {
        [Axes::Longest, Axes::Cyclic, Axes::All].map(|axes| TopDownConfig { split, axes, max_depth: 96 })
    })
}

#[test]
fn handles_degenerate_meshes() {
    for (name, corners) in degenerate() {
        let boxes = boxes(&corners);
        for config in configs() {
            let (stats, _) = checked(&top_down(&boxes, &config), &boxes);
            assert_eq!(stats.n_leaves, boxes.len(), "{name}, {config:?}");
            assert!(stats.depth <= 96, "{name}, {config:?}: depth {}", stats.depth);
        }
    }
}

#[test]
fn few_primitives() {
    for n in 0..40 {
        let boxes = boxes(&corners(&fixtures::soup(u64::from(n), n)));
        for config in configs() {
            checked(&top_down(&boxes, &config), &boxes);
        }
    }
}

#[test]
fn equal_boxes_are_halved() {
    for (n, depth) in [(1_000, 1 + 10), (100_000, 1 + 17)] {
        let boxes = boxes(&corners(&fixtures::identical(n)));
        for config in configs() {
            assert_eq!(top_down(&boxes, &config).depth, depth, "{n}, {config:?}");
        }
    }
}

/// Boxes that halve in size towards a corner, which SAH splits off one by one.
#[test]
fn the_depth_limit_holds() {
    let boxes: Vec<_> = (0..120).map(|i| 2.0f32.powi(-i)).map(|x| Aabb { min: [x; 3], max: [1.5 * x; 3] }).collect();
    let config = |max_depth| TopDownConfig { split: Split::Midpoint, axes: Axes::Longest, max_depth };
    assert!(top_down(&boxes, &config(u32::MAX)).depth > 96, "no chain without the limit");
    for max_depth in [0, 8, 9, 30, 96] {
        let (stats, _) = checked(&top_down(&boxes, &config(max_depth)), &boxes);
        assert!(stats.depth <= max_depth.max(1 + 7), "{} beyond {max_depth}", stats.depth);
    }
}

#[test]
fn same_bits_on_any_number_of_threads() {
    let boxes = boxes(&corners(&fixtures::scaffold(1, false)));
    let on = |n: usize, config: &TopDownConfig| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| top_down(&boxes, config))
    };
    for config in configs() {
        let one = on(1, &config);
        assert_eq!(one, on(2, &config), "{config:?}");
        assert_eq!(one, on(5, &config), "{config:?}");
    }
}

/// Numbers, order and tasks are those of the same topology renumbered by `canted-lbvh`.
#[test]
fn numbering_equals_that_of_from_children() {
    for n in [2, 3, 100, 9_000] {
        let boxes = boxes(&corners(&fixtures::soup(3, n)));
        let tree = top_down(&boxes, &TopDownConfig::BINNED);
        let mut children = vec![];
        let mut inner = vec![NodeId::ROOT];
        while let Some(&id) = inner.get(children.len()) {
            let node = tree.nodes[id.index()];
            children.push([node.left, node.right].map(|child| match child.kind() {
                ChildKind::Leaf(position) => canted_lbvh::Child::leaf(tree.leaves[position as usize].0),
                ChildKind::Inner(below) => {
                    inner.push(below);
                    canted_lbvh::Child::inner(NodeId(u32::try_from(inner.len()).unwrap() - 1))
                }
            }));
        }
        let again = Tree::from_children(&children).unwrap();
        assert_eq!((&tree.nodes, &tree.leaves, tree.depth), (&again.nodes, &again.leaves, again.depth));
        let leaves = |tree: &Tree| tree.tasks.iter().map(|task| task.leaves.clone()).collect::<Vec<_>>();
        assert_eq!(leaves(&tree), leaves(&again));
        for task in &tree.tasks {
            assert!(tree.bottom_up[task.nodes.clone()].iter().all(|id| task.leaves.contains(&id.0)));
        }
    }
}

/// Maximum ratio of the costs of binned and sweep builds; both are greedy, so neither is a bound of the other.
const MAX_RATIO: f64 = 1.04;

#[test]
fn more_bins_reduce_the_cost() {
    let meshes =
        [fixtures::soup(4, 4_000), fixtures::grid(5, [60, 60]), fixtures::scaffold(1, false), fixtures::truss(4)];
    for mesh in &meshes {
        let boxes = boxes(&corners(mesh));
        let cost = |split| {
            let config = TopDownConfig { split, ..TopDownConfig::BINNED };
            checked(&top_down(&boxes, &config), &boxes).1.sah
        };
        let [midpoint, median, sweep, binned, coarse] = SPLITS.map(cost);
        assert!(sweep <= MAX_RATIO * binned, "{sweep} swept, {binned} binned");
        assert!(binned <= MAX_RATIO * sweep, "{sweep} swept, {binned} binned");
        assert!(binned < midpoint.min(median), "{binned} in cells, {midpoint} midpoint, {median} median");
        assert!(binned <= MAX_RATIO * coarse, "{binned} with 32 bins, {coarse} with 7");
    }
}

/// Half area of integer boxes, exact.
fn half_area(boxes: &[&Aabb]) -> f64 {
    let all = boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(**aabb));
    0.5 * all.area()
}

/// The least cost of all planes between two centers, by trying each.
fn best_of_all(boxes: &[Aabb]) -> f64 {
    let mut best = f64::INFINITY;
    for axis in 0..3 {
        let mut ordered: Vec<_> = boxes.iter().collect();
        ordered.sort_by(|a, b| a.center()[axis].total_cmp(&b.center()[axis]));
        for n in 1..boxes.len() {
            let (left, right) = ordered.split_at(n);
            let cost = half_area(left) * left.len() as f64 + half_area(right) * right.len() as f64;
            best = best.min(cost);
        }
    }
    best
}

/// Cost of the split of the root.
fn root_cost(tree: &Tree, boxes: &[Aabb]) -> f64 {
    let root = tree.nodes[0];
    let n_left = match root.left.kind() {
        ChildKind::Leaf(_) => 1,
        ChildKind::Inner(id) => tree.nodes[id.index()].n_leaves() as usize,
    };
    let all: Vec<_> = tree.leaves.iter().map(|leaf| &boxes[leaf.index()]).collect();
    let (left, right) = all.split_at(n_left);
    half_area(left) * left.len() as f64 + half_area(right) * right.len() as f64
}

proptest! {
    /// Coordinates are small integers and the scale is a power of two, so areas and costs are exact in `f32`.
    #[test]
    fn the_first_split_has_the_least_cost(
        cells in prop::collection::vec((prop::array::uniform3(-20i8..20), prop::array::uniform3(0i8..9)), 3..14),
        sweep in any::<bool>(),
    ) {
        let boxes: Vec<_> = cells.iter().map(|(min, size)| Aabb {
            min: min.map(f32::from),
            max: std::array::from_fn(|k| f32::from(min[k]) + f32::from(size[k])),
        }).collect();
        // The oracle does not try all orders of equal centers.
        let distinct = |axis: usize| {
            let mut centers: Vec<_> = boxes.iter().map(|aabb| aabb.center()[axis].to_bits()).collect();
            centers.sort_unstable();
            centers.windows(2).all(|pair| pair[0] != pair[1])
        };
        prop_assume!((0..3).all(distinct) || boxes.len() > 5);
        let split = if sweep { Split::Sweep } else { TopDownConfig::BINNED.split };
        let config = TopDownConfig { split, ..TopDownConfig::BINNED };
        let (tree, best) = (top_down(&boxes, &config), best_of_all(&boxes));
        let found = root_cost(&tree, &boxes);
        if (0..3).all(distinct) {
            prop_assert_eq!(found, best);
        }
        prop_assert!(found <= half_area(&boxes.iter().collect::<Vec<_>>()) * boxes.len() as f64);
    }
}

/// Sabotage: a tree over other boxes is rejected.
#[test]
fn a_tree_with_a_missing_leaf_is_detected() {
    let boxes = boxes(&corners(&fixtures::soup(9, 100)));
    let mut tree = top_down(&boxes, &TopDownConfig::BINNED);
    tree.leaves[3] = tree.leaves[4];
    assert!(weigh(&tree, &boxes).is_err());
}
