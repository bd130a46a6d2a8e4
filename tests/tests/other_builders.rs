//! Trees of other builders, larger than one task, are valid and lose no hit.
//!
//! Not covered here: small trees and every strategy (`volumes.rs`, `lost_hits.rs`).

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::{Grazing, Mesh, fan, grazing, outlier, slivers, soup};
use canted_lbvh::{Leaf, Strategy, VolumeConfig, check, in_leaf_order, triangle_corners, volumes};
use canted_tests::brute;
use canted_trace::{Ray, Watertight};

fn holds(name: &str, mesh: &Mesh) {
    let (corners, bounds) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let obvhs = canted_renderer::obvhs_tree(&corners, obvhs::BvhBuildParams::fast_build()).unwrap();
    let boxes: Vec<_> = corners.iter().map(Leaf::aabb).collect();
    let records = brute::records::<Watertight>(&mesh.positions, &mesh.triangles);
    for (builder, tree) in
        [("ploc", canted_sah::build(&boxes, &bounds, &canted_sah::Builder::default())), ("obvhs", obvhs)]
    {
        let leaves = in_leaf_order(&corners, &tree.leaves);
        for strategy in [Strategy::Aabb, Strategy::PcaUnbounded, Strategy::Combined, Strategy::Dop] {
            let config = VolumeConfig { strategy, fallback: true };
            let fitted = volumes(&tree, &leaves, &config);
            check(&tree, &fitted, &leaves).unwrap_or_else(|flaw| panic!("{name}, {builder}, {strategy:?}: {flaw}"));
            let config = BuildConfig { volumes: config, ..BuildConfig::default() };
            let blas = Bvh2::<Watertight>::over(tree.clone(), &corners, &bounds, &config);
            for class in Grazing::ALL {
                for ray in grazing(mesh, class, 6, 9) {
                    let ray = Ray { origin: ray.origin, direction: ray.direction, t_min: 0.0, t_max: ray.t_max };
                    let want = brute::closest_hit::<Watertight>(&records, &ray);
                    let got = blas.closest_hit(&ray);
                    assert_eq!(got, want, "{name}, {builder}, {strategy:?}, {ray:?}");
                }
            }
        }
    }
}

#[test]
fn trees_of_other_builders_are_valid_and_lose_no_hit() {
    holds("soup", &soup(4, 9_000));
    holds("outlier", &outlier(9_000));
    holds("slivers", &slivers(5, 9_000));
    holds("fan", &fan(6_000));
}
