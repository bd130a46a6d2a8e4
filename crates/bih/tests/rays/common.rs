//! Meshes, rays and the loop.

use canted_bih::{Bih, BihConfig, LeafSize};
use canted_fixtures::{
    Grazing, Mesh, Rotation, SplitMix64, coplanar_quads, displaced_icosphere, equal_centroids, fan, grazing, identical,
    outlier, slivers, soup, thin_box, torus,
};
use canted_obb::PrimId;
use canted_trace::{BaldwinWeber, Hit, InstanceId, Kernel, MollerTrumbore, Ray, ScaledRay, TriangleTest, Watertight};

pub(crate) fn config(leaf_size: u32, tight_factor: f32) -> BihConfig {
    BihConfig { leaf_size: LeafSize::AtMost(leaf_size), tight_factor, ..BihConfig::default() }
}

/// Every leaf size that matters with every extreme of the tight-box rule.
pub(crate) fn configs() -> Vec<BihConfig> {
    let mut configs = vec![BihConfig::default()];
    for leaf_size in [0, 1, 2, 5, 30, u32::MAX] {
        configs.extend([1.3, 1.0, 0.0, f32::NAN, f32::INFINITY].map(|factor| config(leaf_size, factor)));
    }
    configs
}

/// A kernel, and its name in a configuration.
pub(crate) trait Named: Kernel {
    const TEST: TriangleTest;
}

impl Named for Watertight {
    const TEST: TriangleTest = TriangleTest::Watertight;
}

impl Named for MollerTrumbore {
    const TEST: TriangleTest = TriangleTest::MollerTrumbore;
}

impl Named for BaldwinWeber {
    const TEST: TriangleTest = TriangleTest::BaldwinWeber;
}

pub(crate) fn build<K: Named>(mesh: &Mesh, config: &BihConfig) -> Bih {
    let bih = Bih::build(&mesh.positions, &mesh.triangles, &BihConfig { test: K::TEST, ..*config }).unwrap();
    assert_eq!(bih.test(), K::TEST);
    bih
}

/// Two soups in the same position, so that every hit is a tie.
pub(crate) fn doubled() -> Mesh {
    let Mesh { positions, triangles } = soup(5, 120);
    let triangles = [&triangles[..], &triangles].concat();
    Mesh { positions, triangles }
}

/// Triangles whose vertices are whole numbers from -4 to 4: flats, needles, points, duplicates, shared planes, both zeros.
fn whole_numbers(seed: u64, n: u32) -> Mesh {
    let mut rng = SplitMix64::new(seed);
    let mut mesh = Mesh::default();
    for i in 0..n {
        let start: [f32; 3] = std::array::from_fn(|_| rng.below(9) as f32 - 4.0);
        for _ in 0..3 {
            mesh.positions.push(start.map(|x| {
                let moved = x + rng.below(3) as f32 - 1.0;
                if moved == 0.0 && rng.signed() < 0.0 { -0.0 } else { moved }
            }));
        }
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        if rng.below(4) == 0 {
            mesh.triangles.push(mesh.triangles[rng.below(mesh.triangles.len())]);
        }
    }
    mesh.triangles.truncate(n as usize);
    mesh
}

/// Small triangles, and one that reaches 1e6.
fn mixed_scales() -> Mesh {
    let large = vec![[-1e6, -1e6, -9.0], [1e6, -1e6, -9.0], [0.0, 1e6, -9.0]];
    soup(6, 150).joined(&Mesh { positions: large, triangles: vec![[0, 1, 2]] })
}

pub(crate) fn meshes() -> Vec<(&'static str, Mesh)> {
    vec![
        ("doubled", doubled()),
        ("torus", torus(12, 7)),
        ("slivers", slivers(8, 150)),
        ("bumpy sphere", displaced_icosphere(3, 1)),
        ("identical", identical(60)),
        ("equal centroids", equal_centroids(80)),
        ("outlier", outlier(150)),
        ("fan", fan(40)),
        ("coplanar quads", coplanar_quads(7)),
        ("flat box", thin_box(0.0)),
        ("whole numbers", whole_numbers(1, 200)),
        ("mixed scales", mixed_scales()),
        ("one", soup(1, 1)),
        ("two", soup(2, 2)),
        ("none", soup(3, 0)),
    ]
}

/// Each mesh unchanged, at scales 1e-6 and 1e6, and far from the origin.
pub(crate) fn placed_meshes() -> Vec<(String, Mesh)> {
    let turn = Rotation::off_axis();
    let mut placed = vec![];
    for (name, mesh) in meshes() {
        let mut add = |how: &str, change: &dyn Fn([f32; 3]) -> [f32; 3]| {
            placed.push((format!("{name}, {how}"), mesh.placed(change)));
        };
        add("unchanged", &|p| p);
        add("at 1e-6, rotated", &|p| turn.apply_f32(p).map(|x| x * 1e-6));
        add("at 1e6", &|p| p.map(|x| x * 1e6));
        add("at 1e7", &|p| [p[0] * 50.0 + 1e7, p[1] * 50.0 - 1e7, p[2] * 50.0 + 1e7]);
    }
    placed
}

/// Rays that graze, with intervals, lengths and signs of zero of every kind, and rays in the planes of triangles.
pub(crate) fn rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    if mesh.triangles.is_empty() {
        return vec![Ray::new([0.0; 3], [1.0, 0.0, 0.0])];
    }
    let mut rng = SplitMix64::new(77);
    let at_edges = Grazing::ALL.into_iter().flat_map(|class| grazing(mesh, class, n, 9));
    let mut rays: Vec<Ray> = at_edges.map(|ray| Ray::new(ray.origin, ray.direction)).collect();
    for _ in 0..n {
        // From a vertex to a vertex, and along an axis through one: in the planes of triangles and of nodes.
        let [a, b] =
            [(); 2].map(|()| mesh.positions[mesh.triangles[rng.below(mesh.triangles.len())][rng.below(3)] as usize]);
        rays.push(Ray::new(a, std::array::from_fn(|k| b[k] - a[k])));
        let mut along = [0.0; 3];
        along[rng.below(3)] = if rng.signed() < 0.0 { -1.0 } else { 1.0 };
        rays.push(Ray::new(a, along));
        // Nearly parallel to two axes.
        rays.push(Ray::new(a, along.map(|d: f32| if d == 0.0 { 1e-30 } else { d })));
    }
    for (i, ray) in rays.iter_mut().enumerate() {
        (ray.t_min, ray.t_max) = [(0.0, f32::INFINITY), (0.0, 1.0), (0.5, f32::INFINITY), (0.0, f32::MAX)][i % 4];
        let scale = [1.0, 2.0f32.powi(-40), -1.0, 1e18, 3.0][i % 5];
        ray.direction = ray.direction.map(|d| if d == 0.0 && i % 2 == 0 { -0.0 } else { d * scale });
    }
    rays
}

/// Every hit: least `t` first, then lowest primitive.
pub(crate) fn loop_over_all<K: Kernel>(mesh: &Mesh, ray: &Ray) -> Vec<Hit> {
    let Some(ray) = ScaledRay::new(ray) else { return vec![] };
    let prepared = K::prepare(&ray);
    let records = mesh.triangles.iter().map(|t| K::record(t.map(|v| mesh.positions[v as usize])));
    let mut hits: Vec<Hit> = (0..)
        .map(PrimId)
        .zip(records)
        .filter_map(|(primitive, record)| {
            let hit = K::intersect(&prepared, &ray, &record, ray.t_max)?;
            Some(Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance: InstanceId(0), side: hit.side })
        })
        .collect();
    // By the scaled `t`: that of the caller may be rounded to equal numbers.
    hits.sort_by(|a, b| if a.before(b) { std::cmp::Ordering::Less } else { std::cmp::Ordering::Greater });
    hits.into_iter().map(|hit| Hit { t: ray.caller_t(hit.t), ..hit }).collect()
}
