//! Queries of a `Bvh2` against a loop over all triangles.

use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::{Grazing, Mesh, grazing, soup, torus};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::PrimId;
use canted_trace::{
    Accept, BaldwinWeber, Counts, Hit, InstanceId, Intersect, Kernel, MollerTrumbore, Ray, ScaledRay, SlabRay,
    TriangleTest, Watertight,
};

fn build(mesh: &Mesh, strategy: Strategy, test: TriangleTest) -> Bvh2 {
    let config = Bvh2Config { volumes: VolumeConfig { strategy, fallback: true }, test, ..Bvh2Config::default() };
    Bvh2::build(&mesh.positions, &mesh.triangles, &config).unwrap()
}

/// Two soups in the same position, so that every hit is a tie.
fn doubled() -> Mesh {
    let Mesh { positions, triangles } = soup(5, 120);
    let triangles = [&triangles[..], &triangles].concat();
    Mesh { positions, triangles }
}

fn rays(mesh: &Mesh) -> Vec<Ray> {
    let at_edges = Grazing::ALL.into_iter().flat_map(|class| grazing(mesh, class, 200, 9));
    at_edges
        .enumerate()
        .map(|(i, ray)| {
            let (t_min, t_max) = [(0.0, f32::INFINITY), (0.0, 1.0), (0.5, f32::INFINITY)][i % 3];
            Ray::new(ray.origin, ray.direction).between(t_min, t_max)
        })
        .collect()
}

/// Every hit: least `t` first, then lowest primitive.
fn loop_over_all<K: Kernel>(mesh: &Mesh, ray: &Ray) -> Vec<Hit> {
    let Some(ray) = ScaledRay::new(ray) else { return vec![] };
    let prepared = K::prepare(&ray);
    let records = mesh.triangles.iter().map(|t| K::record(t.map(|v| mesh.positions[v as usize])));
    let mut hits: Vec<Hit> = (0..)
        .map(PrimId)
        .zip(records)
        .filter_map(|(primitive, record)| {
            let hit = K::intersect(&prepared, &ray, &record, ray.t_max)?;
            let t = ray.caller_t(hit.t);
            Some(Hit { t, u: hit.u, v: hit.v, primitive, instance: InstanceId(0), side: hit.side })
        })
        .collect();
    hits.sort_by(|a, b| if a.before(b) { std::cmp::Ordering::Less } else { std::cmp::Ordering::Greater });
    hits
}

fn agrees<K: Kernel>(test: TriangleTest) {
    for mesh in [doubled(), torus(10, 6)] {
        let rays = rays(&mesh);
        let n = rays.len();
        for strategy in Strategy::ALL {
            let bvh = build(&mesh, strategy, test).clone();
            let (mut closest, mut par_closest) = (vec![None; n], vec![None; n]);
            let (mut occluded, mut par_occluded) = (vec![false; n], vec![false; n]);
            let (mut all, mut par_all) = (vec![vec![]; n], vec![vec![]; n]);
            bvh.closest_hits(&rays, &mut closest);
            bvh.par_closest_hits(&rays, &mut par_closest);
            bvh.occluded_many(&rays, &mut occluded);
            bvh.par_occluded_many(&rays, &mut par_occluded);
            bvh.all_hits_many(&rays, &mut all);
            bvh.par_all_hits_many(&rays, &mut par_all);
            assert_eq!((&closest, &occluded, &all), (&par_closest, &par_occluded, &par_all));
            let mut hits = vec![];
            for (i, ray) in rays.iter().enumerate() {
                let want = loop_over_all::<K>(&mesh, ray);
                bvh.all_hits(ray, &mut hits);
                assert_eq!((&hits, &all[i]), (&want, &want), "{strategy:?}, {ray:?}");
                assert_eq!((closest[i], occluded[i]), (want.first().copied(), !want.is_empty()), "{ray:?}");
                assert_eq!((bvh.closest_hit(ray), bvh.occluded(ray)), (closest[i], occluded[i]), "{ray:?}");
            }
            assert!(closest.iter().flatten().count() * 3 > n, "too few rays hit");
        }
    }
}

#[test]
fn watertight_agrees_with_the_loop() {
    agrees::<Watertight>(TriangleTest::Watertight);
}

#[test]
fn moller_trumbore_agrees_with_the_loop() {
    agrees::<MollerTrumbore>(TriangleTest::MollerTrumbore);
}

#[test]
fn baldwin_weber_agrees_with_the_loop() {
    agrees::<BaldwinWeber>(TriangleTest::BaldwinWeber);
}

#[test]
fn filters_accept_by_ray_and_hit() {
    let mesh = doubled();
    let rays = rays(&mesh);
    let bvh = build(&mesh, Strategy::Dop, TriangleTest::Watertight);
    let n = rays.len();
    let accepts = |i: usize, hit: &Hit| (hit.primitive.index() + i).is_multiple_of(2);
    let (mut closest, mut par_closest) = (vec![None; n], vec![None; n]);
    let (mut occluded, mut par_occluded) = (vec![false; n], vec![false; n]);
    let (mut all, mut par_all) = (vec![vec![]; n], vec![vec![]; n]);
    bvh.closest_hits_with(&rays, &mut closest, &|i, _, hit| accepts(i, hit));
    bvh.par_closest_hits_with(&rays, &mut par_closest, &|i, _, hit| accepts(i, hit));
    bvh.occluded_many_with(&rays, &mut occluded, &|i, _, hit| accepts(i, hit));
    bvh.par_occluded_many_with(&rays, &mut par_occluded, &|i, _, hit| accepts(i, hit));
    bvh.all_hits_many_with(&rays, &mut all, &|i, _, hit| accepts(i, hit));
    bvh.par_all_hits_many_with(&rays, &mut par_all, &|i, _, hit| accepts(i, hit));
    assert_eq!((&closest, &occluded, &all), (&par_closest, &par_occluded, &par_all));
    for (i, ray) in rays.iter().enumerate() {
        let mut want = loop_over_all::<Watertight>(&mesh, ray);
        want.retain(|hit| accepts(i, hit));
        assert_eq!((closest[i], occluded[i], &all[i]), (want.first().copied(), !want.is_empty(), &want), "{ray:?}");
        assert_eq!(bvh.closest_hit_with(ray, &mut Accept(|hit: &Hit| accepts(i, hit))), closest[i]);
        assert_eq!(bvh.occluded_with(ray, &mut Accept(|hit: &Hit| accepts(i, hit))), occluded[i]);
    }
}

#[test]
fn an_empty_bvh_is_never_hit() {
    let bvh = build(&Mesh::default(), Strategy::Combined, TriangleTest::Watertight);
    let ray = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
    let mut hits = vec![];
    bvh.all_hits(&ray, &mut hits);
    assert_eq!((bvh.closest_hit(&ray), bvh.occluded(&ray), hits.len(), bvh.n_triangles()), (None, false, 0, 0));
}

#[test]
fn queries_count_their_tests() {
    let mesh = torus(10, 6);
    let bvh = build(&mesh, Strategy::Aabb, TriangleTest::Watertight);
    let ray = rays(&mesh).into_iter().find(|ray| bvh.occluded(ray)).unwrap();
    let mut counts = Counts::default();
    assert_eq!(bvh.closest_hit_with(&ray, &mut counts), bvh.closest_hit(&ray));
    assert!(counts.boxes > 0 && (1..120).contains(&counts.triangles), "{counts:?}");
    let printed = format!("{bvh:?}");
    assert!(printed.starts_with("Bvh2 { n_triangles: 120, "), "{printed}");
}

/// Boxes carry pads by their own content, so that a floor of 1e6 does not slow rays among small triangles.
#[test]
fn a_large_triangle_does_not_loosen_other_boxes() {
    let small = soup(6, 3_000);
    let far: Vec<[f32; 3]> = [[-1e6, -1e6, -9.0], [1e6, -1e6, -9.0], [0.0, 1e6, -9.0]].to_vec();
    let mesh = small.joined(&Mesh { positions: far, triangles: vec![[0, 1, 2]] });
    let rays: Vec<Ray> = rays(&small).into_iter().step_by(10).collect();
    for strategy in Strategy::ALL {
        let bvh = build(&mesh, strategy, TriangleTest::Watertight);
        let (mut local, mut global) = (Counts::default(), Counts::default());
        for ray in &rays {
            let hit = loop_over_all::<Watertight>(&mesh, ray).first().copied();
            assert_eq!(bvh.closest_hit_with(ray, &mut local), hit, "{strategy:?}: {ray:?}");
            // The same ray with pads by the reach of the whole mesh.
            let scaled = ScaledRay::new(ray).unwrap();
            let t_max = hit.map_or(scaled.t_max, |hit| scaled.scaled_t(hit.t));
            let by_mesh = SlabRay::new(&scaled, bvh.pairs().reach());
            bvh.pairs().traverse_ordered(&by_mesh, t_max, &mut global, |_, t_max, _| t_max);
        }
        assert!(
            3 * local.boxes < global.boxes,
            "{strategy:?}: {} box tests, {} by the mesh",
            local.boxes,
            global.boxes
        );
    }
}
