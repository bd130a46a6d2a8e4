//! Metrics of BVHs other than our binary ones, by the same formulas where their nodes are public.

use std::time::Duration;

use anyhow::Result;
use canted_fixtures::Mesh;
use canted_lbvh::Costs;
use canted_obb::Aabb;
use canted_trace::{Counts, InstanceId, Ray, Watertight};
use canted_wide::TriangleBvh;
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    ray::RayHit,
};

use super::metrics::Metrics;
use crate::wide::obvhs::{theirs, triangles};

/// Metrics of a WideBvh: counted tests, eight boxes per node.
pub(super) fn of_wide(tree: &TriangleBvh<Watertight>, rays: &[Ray]) -> Metrics {
    let mut counts = Counts::default();
    for ray in rays {
        tree.closest_hit_with(ray, InstanceId(0), &mut counts);
    }
    Metrics { boxes: each(counts.boxes, rays), triangles: each(counts.triangles, rays), ..Metrics::UNKNOWN }
}

/// Metrics of a binary BVH of `obvhs`: sums over its nodes; its traversal counts triangle tests only.
pub(super) fn of_obvhs(mesh: &Mesh, params: BvhBuildParams, rays: &[Ray]) -> Result<Metrics> {
    let (_, bounds) = canted_lbvh::triangle_corners(&mesh.positions, &mesh.triangles)?;
    let all = triangles(mesh);
    let tree = build_bvh2_from_tris(&all, params, &mut Duration::default());
    let mut n_tested = 0;
    for ray in rays {
        tree.ray_traverse(theirs(ray), &mut RayHit::none(), |ray, i| {
            n_tested += 1;
            all[tree.primitive_indices[i] as usize].intersect(ray)
        });
    }
    let unit = bounds.extent().into_iter().fold(f64::MIN_POSITIVE, f64::max);
    Ok(Metrics { triangles: each(n_tested, rays), ..summed(&tree, unit) })
}

/// Sums over the inner nodes, and the surface area heuristic as in `canted_lbvh::tree_cost`: a node costs two box
/// tests, a leaf one test per primitive.
fn summed(tree: &Bvh2, unit: f64) -> Metrics {
    let costs = Costs::default();
    let bounds = |node: usize| {
        let aabb = tree.nodes[node].aabb();
        Aabb { min: aabb.min.into(), max: aabb.max.into() }
    };
    let root_area = bounds(0).area().max(f64::MIN_POSITIVE);
    let mut all = Metrics { sah: 0.0, area: 0.0, volume: 0.0, ..Metrics::UNKNOWN };
    let mut waiting = vec![0];
    while let Some(i) = waiting.pop() {
        let (node, aabb) = (&tree.nodes[i], bounds(i));
        let cost = if node.is_leaf() {
            f64::from(node.prim_count) * costs.primitive
        } else {
            let first = node.first_index as usize;
            waiting.extend([first, first + 1]);
            all.area += aabb.area() / (unit * unit);
            all.volume += aabb.volume() / (unit * unit * unit);
            2.0 * costs.aabb
        };
        all.sah += cost * aabb.area() / root_area;
    }
    all
}

#[expect(clippy::cast_precision_loss, reason = "counts of rays")]
fn each(n: u64, rays: &[Ray]) -> f64 {
    n as f64 / rays.len() as f64
}

#[cfg(test)]
mod tests {
    use canted_lbvh::{Strategy, VolumeConfig, in_leaf_order, triangle_corners, volumes};

    use super::*;
    use crate::report::{hierarchies::trees, subjects};
    use crate::wide::closest_sets;

    #[test]
    fn obvhs_sums_equal_ours_over_the_same_topology() {
        let model = subjects::load(subjects::SMALL).unwrap().unwrap();
        let rays = closest_sets(&model, &trees::any(&model.mesh).unwrap(), 16).concat();
        let params = BvhBuildParams { pre_split: false, max_prims_per_leaf: 1, ..BvhBuildParams::fast_build() };
        let found = of_obvhs(&model.mesh, params, &rays).unwrap();
        let (corners, bounds) = triangle_corners(&model.mesh.positions, &model.mesh.triangles).unwrap();
        let tree = canted_renderer::obvhs_tree(&corners, params).unwrap();
        let sorted = in_leaf_order(&corners, &tree.leaves);
        let fitted = volumes(&tree, &sorted, &VolumeConfig { strategy: Strategy::Aabb, fallback: true });
        let wanted = Metrics::of(tree, &fitted, &corners, &bounds, &rays).unwrap();
        for (found, wanted) in [(found.sah, wanted.sah), (found.area, wanted.area), (found.volume, wanted.volume)] {
            assert!((found / wanted - 1.0).abs() < 1e-5, "{found} {wanted}");
        }
        assert!(found.triangles > 0.0 && found.boxes.is_nan() && found.overlap.is_nan());
        // Leaves of several triangles cost a test of each and save nodes.
        let larger = BvhBuildParams { max_prims_per_leaf: 8, ..params };
        assert!(of_obvhs(&model.mesh, larger, &rays).unwrap().area < found.area);
    }

    #[test]
    fn wide_bvhs_count_tests() {
        let model = subjects::load(subjects::SMALL).unwrap().unwrap();
        let tree = trees::any(&model.mesh).unwrap();
        let rays = closest_sets(&model, &tree, 16).concat();
        let found = of_wide(&tree, &rays);
        let visits = tree.traversal_counts(&rays);
        assert!((found.boxes - 8.0 * each(visits.nodes.iter().sum(), &rays)).abs() < 1e-9);
        assert!(found.triangles > 0.0 && found.sah.is_nan());
    }
}
