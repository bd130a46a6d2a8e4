//! Queries of a `KdTree` against a loop over all triangles, with both traversals.

mod oracle;

use canted_fixtures::kinds::{self, RayKind};
use canted_fixtures::{
    Mesh, SplitMix64, coplanar_quads, equal_centroids, fan, grazing, identical, outlier, slivers, soup, torus,
};
use canted_kdtree::{Config, KdTree, Traversal};
use canted_trace::{BaldwinWeber, Counts, InstanceId, Kernel, MollerTrumbore, Ray, Watertight};

use oracle::{Oracle, doubled, rays};

/// A tree with small leaves, so that there are many planes, traced both ways.
fn both<K: Kernel>(mesh: &Mesh, config: &Config) -> [KdTree<K>; 2] {
    let tree = KdTree::build(&mesh.positions, &mesh.triangles, config).unwrap();
    [tree.clone().with_traversal(Traversal::Stack), tree.with_traversal(Traversal::Ropes)]
}

fn deep() -> Config {
    Config { traversal_cost: 0.01, ..Config::default() }
}

/// All queries of every ray; returns how many rays hit.
fn agrees<K: Kernel>(name: &str, mesh: &Mesh, rays: &[Ray], config: &Config) -> usize {
    let oracle = Oracle::<K>::new(mesh);
    let trees = both::<K>(mesh, config);
    let (mut n_hit, mut hits) = (0, vec![]);
    for ray in rays {
        let want = oracle.all_hits(ray);
        for tree in &trees {
            let traversal = tree.nodes().traversal();
            assert_eq!(tree.closest_hit(ray), want.first().copied(), "{name}, {traversal:?}: {ray:?}");
            assert_eq!(tree.occluded(ray), !want.is_empty(), "{name}, {traversal:?}: {ray:?}");
            tree.all_hits(ray, &mut hits);
            assert_eq!(hits, want, "{name}, {traversal:?}: {ray:?}");
        }
        n_hit += usize::from(!want.is_empty());
    }
    n_hit
}

#[test]
fn every_kernel_agrees_with_the_loop() {
    for (name, mesh) in [("doubled", doubled()), ("torus", torus(10, 6))] {
        let rays = rays(&mesh, 200);
        for config in [Config::default(), deep()] {
            let n_hit = agrees::<Watertight>(name, &mesh, &rays, &config);
            assert!(n_hit * 3 > rays.len(), "{name}: too few rays hit");
            agrees::<MollerTrumbore>(name, &mesh, &rays, &config);
            agrees::<BaldwinWeber>(name, &mesh, &rays, &config);
        }
    }
}

/// A mesh by name.
type Named = (&'static str, Mesh);

fn ugly() -> Vec<Named> {
    let mut meshes = vec![
        ("identical", identical(300)),
        ("equal centroids", equal_centroids(300)),
        ("outlier", outlier(300)),
        ("slivers", slivers(7, 300)),
        ("fan", fan(200)),
        ("coplanar", coplanar_quads(100)),
    ];
    // Points and segments, some of them in one place, and a vertex of -0.0.
    let mut points = soup(11, 60);
    for (i, triangle) in points.triangles.iter_mut().enumerate() {
        match i % 3 {
            0 => triangle[1] = triangle[0],
            1 => *triangle = [triangle[0]; 3],
            _ => {}
        }
    }
    points.positions[0] = [-0.0; 3];
    meshes.push(("points and segments", points));
    // Axis-aligned grid of flat quads: every plane is shared by many vertices.
    let mut grid = Mesh::default();
    for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (i, j))) {
        let [x, y] = [i, j].map(|i| f32::from(i as i16));
        let first = u32::try_from(grid.positions.len()).unwrap();
        grid.positions.extend([[x, y, 0.0], [x + 1.0, y, 0.0], [x, y + 1.0, 0.0], [x, y, 1.0], [x, y + 1.0, 1.0]]);
        grid.triangles.extend([[0, 1, 2], [0, 2, 3], [2, 3, 4]].map(|t: [u32; 3]| t.map(|k| first + k)));
    }
    meshes.push(("grid", grid));
    meshes
}

#[test]
fn degenerate_meshes_agree_with_the_loop() {
    for (name, mesh) in ugly() {
        for config in [Config::default(), deep()] {
            agrees::<Watertight>(name, &mesh, &rays(&mesh, 60), &config);
        }
    }
}

#[test]
fn offsets_and_scales_agree_with_the_loop() {
    for (name, mesh) in ugly().into_iter().chain([("soup", soup(5, 200)), ("torus", torus(9, 7))]) {
        for (offset, scale) in [(1e7, 1.0), (0.0, 1e-20), (0.0, 1e15), (3e4, 1e-3)] {
            let moved = mesh.placed(|p| p.map(|x| x * scale + offset));
            agrees::<Watertight>(name, &moved, &rays(&moved, 25), &deep());
        }
    }
}

#[test]
fn mixed_scales_agree_with_the_loop() {
    let small = soup(6, 200);
    let floor =
        Mesh { positions: vec![[-1e6, -1e6, 0.5], [1e6, -1e6, 0.5], [0.0, 1e6, 0.5]], triangles: vec![[0, 1, 2]] };
    let mesh = small.joined(&floor).joined(&soup(8, 100).placed(|p| p.map(|x| 1e-5 * x + 0.3)));
    agrees::<Watertight>("mixed", &mesh, &rays(&mesh, 200), &deep());
    agrees::<Watertight>("mixed", &mesh, &rays(&small, 200), &deep());
}

#[test]
fn generated_kinds_agree_with_the_loop() {
    for kind in kinds::all() {
        let scene = kind.generate(1_200, 5);
        let Some(mesh) = scene.meshes.first() else { continue };
        let mut all = rays(mesh, 4);
        if scene.instances.is_empty() {
            for kind in [RayKind::Bounce, RayKind::ALL[0]] {
                let some = scene.rays(kind, 40, 2);
                all.extend(some.iter().map(|ray| Ray { t_max: ray.t_max, ..Ray::new(ray.origin, ray.direction) }));
            }
        }
        agrees::<Watertight>(kind.name, mesh, &all, &Config::default());
    }
}

/// Rays in split planes, from them, and through their edges.
#[test]
fn rays_in_planes_agree_with_the_loop() {
    for (name, mesh) in [("soup", soup(3, 60)), ("torus", torus(8, 6)), ("coplanar", coplanar_quads(40))] {
        let trees = both::<Watertight>(&mesh, &deep());
        let planes = trees[0].nodes().planes();
        assert!(planes.len() > 30, "{name}");
        let (oracle, mut rng) = (Oracle::<Watertight>::new(&mesh), SplitMix64::new(2));
        let cell = *trees[0].nodes().cell();
        for _ in 0..4_000 {
            let mut ray = rays(&mesh, 1)[rng.below(5)];
            let (axis, plane) = planes[rng.below(planes.len())];
            let (other, second) = planes[rng.below(planes.len())];
            ray.origin = std::array::from_fn(|k| {
                let at = if rng.below(2) == 0 { 2.0 * rng.unit() - 0.5 } else { rng.unit() };
                #[expect(clippy::cast_possible_truncation, reason = "any coordinate")]
                let at = at as f32;
                cell.min[k] + at * (cell.max[k] - cell.min[k])
            });
            (ray.origin[axis], ray.origin[other]) = (plane, second);
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
            let want = oracle.all_hits(&ray);
            for tree in &trees {
                assert_eq!(tree.closest_hit(&ray), want.first().copied(), "{name}: {ray:?}");
                let mut hits = vec![];
                tree.all_hits(&ray, &mut hits);
                assert_eq!(hits, want, "{name}: {ray:?}");
            }
        }
    }
}

#[test]
fn directions_of_any_length_agree() {
    let mesh = torus(10, 6);
    let trees = both::<Watertight>(&mesh, &deep());
    for ray in rays(&mesh, 60) {
        for exponent in [-140, -60, -1, 1, 60, 120] {
            let scale = 2.0f64.powi(exponent);
            #[expect(clippy::cast_possible_truncation, reason = "powers of two")]
            let scaled = Ray {
                direction: ray.direction.map(|d| (f64::from(d) * scale) as f32),
                t_min: 0.0,
                t_max: f32::INFINITY,
                ..ray
            };
            let oracle = Oracle::<Watertight>::new(&mesh);
            for tree in &trees {
                assert_eq!(tree.closest_hit(&scaled), oracle.all_hits(&scaled).first().copied(), "{scaled:?}");
            }
        }
    }
}

/// Every value of the configuration gives the same hits.
#[test]
fn the_configuration_changes_no_hit() {
    let mesh = doubled();
    let rays = rays(&mesh, 30);
    let mut n_leaves = vec![];
    for empty_bonus in [0.0, 0.2, 0.5, 0.9] {
        for (max_depth, max_references) in
            [(None, 16.0), (Some(0), 16.0), (Some(3), 2.0), (Some(64), 100.0), (None, 0.0)]
        {
            let config = Config { empty_bonus, max_depth, max_references, ..deep() };
            agrees::<Watertight>("doubled", &mesh, &rays, &config);
            let tree = KdTree::<Watertight>::build(&mesh.positions, &mesh.triangles, &config).unwrap();
            assert!(max_depth.is_none_or(|limit| tree.nodes().depth() <= limit));
            #[expect(clippy::cast_precision_loss, reason = "small numbers")]
            let per_triangle = tree.nodes().n_references() as f64 / mesh.triangles.len() as f64;
            assert!(per_triangle <= max_references.max(1.0), "{per_triangle} references per triangle");
            n_leaves.push(tree.nodes().n_leaves());
        }
    }
    assert!(n_leaves.iter().any(|&n| n > 200) && n_leaves.contains(&1), "{n_leaves:?}");
    for (traversal_cost, intersection_cost, empty_bonus) in
        [(f64::NAN, 1.0, 0.0), (1.0, 0.0, 0.0), (-1.0, 1.0, 2.0), (0.0, f64::INFINITY, f64::NAN), (1.0, -1.0, 0.0)]
    {
        let config = Config { traversal_cost, intersection_cost, empty_bonus, ..Config::default() };
        agrees::<Watertight>("doubled", &mesh, &rays[..30], &config);
    }
}

#[test]
fn slices_and_filters_agree_with_single_rays() {
    let mesh = doubled();
    let rays = rays(&mesh, 100);
    let n = rays.len();
    let oracle = Oracle::<Watertight>::new(&mesh);
    let accepts = |i: usize, hit: &canted_trace::Hit| (hit.primitive.index() + i).is_multiple_of(2);
    for tree in both::<Watertight>(&mesh, &deep()) {
        let (mut closest, mut par_closest) = (vec![None; n], vec![None; n]);
        let (mut occluded, mut par_occluded) = (vec![false; n], vec![false; n]);
        let (mut all, mut par_all) = (vec![vec![]; n], vec![vec![]; n]);
        tree.closest_hits(&rays, &mut closest);
        tree.par_closest_hits(&rays, &mut par_closest);
        tree.occluded_many(&rays, &mut occluded);
        tree.par_occluded_many(&rays, &mut par_occluded);
        tree.all_hits_many(&rays, &mut all);
        tree.par_all_hits_many(&rays, &mut par_all);
        assert_eq!((&closest, &occluded, &all), (&par_closest, &par_occluded, &par_all));
        for (i, ray) in rays.iter().enumerate() {
            let want = oracle.all_hits(ray);
            assert_eq!((closest[i], occluded[i], &all[i]), (want.first().copied(), !want.is_empty(), &want));
        }
        tree.closest_hits_where(&rays, &mut closest, |i, _, hit| accepts(i, hit));
        tree.par_closest_hits_where(&rays, &mut par_closest, |i, _, hit| accepts(i, hit));
        tree.occluded_many_where(&rays, &mut occluded, |i, _, hit| accepts(i, hit));
        tree.par_occluded_many_where(&rays, &mut par_occluded, |i, _, hit| accepts(i, hit));
        tree.all_hits_many_where(&rays, &mut all, |i, _, hit| accepts(i, hit));
        tree.par_all_hits_many_where(&rays, &mut par_all, |i, _, hit| accepts(i, hit));
        assert_eq!((&closest, &occluded, &all), (&par_closest, &par_occluded, &par_all));
        for (i, ray) in rays.iter().enumerate() {
            let mut want = oracle.all_hits(ray);
            want.retain(|hit| accepts(i, hit));
            assert_eq!((closest[i], occluded[i], &all[i]), (want.first().copied(), !want.is_empty(), &want), "{ray:?}");
            let mut hits = vec![];
            tree.all_hits_where(ray, &mut hits, |_, hit| accepts(i, hit));
            assert_eq!(hits, want);
            assert_eq!(tree.closest_hit_where(ray, |_, hit| accepts(i, hit)), closest[i]);
            assert_eq!(tree.occluded_where(ray, |_, hit| accepts(i, hit)), occluded[i]);
        }
    }
}

#[test]
fn an_empty_tree_is_never_hit() {
    let ray = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
    for tree in both::<Watertight>(&Mesh::default(), &Config::default()) {
        let mut hits = vec![];
        tree.all_hits(&ray, &mut hits);
        assert_eq!((tree.closest_hit(&ray), tree.occluded(&ray), hits.len(), tree.n_triangles()), (None, false, 0, 0));
        assert_eq!((tree.bounds().half_extents, tree.nodes().n_leaves()), ([0.0; 3], 1));
    }
}

#[test]
fn invalid_geometry_is_reported() {
    let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, f32::NAN, 0.0]];
    let error =
        |triangles: &[[u32; 3]]| KdTree::<Watertight>::build(&positions, triangles, &Config::default()).unwrap_err();
    assert_eq!(error(&[[0, 1, 0], [0, 1, 2]]).to_string(), "triangle 1 has a vertex that is not finite");
    assert_eq!(error(&[[0, 1, 3]]).to_string(), "triangle 0 has vertex index 3, but there are 3 vertices");
    // Beyond the promised range hits may be missed, but nothing panics.
    let far = [[f32::MAX; 3], [f32::MIN; 3], [f32::MAX, f32::MIN, 0.0], [0.0, 1.0, 0.0]];
    for tree in
        both::<Watertight>(&Mesh { positions: far.to_vec(), triangles: vec![[0, 1, 2], [1, 2, 3], [0, 0, 1]] }, &deep())
    {
        for ray in [Ray::new([f32::MAX; 3], [-1.0; 3]), Ray::new([0.0; 3], [1.0, 2.0, 3.0])] {
            let _ = tree.closest_hit(&ray);
        }
    }
}

#[test]
fn queries_count_their_tests_and_name_the_instance() {
    let mesh = torus(10, 6);
    for tree in both::<Watertight>(&mesh, &deep()) {
        let ray = rays(&mesh, 20).into_iter().find(|ray| tree.occluded(ray)).unwrap();
        let mut counts = Counts::default();
        let hit = tree.closest_hit_with(&ray, InstanceId(7), &mut counts).unwrap();
        assert_eq!(hit.instance, InstanceId(7));
        assert!(counts.boxes > 0 && (1..120).contains(&counts.triangles), "{counts:?}");
        let printed = format!("{tree:?}");
        assert!(printed.starts_with("KdTree { n_triangles: 120, "), "{printed}");
    }
}

/// Pads are relative to a triangle, so that a floor of 1e6 does not slow rays among small triangles.
#[test]
fn a_large_triangle_does_not_loosen_small_ones() {
    let small = soup(6, 3_000);
    let floor = [[-1e6, -1e6, -9.0], [1e6, -1e6, -9.0], [0.0, 1e6, -9.0]].to_vec();
    let mesh = small.joined(&Mesh { positions: floor, triangles: vec![[0, 1, 2]] });
    let counts = |mesh: &Mesh| {
        let mut counts = Counts::default();
        let tree = KdTree::<Watertight>::build(&mesh.positions, &mesh.triangles, &Config::default()).unwrap();
        for ray in rays(&small, 100) {
            let _ = tree.closest_hit_with(&ray, InstanceId(0), &mut counts);
        }
        counts
    };
    let (without, with) = (counts(&small), counts(&mesh));
    assert!(with.triangles < 3 * without.triangles && with.boxes < 3 * without.boxes, "{without:?}, then {with:?}");
    assert!(grazing(&mesh, canted_fixtures::Grazing::Far, 1, 1).len() == 1);
}
