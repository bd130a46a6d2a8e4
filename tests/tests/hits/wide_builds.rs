//! Builds of wide BVHs: the same bytes for any number of threads, trees of any builder and shape.

use std::time::{Duration, Instant};

use canted_fixtures::{Mesh, identical, scaffold_of, soup};
use canted_lbvh::{Tree, triangle_corners};
use canted_obb::Aabb;
use canted_sah::{Builder, ReinsertConfig, SpatialConfig, TopDownConfig};
use canted_tests::{
    rays,
    scenes::{self, chain},
    variants::{agrees, build, few_variants, first_difference, loop_over_all, paths},
};
use canted_trace::{Ray, TriangleTest};
use canted_wide::{Config, Preset, TriangleBvh};

fn bytes(n_threads: usize, mesh: &Mesh, config: &Config) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
    pool.install(|| build(mesh, config).to_bytes())
}

#[test]
fn threads_change_no_byte() {
    // More triangles than one task has.
    let meshes = [soup(3, 12_000), scaffold_of(1, true, 6), scenes::room(3, 800).off_axis(), identical(9_000)];
    for mesh in meshes {
        for (variant, config) in few_variants() {
            let want = bytes(1, &mesh, &config);
            for n_threads in [2, 3] {
                assert!(bytes(n_threads, &mesh, &config) == want, "{variant}, {n_threads} threads");
            }
        }
    }
}

/// The bytes distinguish BVHs.
#[test]
fn bytes_differ_between_scenes_and_presets() {
    let of = |seed, preset| bytes(2, &soup(seed, 500), &Config::preset(preset));
    assert_eq!(of(1, Preset::Fast), of(1, Preset::Fast));
    assert_ne!(of(1, Preset::Fast), of(2, Preset::Fast));
    assert_ne!(of(1, Preset::Fast), of(1, Preset::Quality));
}

/// Greatest number of repeated builds.
const N_BUILDS: u32 = 20;

/// Triangles stretched along an axis become nearly parallel needles without a best frame, so the search must give up. Without
/// a bound this took two hundred times as long.
#[test]
fn nearly_parallel_needles_take_no_longer_to_build() {
    for scenes::Case { name, mesh } in scenes::needles() {
        let meshes = [mesh.placed(|p| [p[0] * 20.0 + 1e7, p[1] * 1e-3, p[2] * 1e-3]), mesh];
        let mut least = [Duration::MAX; 2];
        for _ in 0..N_BUILDS {
            for (least, mesh) in least.iter_mut().zip(&meshes) {
                let start = Instant::now();
                build(mesh, &Config::default());
                *least = start.elapsed().min(*least);
            }
            if least[0] < 10 * least[1] {
                break;
            }
        }
        assert!(least[0] < 10 * least[1], "{name}: {least:?}");
    }
}

/// Collapses `tree` with every configuration and compares with the loop.
fn over_agrees(name: &str, mesh: &Mesh, tree: &Tree, rays: &[Ray]) {
    let (corners, bounds) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let wants = loop_over_all(mesh, TriangleTest::Watertight, rays);
    for (variant, config) in few_variants() {
        let wide = TriangleBvh::from_tree(tree, &corners, &bounds, config).unwrap();
        for path in paths().0 {
            let difference = first_difference(&wide.clone().with_path(path), rays, &wants);
            assert_eq!(difference, None, "{name}, {variant}, {}", path.name());
        }
    }
}

/// Collapses `tree`, whose leaves have the boxes `parts`, with every configuration; compares with the loop, before a refit and after it.
fn parts_agree(name: &str, mesh: &Mesh, (tree, parts): (&Tree, Vec<Aabb>), rays: &[Ray]) {
    let (corners, bounds) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let wants = loop_over_all(mesh, TriangleTest::Watertight, rays);
    for (variant, config) in few_variants() {
        let mut wide = TriangleBvh::from_tree_of_parts(tree, parts.clone(), &corners, &bounds, config).unwrap();
        for path in paths().0 {
            let difference = first_difference(&wide.clone().with_path(path), rays, &wants);
            assert_eq!(difference, None, "parts of {name}, {variant}, {}", path.name());
        }
        let whole = TriangleBvh::from_tree(tree, &corners, &bounds, config).unwrap();
        let [of_parts, of_whole] = [&wide, &whole].map(|bvh| bvh.predicted().aligned);
        assert!(of_parts <= 1.001 * of_whole, "{name}, {variant}: {of_parts}, {of_whole}");
        wide.refit(&mesh.positions, &mesh.triangles).unwrap();
        assert_eq!(first_difference(&wide, rays, &wants), None, "refitted parts of {name}, {variant}");
    }
}

/// Which leaves of a chain are on the left, by name.
type Shape = (&'static str, fn(u32) -> bool);

/// Less than a recursion of the chains' depth would take, at 64 bytes per call.
const STACK_BYTES: usize = 1 << 18;

#[test]
fn chains_overflow_no_stack_and_lose_no_hit() {
    let n = 5_000;
    let mesh = soup(9, n);
    let rays = [rays::of_all_classes(&mesh, 8, 140), rays::from_inside(&mesh, 40, 141)].concat();
    let shapes: [Shape; 3] = [("left", |_| true), ("right", |_| false), ("zigzag", |i| i.is_multiple_of(2))];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).stack_size(STACK_BYTES).build().unwrap();
    pool.install(|| {
        for (name, is_left) in shapes {
            let tree = chain(n, is_left);
            assert_eq!(tree.depth, n);
            over_agrees(name, &mesh, &tree, &rays);
        }
    });
    // The wide BVH must be deep for this test.
    let (corners, bounds) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let wide = TriangleBvh::from_tree(&chain(n, |_| true), &corners, &bounds, Config::default()).unwrap();
    assert!(wide.sizes().depth >= n / 7 / 16, "{:?}", wide.sizes());
}

/// Twenty times the length may take four hundred times as long where extents are computed from all vertices below; a build of
/// minutes would be cubic.
#[test]
fn a_chain_of_a_hundred_thousand_builds_in_a_minute() {
    let n = 100_000;
    let mesh = soup(9, n);
    let (corners, bounds) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let start = Instant::now();
    let wide = TriangleBvh::from_tree(&chain(n, |_| true), &corners, &bounds, Config::default()).unwrap();
    let time = start.elapsed();
    assert!(time < Duration::from_secs(60), "{time:?}");
    let rays = rays::of_all_classes(&mesh, 2, 150);
    assert_eq!(first_difference(&wide, &rays, &loop_over_all(&mesh, TriangleTest::Watertight, &rays)), None);
}

/// A scaffold, hair, a soup: a few thousand triangles each.
fn meshes() -> Vec<(String, Mesh)> {
    let needles = scenes::needles().into_iter().take(3).map(|case| (case.name, case.mesh));
    needles
        .chain([("soup".to_owned(), soup(4, 2_000)), ("scaffold, larger".to_owned(), scaffold_of(2, false, 4))])
        .collect()
}

#[test]
fn every_builder_of_ours_loses_no_hit() {
    let top_down = Builder::TopDown(TopDownConfig::BINNED, Some(ReinsertConfig::BALANCED));
    let builders =
        [Builder::Lbvh, Builder::Reinserted(ReinsertConfig::BALANCED), Builder::FAST, Builder::QUALITY, top_down];
    for (name, mesh) in meshes() {
        let rays = rays::of_all_classes(&mesh, 10, 160);
        let variants: Vec<_> = builders
            .iter()
            .map(|&builder| {
                (
                    format!("{builder:?}"),
                    Config { builder, alternative_builder: None, groups: None, ..Config::default() },
                )
            })
            .collect();
        agrees(TriangleTest::Watertight, &name, &mesh, &variants, &rays);
    }
}

#[test]
fn trees_of_obvhs_lose_no_hit() {
    for (name, mesh) in meshes() {
        let (corners, _) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
        let rays = rays::of_all_classes(&mesh, 10, 170);
        for params in [obvhs::BvhBuildParams::fast_build(), obvhs::BvhBuildParams::very_slow_build()] {
            let tree = canted_renderer::obvhs_tree(&corners, params).unwrap();
            over_agrees(&name, &mesh, &tree, &rays);
        }
    }
}

#[test]
fn spatial_splits_lose_no_hit() {
    let mut n_extra = 0;
    for (name, mesh) in meshes() {
        let (corners, _) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
        let config = SpatialConfig { extra_references: 1.0, min_overlap: 0.0, ..SpatialConfig::default() };
        let (mut tree, references) = canted_sah::spatial(&corners, &config);
        n_extra += references.primitives.len() - corners.len();
        let parts: Vec<Aabb> = tree.leaves.iter().map(|part| references.boxes[part.index()]).collect();
        // Leaves name references.
        tree.leaves.iter_mut().for_each(|leaf| *leaf = references.primitives[leaf.index()]);
        let rays = rays::of_all_classes(&mesh, 10, 180);
        over_agrees(&name, &mesh, &tree, &rays);
        parts_agree(&name, &mesh, (&tree, parts), &rays);
    }
    assert!(n_extra > 1_000, "{n_extra} splits");
}
