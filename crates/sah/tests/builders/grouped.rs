use canted_fixtures as fixtures;
use canted_lbvh::{Corners, Leaf, Tree, in_leaf_order};
use canted_obb::Aabb;
use canted_sah::{GroupConfig, GroupSplit, Groups, PlocConfig, ReinsertConfig, grouped, ploc, reinsert};

use crate::{boxes, checked, checked_triangles, corners, degenerate, leaf_boxes, radix_tree, sorted};

const CONFIGS: [GroupConfig; 9] = [
    GroupConfig::DYNAMIC,
    GroupConfig::FAST,
    GroupConfig::BALANCED,
    GroupConfig::QUALITY,
    GroupConfig { improvement: None, ..GroupConfig::FAST },
    GroupConfig { max_group: 1, max_run: 4, ..GroupConfig::DYNAMIC },
    GroupConfig { max_group: 13, max_run: 8, improvement: Some(ReinsertConfig::FAST), ..GroupConfig::DYNAMIC },
    GroupConfig { split: GroupSplit::Binned { bins: 2 }, max_group: 1, max_run: 1, improvement: None },
    GroupConfig {
        split: GroupSplit::Binned { bins: 64 },
        max_group: 32,
        max_run: 8,
        improvement: Some(ReinsertConfig::FAST),
    },
];

/// What is wrong with groups over `n` primitives below a tree.
fn flaw(tree: &Tree, groups: &Groups, n: usize, max_group: usize) -> Option<&'static str> {
    let mut sorted = groups.primitives.clone();
    sorted.sort_unstable();
    if !sorted.iter().map(|primitive| primitive.index()).eq(0..n) {
        return Some("not every primitive once");
    }
    if groups.n_groups() != tree.leaves.len() || groups.starts[0] != 0 || groups.starts[groups.n_groups()] as usize != n
    {
        return Some("groups and leaves differ");
    }
    let sizes = groups.starts.windows(2).map(|ends| ends[1].wrapping_sub(ends[0]) as usize);
    let is_in_order = tree.leaves.iter().map(|leaf| leaf.index()).eq(0..groups.n_groups());
    let are_small = sizes.into_iter().all(|size| (1..=max_group).contains(&size));
    (!is_in_order || !are_small).then_some("groups too large, empty or out of order")
}

/// Every group's box, computed one by one.
fn around(groups: &Groups, boxes: &[Aabb]) -> Vec<Aabb> {
    let members = |ends: &[u32]| groups.primitives[ends[0] as usize..ends[1] as usize].iter();
    let around = |ends: &[u32]| members(ends).fold(Aabb::EMPTY, |all, primitive| all.union(boxes[primitive.index()]));
    groups.starts.windows(2).map(around).collect()
}

#[test]
fn every_primitive_is_in_one_group_of_a_valid_tree() {
    let large = [("scaffold", fixtures::scaffold(1, false)), ("grid", fixtures::grid(2, [120, 90]))];
    let large = large.map(|(name, mesh)| (name.to_owned(), corners(&mesh)));
    let few = (0..4).map(|n| (format!("{n}"), corners(&fixtures::soup(1, n))));
    for (name, corners) in degenerate().into_iter().chain(large).chain(few) {
        let boxes = boxes(&corners);
        for config in CONFIGS {
            let (tree, groups) = grouped(&boxes, &config);
            let max_group = config.max_group as usize;
            assert_eq!(flaw(&tree, &groups, boxes.len(), max_group), None, "{name}, {config:?}");
            assert_eq!(groups.boxes, around(&groups, &boxes), "{name}, {config:?}");
            checked(&tree, &groups.boxes);
        }
    }
}

#[test]
fn the_check_sees_flaws() {
    let boxes = boxes(&corners(&fixtures::soup(3, 100)));
    let (tree, groups) = grouped(&boxes, &GroupConfig::FAST);
    assert_eq!(flaw(&tree, &groups, 100, 8), None);
    assert!(flaw(&tree, &groups, 100, 2).is_some());
    assert!(flaw(&tree, &groups, 101, 8).is_some());
    let mut twice = groups.clone();
    twice.primitives[0] = twice.primitives[1];
    assert!(flaw(&tree, &twice, 100, 8).is_some());
    let mut shifted = groups.clone();
    shifted.starts[1] += 8;
    assert!(flaw(&tree, &shifted, 100, 8).is_some());
    let mut swapped = groups;
    swapped.boxes.swap(0, 1);
    assert_ne!(swapped.boxes, around(&swapped, &boxes));
}

/// The two triangles of each quad are neighbors in the input, and stay so; those of a soup are not kept together.
#[test]
fn neighbors_with_a_small_common_box_stay_together() {
    // Whether primitives 2i and 2i + 1 are in one group, for how many i.
    let n_together = |boxes: &[Aabb], config: &GroupConfig| {
        let groups = grouped(boxes, config).1;
        let mut of = vec![0; boxes.len()];
        for (group, ends) in groups.starts.windows(2).enumerate() {
            for primitive in &groups.primitives[ends[0] as usize..ends[1] as usize] {
                of[primitive.index()] = group;
            }
        }
        of.chunks_exact(2).filter(|pair| pair[0] == pair[1]).count()
    };
    // Two triangles with the same box for each cell of a grid.
    let quads: Vec<Aabb> = (0..100u8)
        .flat_map(|x| (0..90u8).map(move |y| [f32::from(x), f32::from(y), 0.0]))
        .map(|min| Aabb { min, max: [min[0] + 1.0, min[1] + 1.0, 0.25] })
        .flat_map(|quad| [quad; 2])
        .collect();
    let soup = boxes(&corners(&fixtures::soup(5, 18_000)));
    for config in [GroupConfig::DYNAMIC, GroupConfig::FAST, GroupConfig { max_group: 2, ..GroupConfig::FAST }] {
        assert_eq!(n_together(&quads, &config), 9_000, "{config:?}");
        assert!(n_together(&soup, &config) < 900, "{config:?}");
    }
    let apart = GroupConfig { max_group: 1, ..GroupConfig::DYNAMIC };
    assert_eq!(n_together(&quads, &apart), 0, "groups of one");
}

/// What Morton codes cost: no more than half as much again as bins, on scans and terrain.
#[test]
fn trees_by_codes_are_close_to_trees_by_bins() {
    for mesh in [fixtures::grid(4, [120, 100]), fixtures::displaced_icosphere(3, 5)] {
        let boxes = boxes(&corners(&mesh));
        let cost = |config: &GroupConfig| {
            let (tree, groups) = grouped(&boxes, config);
            checked(&tree, &groups.boxes).1.sah
        };
        let [by_codes, by_bins] = [GroupConfig::DYNAMIC, GroupConfig::FAST].map(|config| cost(&config));
        assert!(by_bins < by_codes && by_codes < 1.5 * by_bins, "{by_codes}, {by_bins}");
    }
}

#[test]
fn same_bits_on_any_number_of_threads() {
    let boxes = boxes(&corners(&fixtures::grid(7, [260, 250])));
    let on = |n: usize, config: &GroupConfig| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| grouped(&boxes, config))
    };
    for config in CONFIGS {
        let one = on(1, &config);
        assert!(config.improvement.is_some() || one.0.tasks.len() > 4, "several parts");
        assert_eq!(one, on(2, &config), "{config:?}");
        assert_eq!(one, on(5, &config), "{config:?}");
    }
}

/// Numbers of nodes are those of any other builder with one primitive per group.
#[test]
fn groups_of_one_are_primitives() {
    let boxes = boxes(&corners(&fixtures::scaffold(1, true)));
    let split = GroupSplit::Binned { bins: 32 };
    let config = GroupConfig { split, max_group: 1, max_run: 1, improvement: None };
    let (tree, groups) = grouped(&boxes, &config);
    let tree = Tree { leaves: groups.primitives, ..tree };
    let (stats, cost) = checked(&tree, &boxes);
    assert_eq!(stats.n_leaves, boxes.len());
    let other = canted_sah::top_down(&boxes, &canted_sah::TopDownConfig::BINNED);
    assert!(cost.sah < 1.1 * checked(&other, &boxes).1.sah);
}

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
fn ploc_has_the_same_bits_on_any_number_of_threads() {
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
