//! Queries of a `KdTree` against a loop over all triangles, with both traversals.

mod oracle;

use canted_fixtures::kinds::{self, RayKind};
use canted_fixtures::{
    Mesh, SplitMix64, coplanar_quads, equal_centroids, fan, identical, outlier, slivers, soup, torus,
};
use canted_kdtree::{KdTree, KdTreeConfig};
use canted_trace::{BaldwinWeber, Intersect, MollerTrumbore, Ray, Watertight};

use oracle::{NamedKernel, Oracle, both, deep, doubled, rays};

/// All queries of every ray; returns how many rays hit.
fn agrees<K: NamedKernel>(name: &str, mesh: &Mesh, rays: &[Ray], config: &KdTreeConfig) -> usize {
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
        for config in [KdTreeConfig::default(), deep()] {
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
    for (i, j) in (0..8u8).flat_map(|i| (0..8u8).map(move |j| (i, j))) {
        let [x, y] = [i, j].map(f32::from);
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
        for config in [KdTreeConfig::default(), deep()] {
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
        agrees::<Watertight>(kind.name, mesh, &all, &KdTreeConfig::default());
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
            let config = KdTreeConfig { empty_bonus, max_depth, max_references, ..deep() };
            agrees::<Watertight>("doubled", &mesh, &rays, &config);
            let tree = KdTree::build(&mesh.positions, &mesh.triangles, &config).unwrap();
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
        let config = KdTreeConfig { traversal_cost, intersection_cost, empty_bonus, ..KdTreeConfig::default() };
        agrees::<Watertight>("doubled", &mesh, &rays[..30], &config);
    }
}
