//! Every structure needs as many box tests for a mesh far from the origin of its space as for the same mesh at the origin.

use canted_bih::{Bih, BihConfig};
use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::{Mesh, SplitMix64, soup};
use canted_kdtree::{KdTree, KdTreeConfig};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::Affine;
use canted_tlas::Instance;
use canted_trace::{Counts, InstanceId, Intersect, MollerTrumbore, Ray, TriangleTest};
use canted_wide::{Config, MovingBvh, TriangleBvh};

use crate::oracle::all_hits;

/// By how much a distance may raise the number of box tests. Coordinates are rounded where they land.
const MOST: f64 = 1.25;

/// A place at which the size of a triangle is some 3,000 ulps of its coordinates.
const FAR: [f32; 3] = [3e4, -2e4, 1e4];

fn rays(at: [f32; 3]) -> Vec<Ray> {
    let mut rng = SplitMix64::new(41);
    let mut v = |sphere: bool| if sphere { rng.on_sphere() } else { rng.signed3() }.map(|x| x as f32);
    (0..400).map(|_| (v(false), v(true))).map(|(o, d)| Ray::new([0, 1, 2].map(|k| at[k] + 30.0 * o[k]), d)).collect()
}

/// Box tests; with hits compared with the loop.
fn n_boxes(blas: &impl Intersect, rays: &[Ray], hit: impl Fn(usize) -> Option<canted_trace::Hit>) -> u64 {
    let mut counts = Counts::default();
    for (i, ray) in rays.iter().enumerate() {
        assert_eq!(blas.closest_hit_with(ray, &mut counts), hit(i), "{ray:?}");
        assert_eq!(blas.occluded_with(ray, &mut ()), hit(i).is_some(), "{ray:?}");
    }
    counts.boxes
}

/// Builds over both meshes and compares.
fn assert_local<B: Intersect>(what: &str, meshes: &[Mesh; 2], build: impl Fn(&Mesh) -> B) {
    let places = [[0.0; 3], FAR];
    let [near, far] = [0, 1].map(|i| {
        let (mesh, rays) = (&meshes[i], rays(places[i]));
        let hits: Vec<_> = rays
            .iter()
            .map(|ray| all_hits(std::slice::from_ref(mesh), &[Instance::new(0, Affine::IDENTITY)], ray, 0.0))
            .collect();
        assert!(hits.iter().filter(|hits| !hits.is_empty()).count() > 100, "too few rays hit");
        n_boxes(&build(mesh), &rays, |i| hits[i].first().map(|&(_, hit)| hit))
    });
    let ratio = far as f64 / near as f64;
    assert!(ratio <= MOST, "{what}: {far} box tests instead of {near}");
}

#[test]
fn every_structure_is_as_fast_at_a_distance() {
    let near = soup(40, 2_000).placed(|p| p.map(|x| 60.0 * (x - 0.5)));
    let far = near.placed(|p| [0, 1, 2].map(|k| p[k] + FAR[k]));
    let meshes = [near, far];
    let of = |mesh: &Mesh| (mesh.positions.clone(), mesh.triangles.clone());
    for strategy in [Strategy::Aabb, Strategy::PcaBounded, Strategy::Dop] {
        let config =
            Bvh2Config { volumes: VolumeConfig { strategy, ..VolumeConfig::default() }, ..Bvh2Config::default() };
        assert_local(&format!("bvh2, {strategy:?}"), &meshes, |mesh| {
            Bvh2::build(&mesh.positions, &mesh.triangles, &config).unwrap()
        });
    }
    assert_local("bih", &meshes, |mesh| Bih::build(&mesh.positions, &mesh.triangles, &BihConfig::default()).unwrap());
    assert_local("kd-tree", &meshes, |mesh| {
        KdTree::build(&mesh.positions, &mesh.triangles, &KdTreeConfig::default()).unwrap()
    });
    for config in [Config::default(), Config::default().axis_aligned()] {
        assert_local("wide", &meshes, |mesh| {
            TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).unwrap()
        });
        assert_local("moving", &meshes, |mesh| {
            let (positions, triangles) = of(mesh);
            MovingBvh::build_with(&positions, &positions, &triangles, config).unwrap()
        });
    }
}

/// The kernels with an exact stage in f64 have errors relative to the distance, too: their hits are those of the loop.
#[test]
fn other_kernels_agree_at_a_distance() {
    let mesh = soup(42, 300).placed(|p| [0, 1, 2].map(|k| 60.0 * (p[k] - 0.5) + 300.0 * FAR[k]));
    let bvh = TriangleBvh::build_with(
        &mesh.positions,
        &mesh.triangles,
        Config { test: TriangleTest::MollerTrumbore, ..Config::default() },
    )
    .unwrap();
    let binary = Bvh2::build(
        &mesh.positions,
        &mesh.triangles,
        &Bvh2Config { test: TriangleTest::MollerTrumbore, ..Bvh2Config::default() },
    )
    .unwrap();
    let mut n_hits = 0;
    for (i, triangle) in mesh.triangles.iter().cycle().take(2_000).enumerate() {
        let [a, b] = [triangle[i % 3], triangle[(i + 1) % 3]].map(|v| mesh.positions[v as usize]);
        let at = FAR.map(|x| 300.0 * x);
        let from = [at[0] + (i % 97) as f32 - 48.0, at[1] + (i % 89) as f32 - 44.0, at[2] + (i % 83) as f32 - 41.0];
        let target = [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]));
        let ray = Ray::new(from, [0, 1, 2].map(|k| target[k] - from[k]));
        let want = closest::<MollerTrumbore>(&mesh, &ray);
        assert_eq!(bvh.closest_hit(&ray), want, "{ray:?}");
        assert_eq!(binary.closest_hit(&ray), want, "{ray:?}");
        n_hits += usize::from(want.is_some());
    }
    assert!(n_hits > 500, "{n_hits}");
}

/// The closest hit of all triangles.
fn closest<K: canted_trace::Kernel>(mesh: &Mesh, ray: &Ray) -> Option<canted_trace::Hit> {
    let scaled = canted_trace::ScaledRay::new(ray)?;
    let prepared = K::prepare(&scaled);
    let mut best: Option<canted_trace::Hit> = None;
    for (primitive, triangle) in (0..).map(canted_obb::PrimId).zip(&mesh.triangles) {
        let record = K::record(triangle.map(|v| mesh.positions[v as usize]));
        let Some(hit) = K::intersect(&prepared, &scaled, &record, scaled.t_max) else { continue };
        let hit =
            canted_trace::Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance: InstanceId(0), side: hit.side };
        if best.is_none_or(|best| hit.before(&best)) {
            best = Some(hit);
        }
    }
    best.map(|hit| canted_trace::Hit { t: scaled.caller_t(hit.t), ..hit })
}
