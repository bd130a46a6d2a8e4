//! Slices, filters, counters, invalid input and empty trees.

mod oracle;

use canted_fixtures::{Mesh, soup, torus};
use canted_kdtree::{KdTree, KdTreeConfig};
use canted_trace::{Accept, Counts, Hit, Intersect, Ray, Watertight};

use oracle::{Oracle, both, deep, doubled, rays};

#[test]
fn slices_and_filters_agree_with_single_rays() {
    let mesh = doubled();
    let rays = rays(&mesh, 100);
    let n = rays.len();
    let oracle = Oracle::<Watertight>::new(&mesh);
    let accepts = |i: usize, hit: &Hit| (hit.primitive.index() + i).is_multiple_of(2);
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
        tree.closest_hits_with(&rays, &mut closest, &|i, _, hit| accepts(i, hit));
        tree.par_closest_hits_with(&rays, &mut par_closest, &|i, _, hit| accepts(i, hit));
        tree.occluded_many_with(&rays, &mut occluded, &|i, _, hit| accepts(i, hit));
        tree.par_occluded_many_with(&rays, &mut par_occluded, &|i, _, hit| accepts(i, hit));
        tree.all_hits_many_with(&rays, &mut all, &|i, _, hit| accepts(i, hit));
        tree.par_all_hits_many_with(&rays, &mut par_all, &|i, _, hit| accepts(i, hit));
        assert_eq!((&closest, &occluded, &all), (&par_closest, &par_occluded, &par_all));
        for (i, ray) in rays.iter().enumerate() {
            let mut want = oracle.all_hits(ray);
            want.retain(|hit| accepts(i, hit));
            assert_eq!((closest[i], occluded[i], &all[i]), (want.first().copied(), !want.is_empty(), &want), "{ray:?}");
            let mut hits = vec![];
            tree.all_hits_with(ray, &mut Accept(|hit: &Hit| accepts(i, hit)), &mut hits);
            assert_eq!(hits, want);
            assert_eq!(tree.closest_hit_with(ray, &mut Accept(|hit: &Hit| accepts(i, hit))), closest[i]);
            assert_eq!(tree.occluded_with(ray, &mut Accept(|hit: &Hit| accepts(i, hit))), occluded[i]);
        }
    }
}

#[test]
fn an_empty_tree_is_never_hit() {
    let ray = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
    for tree in both::<Watertight>(&Mesh::default(), &KdTreeConfig::default()) {
        let mut hits = vec![];
        tree.all_hits(&ray, &mut hits);
        assert_eq!((tree.closest_hit(&ray), tree.occluded(&ray), hits.len(), tree.n_triangles()), (None, false, 0, 0));
        assert_eq!((tree.bounds().half_extents, tree.nodes().n_leaves()), ([0.0; 3], 1));
    }
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
    for tree in
        both::<Watertight>(&Mesh { positions: far.to_vec(), triangles: vec![[0, 1, 2], [1, 2, 3], [0, 0, 1]] }, &deep())
    {
        for ray in [Ray::new([f32::MAX; 3], [-1.0; 3]), Ray::new([0.0; 3], [1.0, 2.0, 3.0])] {
            let _ = tree.closest_hit(&ray);
        }
    }
}

#[test]
fn queries_count_their_tests() {
    let mesh = torus(10, 6);
    for tree in both::<Watertight>(&mesh, &deep()) {
        let ray = rays(&mesh, 20).into_iter().find(|ray| tree.occluded(ray)).unwrap();
        let mut counts = Counts::default();
        assert_eq!(tree.closest_hit_with(&ray, &mut counts), tree.closest_hit(&ray));
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
        let tree = KdTree::build(&mesh.positions, &mesh.triangles, &KdTreeConfig::default()).unwrap();
        for ray in rays(&small, 100) {
            let _ = tree.closest_hit_with(&ray, &mut counts);
        }
        counts
    };
    let (without, with) = (counts(&small), counts(&mesh));
    assert!(with.triangles < 3 * without.triangles && with.boxes < 3 * without.boxes, "{without:?}, then {with:?}");
}
