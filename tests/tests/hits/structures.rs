//! Every structure over triangles answers every query as a loop over all triangles does, to the bit.
//!
//! Binary BVHs of every strategy with and without fallback, wide ones of few variants on every SIMD path, BIHs, and kd-trees with both
//! traversals; single rays, slices and filters, on one thread and several. Not covered here: more variants of wide BVHs (`wide.rs`),
//! generated kinds of scenes (`kinds.rs`), instances.

use canted_bih::{Bih, BihConfig, LeafSize};
use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::{
    Grazing, Mesh, SplitMix64, coplanar_quads, fan, grazing, identical, outlier, slivers, soup, torus,
};
use canted_kdtree::{KdTraversal, KdTree, KdTreeConfig};
use canted_lbvh::{
    Corners, GeometryError, Leaf, Strategy, VolumeConfig, check, corners_of, in_leaf_order, triangle_corners, volumes,
};
use canted_obb::{Obb, PrimId};
use canted_tests::{
    brute::{self, in_order},
    rays::{self, endless},
    reference::{Tally, compare, corners, margin, meshes, rays},
    scenes::{self, Case},
    variants::{binary, every_bvh, first_difference, first_wrong_query, loop_over_all},
};
use canted_trace::{Accept, Counts, Hit, Intersect, Ray, ScaledRay, SlabRay, TriangleTest};
use canted_wide::TriangleBvh;

/// A structure by name.
type Named = (String, Box<dyn Intersect>);

fn bih(mesh: &Mesh, leaf_size: u32, tight_factor: f32, test: TriangleTest) -> Bih {
    let config = BihConfig { leaf_size: LeafSize::AtMost(leaf_size), tight_factor, test };
    Bih::build(&mesh.positions, &mesh.triangles, &config).unwrap()
}

/// A kd-tree traced both ways.
fn kd_trees(mesh: &Mesh, config: &KdTreeConfig) -> [KdTree; 2] {
    let tree = KdTree::build(&mesh.positions, &mesh.triangles, config).unwrap();
    [KdTraversal::Stack, KdTraversal::Ropes].map(|traversal| tree.clone().with_traversal(traversal))
}

/// Small leaves, so that there are many planes.
fn deep() -> KdTreeConfig {
    KdTreeConfig { traversal_cost: 0.01, ..KdTreeConfig::default() }
}

fn structures(mesh: &Mesh, test: TriangleTest) -> Vec<Named> {
    let mut all = every_bvh(mesh, test);
    for strategy in Strategy::ALL {
        let config = Bvh2Config { volumes: VolumeConfig { strategy, fallback: false }, test, ..Bvh2Config::default() };
        let bvh = Bvh2::build(&mesh.positions, &mesh.triangles, &config).unwrap();
        all.push((format!("binary, {strategy:?} without fallback"), Box::new(bvh)));
    }
    for (leaf_size, factor) in [(1, 1.3), (3, 1.0)] {
        all.push((format!("BIH, leaves of {leaf_size}"), Box::new(bih(mesh, leaf_size, factor, test))));
    }
    for config in [KdTreeConfig { test, ..KdTreeConfig::default() }, KdTreeConfig { test, ..deep() }] {
        let tree = |tree: KdTree| (format!("{config:?}, {:?}", tree.nodes().traversal()), Box::new(tree) as _);
        all.extend(kd_trees(mesh, &config).map(tree));
    }
    all
}

/// Every query of `n` rays of each class and their variants; returns how many rays hit.
fn agrees(Case { name, mesh }: &Case, test: TriangleTest, n: usize) -> usize {
    let rays = [rays::of_all_classes(mesh, n, 20), rays::of_any_length(mesh, n, 77)].concat();
    let wants: Vec<Vec<Hit>> = rays.iter().map(brute::all_of_mesh(mesh, test)).collect();
    for (structure, bvh) in structures(mesh, test) {
        assert_eq!(first_wrong_query(&bvh, &rays, &wants), None, "{name}, {test}, {structure}");
    }
    wants.iter().filter(|want| !want.is_empty()).count()
}

#[test]
fn every_query_of_every_structure_is_that_of_the_loop() {
    for case in scenes::cases().iter().chain(&scenes::placed(scenes::ugly())) {
        let n_hits = agrees(case, TriangleTest::Watertight, 8);
        let is_enough = n_hits > 5 || case.mesh.triangles.len() < 3 || case.name.contains("slivers");
        assert!(is_enough, "{}: {n_hits}", case.name);
    }
}

#[test]
fn other_triangle_tests_are_those_of_the_loop() {
    for case in scenes::cases().iter().chain(&scenes::placed(scenes::ugly())) {
        for test in [TriangleTest::MollerTrumbore, TriangleTest::BaldwinWeber] {
            agrees(case, test, 2);
        }
    }
}

/// The boxes of a structure from the root on, each with its level and whether it is a leaf's.
fn boxes_of(each_box: impl FnOnce(&mut dyn FnMut(Obb, u32, bool))) -> Vec<(Obb, u32, bool)> {
    let mut all = vec![];
    each_box(&mut |obb, level, is_leaf| all.push((obb, level, is_leaf)));
    all
}

/// Vertices of triangles make the tree that indexed triangles make (Novak 2019, 4.1), and their errors name the triangle.
#[test]
fn triangles_without_indices_make_the_same_trees() {
    let test = TriangleTest::Watertight;
    for Case { name, mesh } in scenes::cases() {
        let (positions, triangles) = (&mesh.positions[..], &mesh.triangles[..]);
        let flat: Vec<Corners> = triangles.iter().map(|triangle| corners_of(positions, triangle)).collect();
        for strategy in Strategy::ALL {
            let volumes = VolumeConfig { strategy, fallback: true };
            let config = Bvh2Config { volumes, test, ..Bvh2Config::default() };
            let [a, b] = [Bvh2::build(positions, triangles, &config), Bvh2::build_flat(&flat, &config)]
                .map(|bvh| boxes_of(|each| bvh.unwrap().pairs().each_box(each)));
            assert!(a == b, "{name}: binary, {strategy:?}");
        }
        let [a, b] = [TriangleBvh::build(positions, triangles), TriangleBvh::build_flat(&flat)].map(Result::unwrap);
        assert!(a.to_bytes() == b.to_bytes(), "{name}: wide");
        let config = BihConfig::default();
        let [a, b] = [Bih::build(positions, triangles, &config), Bih::build_flat(&flat, &config)].map(Result::unwrap);
        assert!(boxes_of(|each| a.boxes().each_box(each)) == boxes_of(|each| b.boxes().each_box(each)), "{name}: BIH");
        assert_eq!(a.boxes().primitives(), b.boxes().primitives(), "{name}");
        let config = KdTreeConfig::default();
        let [a, b] =
            [KdTree::build(positions, triangles, &config), KdTree::build_flat(&flat, &config)].map(Result::unwrap);
        assert_eq!((a.nodes().planes(), a.primitives()), (b.nodes().planes(), b.primitives()), "{name}: kd-tree");
    }
    let bad = [[[0.0; 3]; 3], [[0.0; 3], [f32::NAN, 0.0, 0.0], [0.0; 3]]];
    let errors = [
        Bvh2::build_flat(&bad, &Bvh2Config::default()).err(),
        Bih::build_flat(&bad, &BihConfig::default()).err(),
        KdTree::build_flat(&bad, &KdTreeConfig::default()).err(),
        TriangleBvh::build_flat(&bad).err(),
    ];
    for error in errors {
        let is_named = matches!(error, Some(GeometryError::NotFinite { triangle: PrimId(1), vertex: 4, .. }));
        assert!(is_named, "{error:?}");
    }
}

/// More rays than three jobs of a slice have, the last job not full.
#[test]
fn threads_change_no_answer() {
    let mesh = soup(4, 400);
    let rays = rays::of_all_classes(&mesh, 500, 5);
    assert!(rays.len() > 3 * 1024 && !rays.len().is_multiple_of(1024), "{}", rays.len());
    for test in TriangleTest::ALL {
        let wants: Vec<Vec<Hit>> = rays.iter().map(brute::all_of_mesh(&mesh, test)).collect();
        for n_threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            for (structure, bvh) in structures(&mesh, test) {
                let difference = pool.install(|| first_wrong_query(&bvh, &rays, &wants));
                assert_eq!(difference, None, "{structure}, {test}, {n_threads} threads");
            }
        }
    }
}

#[test]
fn scales_by_powers_of_two_change_no_bit() {
    let mesh = &soup(7, 300);
    let hits = |exponent: i32| {
        let scale = 2.0f32.powi(exponent);
        let scaled =
            |ray: &Ray| Ray { origin: ray.origin.map(|x| x * scale), t_min: 0.0, t_max: f32::INFINITY, ..*ray };
        let rays: Vec<Ray> = rays::of_all_classes(mesh, 30, 20).iter().map(scaled).collect();
        let of = |(name, bvh): Named| {
            let hits = rays.iter().map(|ray| bvh.closest_hit(ray).map(|h| (h.t / scale, h.u, h.v, h.primitive)));
            (name, hits.collect::<Vec<_>>())
        };
        let all = structures(&mesh.placed(|p| p.map(|x| x * scale)), TriangleTest::Watertight);
        all.into_iter().map(of).collect::<Vec<_>>()
    };
    let unscaled = hits(0);
    assert!(unscaled[0].1.iter().flatten().count() > 100);
    for exponent in [-40, -20, 20, 40] {
        for ((name, scaled), (_, hits)) in hits(exponent).iter().zip(&unscaled) {
            assert!(scaled == hits, "{name} at 2^{exponent}");
        }
    }
}

#[test]
fn directions_of_any_length_have_the_hits_of_the_loop() {
    let mesh = torus(10, 6);
    let all = structures(&mesh, TriangleTest::Watertight);
    for exponent in [-140, -60, -1, 1, 60, 120] {
        let scale = 2.0f64.powi(exponent);
        let scaled = |ray: Ray| Ray { direction: ray.direction.map(|d| (f64::from(d) * scale) as f32), ..ray };
        let rays: Vec<Ray> = rays::of_all_classes(&mesh, 30, 9).into_iter().map(scaled).collect();
        let wants = loop_over_all(&mesh, TriangleTest::Watertight, &rays);
        for (name, bvh) in &all {
            assert_eq!(first_difference(bvh, &rays, &wants), None, "{name}, 2^{exponent}");
        }
    }
}

#[test]
fn invalid_rays_never_hit() {
    let valid = Ray::new([0.25, 0.25, -1.0], [0.0, 0.0, 1.0]);
    for (name, bvh) in structures(&identical(9), TriangleTest::Watertight) {
        assert!(bvh.occluded(&valid));
        for ray in [
            Ray { direction: [0.0; 3], ..valid },
            Ray { direction: [0.0, f32::NAN, 1.0], ..valid },
            Ray { direction: [0.0, 0.0, f32::INFINITY], ..valid },
            Ray { origin: [f32::NAN, 0.25, -1.0], ..valid },
            Ray { origin: [0.25, 0.25, f32::NEG_INFINITY], ..valid },
            Ray { t_min: f32::NAN, ..valid },
            Ray { t_min: -1.0, ..valid },
            Ray { t_min: 2.0, t_max: 1.0, ..valid },
        ] {
            assert_eq!((bvh.closest_hit(&ray), bvh.occluded(&ray)), (None, false), "{name}, {ray:?}");
        }
    }
}

#[test]
fn queries_count_their_tests() {
    let mesh = torus(10, 6);
    for (name, bvh) in structures(&mesh, TriangleTest::Watertight) {
        let ray = rays::of_all_classes(&mesh, 20, 9).into_iter().find(|ray| bvh.occluded(ray)).unwrap();
        let mut counts = Counts::default();
        assert_eq!(bvh.closest_hit_with(&ray, &mut counts), bvh.closest_hit(&ray));
        assert!(counts.boxes > 0 && (1..120).contains(&counts.triangles), "{name}: {counts:?}");
    }
}

#[test]
fn structures_print_their_size_instead_of_their_arrays() {
    let (mesh, test) = (torus(10, 6), TriangleTest::Watertight);
    let bvh = Bvh2::build(&mesh.positions, &mesh.triangles, &Bvh2Config::default()).unwrap();
    let [tree, _] = kd_trees(&mesh, &deep());
    let printed = [format!("{bvh:?}"), format!("{:?}", bih(&mesh, 4, 1.3, test)), format!("{tree:?}")];
    for (printed, name) in printed.iter().zip(["Bvh2", "Bih", "KdTree"]) {
        assert!(printed.starts_with(&format!("{name} {{ n_triangles: 120, ")), "{printed}");
    }
}

/// Small triangles, and the same with a floor of 1e6.
fn without_and_with_a_floor() -> [Mesh; 2] {
    let small = soup(6, 3_000);
    let floor = vec![[-1e6, -1e6, -9.0], [1e6, -1e6, -9.0], [0.0, 1e6, -9.0]];
    let both = small.joined(&Mesh { positions: floor, triangles: vec![[0, 1, 2]] });
    [small, both]
}

/// Planes carry pads by their own content, so that a floor does not slow rays among small triangles.
#[test]
fn a_large_triangle_does_not_loosen_other_planes() {
    let meshes = without_and_with_a_floor();
    let rays = rays::of_all_classes(&meshes[0], 40, 9);
    let rays: Vec<Ray> = rays.into_iter().filter(|ray| ray.origin.iter().all(|x| x.abs() < 5.0)).collect();
    let counts = |structure: &dyn Intersect| {
        let mut counts = Counts::default();
        for ray in &rays {
            structure.closest_hit_with(ray, &mut counts);
        }
        counts
    };
    let [alone, with] = meshes.each_ref().map(|mesh| counts(&bih(mesh, 1, 1.3, TriangleTest::Watertight)));
    assert!(with.boxes + with.triangles < 2 * (alone.boxes + alone.triangles), "{alone:?}, with the floor {with:?}");
    let [alone, with] =
        meshes.each_ref().map(|mesh| kd_trees(mesh, &KdTreeConfig::default()).map(|tree| counts(&tree)));
    for (alone, with) in alone.iter().zip(&with) {
        assert!(with.triangles < 3 * alone.triangles && with.boxes < 3 * alone.boxes, "{alone:?}, then {with:?}");
    }
}

/// The same of boxes: compared with pads by the reach of the whole mesh.
#[test]
fn a_large_triangle_does_not_loosen_other_boxes() {
    let [small, mesh] = without_and_with_a_floor();
    let rays = rays::of_all_classes(&small, 20, 9);
    let wants = loop_over_all(&mesh, TriangleTest::Watertight, &rays);
    for strategy in Strategy::ALL {
        let bvh = binary(&mesh, strategy, TriangleTest::Watertight);
        let [mut local, mut global] = [Counts::default(); 2];
        for (ray, &want) in rays.iter().zip(&wants) {
            assert_eq!(bvh.closest_hit_with(ray, &mut local), want, "{strategy:?}: {ray:?}");
            let scaled = ScaledRay::new(ray).unwrap();
            let t_max = want.map_or(scaled.t_max, |hit| scaled.scaled_t(hit.t));
            let by_mesh = SlabRay::new(&scaled, bvh.pairs().reach());
            bvh.pairs().traverse_ordered(&by_mesh, t_max, &mut global, |_, t_max, _| t_max);
        }
        assert!(3 * local.boxes < global.boxes, "{strategy:?}: {local:?}, by the mesh {global:?}");
    }
}

/// Every leaf size that matters with every extreme of the rule for tight boxes.
#[test]
fn no_configuration_of_a_bih_changes_a_hit() {
    for Case { name, mesh } in scenes::shapes().into_iter().chain(scenes::ugly()) {
        let rays = rays::of_any_length(&mesh, 15, 77);
        let wants: Vec<Vec<Hit>> = rays.iter().map(brute::all_of_mesh(&mesh, TriangleTest::Watertight)).collect();
        let default = Bih::build(&mesh.positions, &mesh.triangles, &BihConfig::default()).unwrap();
        let mut all = vec![default];
        for leaf_size in [0, 1, 2, 5, 30, u32::MAX] {
            let factors = [1.3, 1.0, 0.0, f32::NAN, f32::INFINITY];
            all.extend(factors.map(|factor| bih(&mesh, leaf_size, factor, TriangleTest::Watertight)));
        }
        for bih in all {
            assert_eq!(first_wrong_query(&bih, &rays, &wants), None, "{name}, {bih:?}");
        }
    }
}

#[test]
fn no_configuration_of_a_kd_tree_changes_a_hit() {
    let mesh = scenes::ugly().remove(0).mesh;
    let rays = rays::of_any_length(&mesh, 30, 9);
    let wants: Vec<Vec<Hit>> = rays.iter().map(brute::all_of_mesh(&mesh, TriangleTest::Watertight)).collect();
    let agrees = |config: &KdTreeConfig| {
        let trees = kd_trees(&mesh, config);
        for tree in &trees {
            assert_eq!(first_wrong_query(tree, &rays, &wants), None, "{config:?}");
        }
        trees[0].clone()
    };
    let mut n_leaves = vec![];
    for empty_bonus in [0.0, 0.2, 0.5, 0.9] {
        for (max_depth, max_references) in
            [(None, 16.0), (Some(0), 16.0), (Some(3), 2.0), (Some(64), 100.0), (None, 0.0)]
        {
            let tree = agrees(&KdTreeConfig { empty_bonus, max_depth, max_references, ..deep() });
            assert!(max_depth.is_none_or(|limit| tree.nodes().depth() <= limit));
            let per_triangle = tree.nodes().n_references() as f64 / mesh.triangles.len() as f64;
            assert!(per_triangle <= max_references.max(1.0), "{per_triangle} references per triangle");
            n_leaves.push(tree.nodes().n_leaves());
        }
    }
    assert!(n_leaves.iter().any(|&n| n > 200) && n_leaves.contains(&1), "{n_leaves:?}");
    for (traversal_cost, intersection_cost, empty_bonus) in
        [(f64::NAN, 1.0, 0.0), (1.0, 0.0, 0.0), (-1.0, 1.0, 2.0), (0.0, f64::INFINITY, f64::NAN), (1.0, -1.0, 0.0)]
    {
        agrees(&KdTreeConfig { traversal_cost, intersection_cost, empty_bonus, ..KdTreeConfig::default() });
    }
}

/// Rays in split planes, from them, and through their edges.
#[test]
fn rays_in_the_planes_of_a_kd_tree_are_those_of_the_loop() {
    for (name, mesh) in [("soup", soup(3, 60)), ("torus", torus(8, 6)), ("coplanar", coplanar_quads(40))] {
        let trees = kd_trees(&mesh, &deep());
        let (planes, cell) = (trees[0].nodes().planes(), *trees[0].nodes().cell());
        assert!(planes.len() > 30, "{name}");
        let mut rng = SplitMix64::new(2);
        let some = rays::of_all_classes(&mesh, 1, 9);
        let mut ray = |_| {
            let mut ray = some[rng.below(some.len())];
            let [(axis, plane), (other, second)] = [(); 2].map(|()| planes[rng.below(planes.len())]);
            ray.origin = std::array::from_fn(|k| {
                let at = if rng.below(2) == 0 { 2.0 * rng.unit() - 0.5 } else { rng.unit() };
                cell.min[k] + at as f32 * (cell.max[k] - cell.min[k])
            });
            ray.origin[other] = second;
            ray.origin[axis] = plane;
            match rng.below(4) {
                0 => ray.direction[axis] = [0.0, -0.0][rng.below(2)],
                1 => ray.direction = std::array::from_fn(|k| if k == other { 0.0 } else { -0.0 }),
                2 => (ray.direction[axis], ray.direction[other]) = (0.0, -0.0),
                _ => {}
            }
            if ray.direction == [0.0; 3] {
                ray.direction[(axis + 1 + rng.below(2)) % 3] = [1.0, -3.0][rng.below(2)];
            }
            ray
        };
        let rays: Vec<Ray> = (0..4_000).map(&mut ray).collect();
        let wants: Vec<Vec<Hit>> = rays.iter().map(brute::all_of_mesh(&mesh, TriangleTest::Watertight)).collect();
        for tree in &trees {
            assert_eq!(first_wrong_query(tree, &rays, &wants), None, "{name}");
        }
    }
}

#[test]
fn traversal_does_fewer_tests_than_the_loop() {
    let mesh = &scenes::shapes()[2].mesh;
    let blas = binary(mesh, Strategy::Aabb, TriangleTest::Watertight);
    let rays = rays::of_all_classes(mesh, 100, 20);
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

#[test]
fn certain_hits_are_found_and_certain_misses_are_not() {
    for (name, mesh) in meshes() {
        let mut tally = Tally::default();
        for ((variant, bvh), seed) in every_bvh(&mesh, TriangleTest::Watertight).iter().zip(70..) {
            let mut hits = vec![];
            for ray in rays(&mesh, 50, seed) {
                bvh.all_hits(&ray, &mut hits);
                compare(&mesh, &ray, &hits, &mut tally).unwrap_or_else(|error| panic!("{name}, {variant}: {error}"));
                assert_eq!(bvh.closest_hit(&ray), hits.first().copied(), "{name}, {variant}, {ray:?}");
                // A query that rejects every hit sees all of them.
                let mut seen: Vec<Hit> = vec![];
                let reject = |hit: &Hit| {
                    seen.push(*hit);
                    false
                };
                assert_eq!(bvh.closest_hit_with(&ray, &mut Accept(reject)), None);
                assert_eq!(in_order(seen), hits, "{name}, {variant}, {ray:?}");
            }
        }
        let Tally { n_pierced, n_missed, n_open } = tally;
        assert!(n_missed > 1000 && n_open < n_pierced + n_missed, "{name}: {tally:?}");
        // Slivers are so thin that rounding may always move the ray off them.
        assert_eq!(n_pierced > 100, name != "slivers", "{name}: {tally:?}");
    }
}

#[test]
fn a_vertex_moved_by_a_hundred_margins_is_detected() {
    for (name, mesh) in meshes() {
        for (variant, bvh) in every_bvh(&mesh, TriangleTest::Watertight).iter().step_by(6) {
            let mut n_seen = 0;
            let mut hits = vec![];
            for ray in rays(&mesh, 200, 6) {
                bvh.all_hits(&ray, &mut hits);
                let by = 100.0 * margin(&ray, &corners(&mesh, &mesh.triangles[0])).along;
                let moved = mesh.placed(|p| p.map(|x| x + by));
                n_seen += usize::from(compare(&moved, &ray, &hits, &mut Tally::default()).is_err());
            }
            // Nothing hits half of the slivers.
            assert!(n_seen > 5, "{name}, {variant}: {n_seen} moved meshes were seen");
        }
    }
}
