use std::time::Duration;

use canted_lbvh::{Child, Corners, NodeId, TopologyError, Tree};
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::Bvh2, bvh2::builder::build_bvh2};

/// The topology of a BVH that `obvhs` builds over at least two triangles, one per leaf; volumes are fitted by our own code.
///
/// # Errors
/// If the nodes do not form a tree over the triangles.
pub fn obvhs_tree(corners: &[Corners], params: BvhBuildParams) -> Result<Tree, TopologyError> {
    let boxes: Vec<Aabb> = corners.iter().map(|c| Aabb::from_points(&c.map(glam::Vec3A::from_array))).collect();
    let params = BvhBuildParams { pre_split: false, max_prims_per_leaf: 1, ..params };
    from_bvh2(&build_bvh2(&boxes, params, &mut Duration::default()))
}

/// Converts the nodes of a BVH2 with one primitive per leaf.
fn from_bvh2(bvh: &Bvh2) -> Result<Tree, TopologyError> {
    let mut children = Vec::with_capacity(bvh.primitive_indices.len());
    // The `obvhs` index of each inner node, in our numbering.
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
                Child::inner(NodeId(inner.len() as u32 - 1))
            }
        }));
    }
    Tree::from_children(&children)
}
