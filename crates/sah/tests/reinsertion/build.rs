use canted_fixtures::Mesh;
use canted_lbvh::{
    Bits, Corners, Costs, Domain, Leaf, Sorted, Stats, Tree, TreeCost, VolumeConfig, check, in_leaf_order,
    morton_codes, radix, sort_by_code, tree_cost, triangle_corners, volumes,
};
use canted_obb::Aabb;

/// Corners of the triangles of a mesh.
pub(crate) fn corners(mesh: &Mesh) -> Vec<Corners> {
    triangle_corners(&mesh.positions, &mesh.triangles).unwrap().0
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
pub(crate) fn checked(tree: &Tree, corners: &[Corners]) -> (Stats, TreeCost) {
    let leaves = in_leaf_order(corners, &tree.leaves);
    let volumes = volumes(tree, &leaves, &VolumeConfig::default());
    let stats = check(tree, &volumes, &leaves).unwrap_or_else(|flaw| panic!("{flaw}"));
    (stats, tree_cost(tree, &volumes, &leaves, &Costs::default(), 1.0))
}
