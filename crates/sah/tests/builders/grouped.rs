use canted_fixtures as fixtures;
use canted_lbvh::Tree;
use canted_obb::Aabb;
use canted_sah::{GroupConfig, Groups, ReinsertConfig, grouped};

use crate::inputs::{boxes, checked, corners, degenerate};

const CONFIGS: [GroupConfig; 6] = [
    GroupConfig::FAST,
    GroupConfig::BALANCED,
    GroupConfig::QUALITY,
    GroupConfig { bins: 16, max_group: 8, improvement: None },
    GroupConfig { bins: 2, max_group: 1, improvement: None },
    GroupConfig { bins: 64, max_group: 32, improvement: Some(ReinsertConfig::FAST) },
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
            let of_groups = groups.boxes(&boxes);
            assert_eq!(of_groups, around(&groups, &boxes), "{name}, {config:?}");
            checked(&tree, &of_groups);
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
    let mut shifted = groups;
    shifted.starts[1] += 8;
    assert!(flaw(&tree, &shifted, 100, 8).is_some());
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
    let (tree, groups) = grouped(&boxes, &GroupConfig { bins: 32, max_group: 1, improvement: None });
    let tree = Tree { leaves: groups.primitives, ..tree };
    let (stats, cost) = checked(&tree, &boxes);
    assert_eq!(stats.n_leaves, boxes.len());
    let other = canted_sah::top_down(&boxes, &canted_sah::TopDownConfig::BINNED);
    assert!(cost.sah < 1.1 * checked(&other, &boxes).1.sah);
}
