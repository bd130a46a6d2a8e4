//! Promises of the build: scale, threads, size, invalid and empty input. Hits are compared with a loop over all triangles in the tests of
//! the workspace.

use canted_fixtures::kinds;
use canted_fixtures::{Mesh, SplitMix64, equal_centroids, identical, outlier, soup};
use canted_kdtree::{KdNodes, KdSplit, KdTraversal, KdTree, KdTreeConfig};
use canted_trace::{Intersect, Kernel, MollerTrumbore, Ray, TriangleTest};

type Corners = [[f32; 3]; 3];

fn corners(mesh: &Mesh) -> Vec<Corners> {
    mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize])).collect()
}

#[test]
fn every_generated_kind_passes_the_checker() {
    for kind in kinds::all() {
        for mesh in kind.generate(3_000, 2).meshes.iter().take(2) {
            let corners = corners(mesh);
            for config in [
                KdTreeConfig::default(),
                KdTreeConfig { traversal: KdTraversal::Ropes, traversal_cost: 0.1, ..KdTreeConfig::default() },
                KdTreeConfig { split: KdSplit::Midpoint, ..KdTreeConfig::default() },
            ] {
                let tree = KdNodes::new(&corners, &config);
                let stats = tree.check(&corners).unwrap_or_else(|flaw| panic!("{}: {flaw}", kind.name));
                assert!(corners.len() < 500 || stats.n_leaves > 20, "{}: {stats:?}", kind.name);
            }
        }
    }
}

/// Two groups of four triangles in the ends of a box of 8 x 1 x 1, split at x = 4: the cells have areas 34, 18 and 18.
#[test]
fn the_cost_is_that_of_each_cell_by_its_area() {
    let mut corners: Vec<Corners> = vec![];
    for x in [0.0, 7.0] {
        corners.extend([[[x, 0.0, 0.0], [x + 1.0, 1.0, 0.0], [x, 0.0, 1.0]]; 4]);
    }
    let config = KdTreeConfig { split: KdSplit::Midpoint, ..KdTreeConfig::default() };
    let nodes = KdNodes::new(&corners, &config);
    assert_eq!(nodes.planes().iter().map(|(axis, _)| *axis).collect::<Vec<_>>(), [0]);
    let [end, inner] = [18.0 / 34.0 * 4.0, 2.5];
    let near = |cost: f64, want: f64| assert!((cost - want).abs() < 1e-4 * want, "{cost}, not {want}");
    near(nodes.sah(&config), inner + 2.0 * end);
    near(nodes.sah(&KdTreeConfig { traversal_cost: 0.0, intersection_cost: 3.0, ..config }), 6.0 * end);
    let one = KdNodes::new(&corners, &KdTreeConfig { intersection_cost: 0.0, ..KdTreeConfig::default() });
    near(one.sah(&config), 8.0);
    assert_eq!(KdNodes::new(&[], &config).sah(&config), 0.0);
}

#[test]
fn splits_of_least_cost_cost_less_than_midpoints() {
    let mut n = 0;
    for kind in kinds::all() {
        for mesh in kind.generate(3_000, 2).meshes.iter().take(1).filter(|mesh| mesh.triangles.len() > 500) {
            let corners = corners(mesh);
            let cost = |split| {
                let config = KdTreeConfig { split, ..KdTreeConfig::default() };
                KdNodes::new(&corners, &config).sah(&config)
            };
            let (sah, midpoint) = (cost(KdSplit::Sah), cost(KdSplit::Midpoint));
            assert!(sah < midpoint, "{}: {sah}, {midpoint} at midpoints", kind.name);
            n += 1;
        }
    }
    assert!(n > 20, "{n} kinds");
}

/// Areas are relative to the node's, and pads to coordinates: a power of two changes no decision.
#[test]
fn scale_changes_no_decision() {
    let mesh = soup(3, 800);
    let nodes = |scale: f32| KdNodes::new(&corners(&mesh.placed(|p| p.map(|x| x * scale))), &KdTreeConfig::default());
    let unit = nodes(1.0);
    assert!(unit.n_leaves() > 300);
    for exponent in [-40, -10, 10, 40] {
        let scale = 2.0f32.powi(exponent);
        let scaled = nodes(scale);
        let back: Vec<_> = scaled.planes().into_iter().map(|(axis, plane)| (axis, plane / scale)).collect();
        assert_eq!(back, unit.planes(), "2^{exponent}");
        assert_eq!((scaled.n_references(), scaled.n_leaves()), (unit.n_references(), unit.n_leaves()));
    }
}

#[test]
fn threads_change_no_bit() {
    let mesh = kinds::named("gears").unwrap().generate(20_000, 3).meshes.remove(0);
    let corners = corners(&mesh);
    let build = |n_threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| {
            format!(
                "{:?}",
                KdNodes::new(&corners, &KdTreeConfig { traversal: KdTraversal::Ropes, ..KdTreeConfig::default() })
            )
        })
    };
    let one = build(1);
    assert!(one.len() > 100_000);
    for n_threads in [2, 3, 8] {
        assert!(build(n_threads) == one, "{n_threads} threads");
    }
}

/// A scene of `n` triangles by name.
type Kind = (&'static str, fn(u32) -> Mesh);

#[test]
fn equal_triangles_stay_in_one_leaf() {
    const KINDS: [Kind; 3] = [("identical", identical), ("outlier", outlier), ("equal centroids", equal_centroids)];
    for (name, mesh) in KINDS {
        let corners = corners(&mesh(3_000));
        let stats = KdNodes::new(&corners, &KdTreeConfig::default()).check(&corners).unwrap();
        assert_eq!(stats.n_leaves == 1, name == "identical", "{name}: {stats:?}");
    }
    let equal = KdNodes::new(&corners(&identical(100_000)), &KdTreeConfig::default());
    assert_eq!((equal.n_leaves(), equal.n_references()), (1, 100_000));
}

/// Long needles in all directions cross many cells: the limit of references holds.
#[test]
fn needles_do_not_exceed_the_reference_limit() {
    let mut rng = SplitMix64::new(8);
    let mut point = || [0; 3].map(|_| rng.unit() as f32);
    let needles: Vec<Corners> = (0..3_000)
        .map(|_| {
            let (from, to) = (point(), point());
            [from, to, to.map(|x| x + 1e-3)]
        })
        .collect();
    for max_references in [1.0, 3.0, 16.0] {
        let config =
            KdTreeConfig { max_references, traversal_cost: 0.0, max_depth: Some(64), ..KdTreeConfig::default() };
        let stats = KdNodes::new(&needles, &config).check(&needles).unwrap();
        let limit = max_references * 3_000.0 - (stats.n_references + stats.n_empty) as f64;
        assert!(limit >= 0.0, "{stats:?}");
        assert!(max_references < 16.0 || stats.n_references > 9_000, "{stats:?}");
    }
}

#[test]
fn a_tree_passes_the_checker_in_its_own_order() {
    let mesh = soup(6, 400);
    let tree = KdTree::build(
        &mesh.positions,
        &mesh.triangles,
        &KdTreeConfig { test: TriangleTest::MollerTrumbore, ..KdTreeConfig::default() },
    )
    .unwrap();
    let given = corners(&mesh);
    let own: Vec<Corners> = tree.primitives().iter().map(|primitive| given[primitive.index()]).collect();
    tree.nodes().check(&own).unwrap();
    assert!(tree.nodes().check(&given).is_err());
    let mut sorted = tree.primitives().to_vec();
    sorted.sort_unstable();
    assert!((0..400).eq(sorted.iter().map(|primitive| primitive.0)), "every triangle once");
}

#[test]
fn memory_is_the_sum_of_its_parts() {
    let mesh = soup(4, 500);
    let build = |traversal| {
        let config = KdTreeConfig { traversal, test: TriangleTest::MollerTrumbore, ..KdTreeConfig::default() };
        KdTree::build(&mesh.positions, &mesh.triangles, &config).unwrap()
    };
    let (stack, ropes) = (build(KdTraversal::Stack), build(KdTraversal::Ropes));
    let memory = ropes.memory();
    let n_leaves = ropes.nodes().n_leaves();
    assert_eq!(memory.nodes, 8 * (2 * n_leaves - 1));
    assert_eq!(memory.ropes, 64 * n_leaves);
    assert_eq!(memory.references, 4 * ropes.nodes().n_references());
    assert_eq!(memory.triangles, 500 * (size_of::<<MollerTrumbore as Kernel>::Record>() + 4));
    assert_eq!(ropes.n_bytes(), memory.nodes + memory.ropes + memory.references + memory.triangles);
    assert_eq!(stack.n_bytes() + memory.ropes, ropes.n_bytes());
}

#[test]
fn an_empty_tree_has_an_empty_leaf() {
    let tree = KdTree::build(&[], &[], &KdTreeConfig::default()).unwrap();
    assert_eq!((tree.n_triangles(), tree.bounds().half_extents, tree.nodes().n_leaves()), (0, [0.0; 3], 1));
}

#[test]
fn invalid_geometry_is_reported() {
    let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, f32::NAN, 0.0]];
    let error = |triangles: &[[u32; 3]]| KdTree::build(&positions, triangles, &KdTreeConfig::default()).unwrap_err();
    assert_eq!(
        error(&[[0, 1, 0], [0, 1, 2]]).to_string(),
        "triangle 1 has a vertex that is not finite: vertex 2 is (0, NaN, 0)"
    );
    assert_eq!(error(&[[0, 1, 3]]).to_string(), "triangle 0 has vertex index 3, but there are 3 vertices");
    // Beyond the promised range hits may be missed, but nothing panics.
    let far = [[f32::MAX; 3], [f32::MIN; 3], [f32::MAX, f32::MIN, 0.0], [0.0, 1.0, 0.0]];
    for traversal in [KdTraversal::Stack, KdTraversal::Ropes] {
        let config = KdTreeConfig { traversal, traversal_cost: 0.01, ..KdTreeConfig::default() };
        let tree = KdTree::build(&far, &[[0, 1, 2], [1, 2, 3], [0, 0, 1]], &config).unwrap();
        for ray in [Ray::new([f32::MAX; 3], [-1.0; 3]), Ray::new([0.0; 3], [1.0, 2.0, 3.0])] {
            let _ = tree.closest_hit(&ray);
        }
    }
}
