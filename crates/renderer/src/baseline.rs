use std::time::Duration;

use canted_lbvh::{Child, Corners, NodeId, TopologyError, Tree};
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::Bvh2, bvh2::builder::build_bvh2};

/// A tree of `obvhs`'s builder over the triangles, one primitive a leaf; our stations then fit its volumes.
///
/// Its topology alone is taken, so pictures stay the same bits. At least two triangles.
///
/// # Errors
/// Where the foreign nodes do not form a tree over the primitives.
pub fn obvhs_tree(corners: &[Corners], params: BvhBuildParams) -> Result<Tree, TopologyError> {
    let boxes: Vec<Aabb> = corners.iter().map(|c| Aabb::from_points(&c.map(glam::Vec3A::from_array))).collect();
    let params = BvhBuildParams { pre_split: false, max_prims_per_leaf: 1, ..params };
    from_bvh2(&build_bvh2(&boxes, params, &mut Duration::default()))
}

/// Our tree over the nodes of a BVH2 whose leaves hold one primitive each.
fn from_bvh2(bvh: &Bvh2) -> Result<Tree, TopologyError> {
    let mut children = Vec::with_capacity(bvh.primitive_indices.len());
    // (foreign inner node, whose number is its place in `children`), in the order of numbering.
    let mut inner = vec![0usize];
    let mut next = 0;
    while let Some(&node) = inner.get(next) {
        next += 1;
        let first = bvh.nodes[node].first_index as usize;
        children.push([first, first + 1].map(|child| {
            let node = &bvh.nodes[child];
            if node.is_leaf() {
                Child::leaf(bvh.primitive_indices[node.first_index as usize])
            } else {
                inner.push(child);
                #[expect(clippy::cast_possible_truncation, reason = "obvhs numbers nodes by u32")]
                Child::inner(NodeId(inner.len() as u32 - 1))
            }
        }));
    }
    Tree::from_children(&children)
}
