//! Builders of binary trees, and the entry point to all of them: on soups, grids, lattices, needles, duplicates and boxes of any
//! scale. Not covered: traced rays.

mod grouped;
mod reinsertion;
mod spatial;
mod top_down;

use canted_fixtures::{self as fixtures, Mesh};
use canted_lbvh::{
    Bits, Corners, Costs, Domain, Flaw, Leaf, Sorted, Stats, Tree, TreeCost, VolumeConfig, check, in_leaf_order,
    morton_codes, radix, sort_by_code, tree_cost, triangle_corners, volumes,
};
use canted_obb::Aabb;
use canted_sah::{Builder, PlocConfig, ReinsertConfig, Split, TopDownConfig, build};

const BUILDERS: [Builder; 8] = [
    Builder::Lbvh,
    Builder::Hybrid,
    Builder::Reinserted(ReinsertConfig::FAST),
    Builder::FAST,
    Builder::BALANCED,
    Builder::QUALITY,
    Builder::TopDown(TopDownConfig::BINNED, None),
    Builder::TopDown(TopDownConfig { split: Split::Sweep, ..TopDownConfig::BINNED }, Some(ReinsertConfig::BALANCED)),
];

fn bounds(boxes: &[Aabb]) -> Aabb {
    boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb))
}

#[test]
fn every_builder_handles_degenerate_meshes() {
    for (name, corners) in degenerate() {
        let boxes = boxes(&corners);
        for builder in BUILDERS {
            let (stats, _) = checked(&build(&boxes, &bounds(&boxes), &builder), &boxes);
            assert_eq!(stats.n_leaves, boxes.len(), "{name}, {builder:?}");
        }
    }
    for builder in BUILDERS {
        for n in 0..3 {
            let boxes = boxes(&corners(&fixtures::soup(1, n)));
            checked(&build(&boxes, &bounds(&boxes), &builder), &boxes);
        }
    }
}

#[test]
fn slower_presets_have_lower_cost() {
    for mesh in [fixtures::scaffold(1, true), fixtures::truss(4)] {
        let boxes = boxes(&corners(&mesh));
        let cost = |builder: &Builder| checked(&build(&boxes, &bounds(&boxes), builder), &boxes).1.sah;
        let [lbvh, hybrid, fast, balanced, quality] =
            [Builder::Lbvh, Builder::Hybrid, Builder::FAST, Builder::BALANCED, Builder::QUALITY]
                .map(|builder| cost(&builder));
        assert!(fast < lbvh && balanced < fast && quality < balanced, "{lbvh} {fast} {balanced} {quality}");
        assert!(hybrid < lbvh, "{hybrid}, {lbvh} without the top");
        let near = Builder::Ploc(PlocConfig::NEAR, Some(ReinsertConfig::FAST));
        assert!(cost(&near) < fast);
    }
}

/// Corners of the triangles of a mesh.
pub(crate) fn corners(mesh: &Mesh) -> Vec<Corners> {
    triangle_corners(&mesh.positions, &mesh.triangles).unwrap().0
}

pub(crate) fn boxes(corners: &[Corners]) -> Vec<Aabb> {
    corners.iter().map(Leaf::aabb).collect()
}

/// A triangle with the given bounding box, to check trees over boxes.
pub(crate) fn diagonals(boxes: &[Aabb]) -> Vec<Corners> {
    boxes.iter().map(|aabb| [aabb.min, aabb.max, aabb.min]).collect()
}

/// Checks a tree with axis-aligned volumes and computes its cost.
pub(crate) fn weigh(tree: &Tree, boxes: &[Aabb]) -> Result<(Stats, TreeCost), Flaw> {
    let leaves = in_leaf_order(&diagonals(boxes), &tree.leaves);
    let volumes = volumes(tree, &leaves, &VolumeConfig::default());
    let stats = check(tree, &volumes, &leaves)?;
    Ok((stats, tree_cost(tree, &volumes, &leaves, &Costs::default(), 1.0)))
}

#[track_caller]
pub(crate) fn checked(tree: &Tree, boxes: &[Aabb]) -> (Stats, TreeCost) {
    weigh(tree, boxes).unwrap_or_else(|flaw| panic!("{flaw}"))
}

/// Difficult meshes: duplicates, flat ones, points, chains, distant, tiny and huge ones, both zeros.
pub(crate) fn degenerate() -> Vec<(String, Vec<Corners>)> {
    let soup = corners(&fixtures::soup(6, 1_500));
    let mapped = |map: &dyn Fn(f32) -> f32| soup.iter().map(|c| c.map(|p| p.map(map))).collect::<Vec<_>>();
    let meshes = [
        ("outlier", fixtures::outlier(2_000)),
        ("slivers", fixtures::slivers(2, 2_000)),
        ("fan", fixtures::fan(2_000)),
        ("coplanar", fixtures::coplanar_quads(25)),
        ("identical", fixtures::identical(1_000)),
        ("grid", fixtures::grid(3, [30, 30])),
    ];
    let mut all: Vec<_> = meshes.iter().map(|(name, mesh)| ((*name).to_owned(), corners(mesh))).collect();
    for (scale, offset) in [(1.0, 1e7), (1e-30, 0.0), (1e30, 0.0), (1e-44, 0.0), (0.0, 5.0), (-0.0, -0.0), (3e38, 0.0)]
    {
        all.push((format!("soup * {scale} + {offset}"), mapped(&|x| (scale * x + offset).clamp(f32::MIN, f32::MAX))));
    }
    // On a line, closer and closer to one end: each half of the extent separates one.
    let line = |i: i32| 2.0f32.powi(-i);
    all.push(("chain".into(), (0..140).map(|i| [[line(i), 0.0, -0.0]; 3]).collect()));
    all.push(("zeros".into(), (0..50).map(|i| [[if i % 2 == 0 { 0.0 } else { -0.0 }; 3]; 3]).collect()));
    // Concentric, each larger than the previous one.
    all.push(("nested".into(), (1..500u16).map(f32::from).map(|r| [[-r; 3], [r; 3], [r, -r, r]]).collect()));
    all
}

/// Triangles sorted by Morton code.
pub(crate) fn sorted(corners: &[Corners]) -> Sorted {
    let bounds = Aabb::from_points(corners.iter().flatten().copied());
    let domain = Domain::new(&bounds, 3, Bits::B63);
    sort_by_code(&morton_codes(&domain, corners), Bits::B63)
}

/// The radix tree over triangles.
pub(crate) fn radix_tree(corners: &[Corners]) -> Tree {
    radix(sorted(corners))
}

/// The boxes of the leaves of a tree, in leaf order.
pub(crate) fn leaf_boxes(tree: &Tree, corners: &[Corners]) -> Vec<Aabb> {
    in_leaf_order(corners, &tree.leaves).iter().map(Leaf::aabb).collect()
}

/// Checks the tree with axis-aligned volumes and computes its cost.
pub(crate) fn checked_triangles(tree: &Tree, corners: &[Corners]) -> (Stats, TreeCost) {
    let leaves = in_leaf_order(corners, &tree.leaves);
    let volumes = volumes(tree, &leaves, &VolumeConfig::default());
    let stats = check(tree, &volumes, &leaves).unwrap_or_else(|flaw| panic!("{flaw}"));
    (stats, tree_cost(tree, &volumes, &leaves, &Costs::default(), 1.0))
}
