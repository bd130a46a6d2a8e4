//! Binary BVHs: the same bits as a loop over all triangles.
//!
//! Every strategy, with and without fallback, every triangle test, trees of other builders; rays through vertices and edges, in face
//! planes, axis-parallel, from far away. Not covered here: instances (`instances`).

use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::{Grazing, Mesh, fan, grazing, outlier, slivers, soup};
use canted_lbvh::{Bits, Leaf, Strategy, VolumeConfig, check, in_leaf_order, triangle_corners, volumes};
use canted_tests::{
    rays::endless,
    scenes::{self, Case},
    variants::{binary, first_difference, loop_over_all},
};
use canted_trace::{Counts, Intersect, Ray, TriangleTest};

fn rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    if mesh.triangles.is_empty() {
        return vec![Ray::new([0.0; 3], [1.0, 0.0, 0.0])];
    }
    let mut rays = vec![];
    for (class, seed) in Grazing::ALL.into_iter().zip(20..) {
        rays.extend(grazing(mesh, class, n, seed).into_iter().map(endless));
    }
    // Signs of zero and powers of two in the direction's length must not matter.
    let variants: Vec<Ray> = rays
        .iter()
        .step_by(5)
        .map(|ray| Ray { direction: ray.direction.map(|d| if d == 0.0 { -0.0 } else { d * 2.0f32.powi(-40) }), ..*ray })
        .collect();
    rays.extend(variants);
    rays
}

/// Every volume strategy on every mesh, with `n` rays of each class.
fn agrees(test: TriangleTest, n: usize) {
    for Case { name, mesh } in scenes::cases() {
        let rays = rays(&mesh, n);
        let wants = loop_over_all(&mesh, test, &rays);
        for (strategy, fallback) in Strategy::ALL.into_iter().flat_map(|strategy| [(strategy, true), (strategy, false)])
        {
            let config = Bvh2Config { bits: Bits::B63, volumes: VolumeConfig { strategy, fallback }, test };
            let bvh = Bvh2::build(&mesh.positions, &mesh.triangles, &config).unwrap();
            assert_eq!(first_difference(&bvh, &rays, &wants), None, "{name}, {config:?}");
        }
    }
}

#[test]
fn watertight_loses_no_hit() {
    agrees(TriangleTest::Watertight, 40);
}

#[test]
fn moller_trumbore_loses_no_hit() {
    agrees(TriangleTest::MollerTrumbore, 15);
}

#[test]
fn baldwin_weber_loses_no_hit() {
    agrees(TriangleTest::BaldwinWeber, 15);
}

#[test]
fn scales_by_powers_of_two_change_no_bit() {
    let mesh = &scenes::shapes()[0].mesh;
    let hits = |exponent: i32| -> Vec<_> {
        let scale = 2.0f32.powi(exponent);
        let blas = binary(&mesh.placed(|p| p.map(|x| x * scale)), Strategy::Combined, TriangleTest::Watertight);
        let scaled = |ray: &Ray| Ray { origin: ray.origin.map(|x| x * scale), ..*ray };
        let mut counts = Counts::default();
        let hits: Vec<_> = rays(mesh, 50)
            .iter()
            .map(|ray| blas.closest_hit_with(&scaled(ray), &mut counts).map(|h| (h.t / scale, h.u, h.v, h.primitive)))
            .collect();
        assert!(hits.iter().flatten().count() > 100);
        hits
    };
    for exponent in [-40, -20, 20, 40] {
        assert_eq!(hits(exponent), hits(0), "2^{exponent}");
    }
}

#[test]
fn traversal_does_fewer_tests_than_the_loop() {
    let mesh = &scenes::shapes()[2].mesh;
    let blas = binary(mesh, Strategy::Aabb, TriangleTest::Watertight);
    let rays = rays(mesh, 100);
    let (mut closest, mut any) = (Counts::default(), Counts::default());
    for ray in &rays {
        blas.closest_hit_with(ray, &mut closest);
        blas.occluded_with(ray, &mut any);
    }
    let all = (rays.len() * mesh.triangles.len()) as u64;
    assert!(closest.triangles * 10 < all, "{closest:?} of {all}");
    assert!(any.triangles <= closest.triangles, "{any:?} {closest:?}");
}

fn holds(name: &str, mesh: &Mesh) {
    let (corners, bounds) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let obvhs = canted_renderer::obvhs_tree(&corners, obvhs::BvhBuildParams::fast_build()).unwrap();
    let boxes: Vec<_> = corners.iter().map(Leaf::aabb).collect();
    let rays: Vec<Ray> = Grazing::ALL.into_iter().flat_map(|class| grazing(mesh, class, 6, 9)).map(endless).collect();
    let wants = loop_over_all(mesh, TriangleTest::Watertight, &rays);
    for (builder, tree) in
        [("ploc", canted_sah::build(&boxes, &bounds, &canted_sah::Builder::default())), ("obvhs", obvhs)]
    {
        let leaves = in_leaf_order(&corners, &tree.leaves);
        for strategy in [Strategy::Aabb, Strategy::PcaUnbounded, Strategy::Combined, Strategy::Dop] {
            let config = VolumeConfig { strategy, fallback: true };
            let fitted = volumes(&tree, &leaves, &config);
            check(&tree, &fitted, &leaves).unwrap_or_else(|flaw| panic!("{name}, {builder}, {strategy:?}: {flaw}"));
            let config = Bvh2Config { volumes: config, ..Bvh2Config::default() };
            let blas = Bvh2::over(tree.clone(), &corners, &bounds, &config);
            assert_eq!(first_difference(&blas, &rays, &wants), None, "{name}, {builder}, {strategy:?}");
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
