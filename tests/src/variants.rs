//! Configurations of wide BVHs, SIMD paths, and comparison with the loop over all triangles.

use canted_bvh2::{Bvh2, Bvh2Boxes, Bvh2Config};
use canted_fixtures::Mesh;
use canted_lbvh::{Strategy, VolumeConfig};
use canted_tlas::TopConfig;
use canted_trace::{Accept, Hit, Intersect, Ray, TriangleTest};
use canted_wide::{Config, Costs, NodeKind, Preset, SimdPath, TriangleBvh};

use crate::brute;

/// A build configuration with its name for messages.
pub type Variant = (String, Config);

const PRESETS: [Preset; 4] = [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality];

/// Every preset with and without oriented nodes and with and without a local mesh frame (except those that never rotate); then nodes of a
/// single kind.
#[must_use]
pub fn every_variant() -> Vec<Variant> {
    let mut variants = vec![];
    for preset in PRESETS {
        for oriented in [false, true] {
            // The search for a frame takes longest and does not depend on the builder.
            let n_frames = if matches!(preset, Preset::Dynamic | Preset::Fast) { 1 } else { 2 };
            for rotate_mesh in [false, true].into_iter().take(n_frames) {
                let config = Config { oriented, rotate_mesh, ..Config::preset(preset) };
                variants.push((format!("{preset:?}, oriented {oriented}, rotated {rotate_mesh}"), config));
            }
        }
    }
    variants.extend(single_kind_variants());
    variants
}

/// The presets, and nodes of a single kind, for tests that do not need every configuration.
#[must_use]
pub fn few_variants() -> Vec<Variant> {
    let presets = PRESETS.map(|preset| (format!("{preset:?}"), Config::preset(preset)));
    presets.into_iter().chain(single_kind_variants()).collect()
}

/// Nearly free nodes of each kind over leaves of one triangle, for as many nodes of that kind as possible.
#[must_use]
pub fn single_kind_variants() -> [Variant; 2] {
    NodeKind::ALL.map(|kind| (format!("{kind:?} nodes"), of_one_kind(kind)))
}

/// BVHs with nodes of one kind and one triangle per leaf.
#[must_use]
pub fn of_one_kind(kind: NodeKind) -> Config {
    let [aligned_node, oriented_node] = match kind {
        NodeKind::Aligned => [0.01, 1e6],
        NodeKind::Oriented => [1e6, 0.01],
    };
    let costs = Costs { aligned_node, oriented_node, leaf: 0.0, block: 0.01, max_leaf: 1 };
    Config { costs, rotate_mesh: kind == NodeKind::Aligned, ..Config::preset(Preset::Balanced) }
}

/// The mesh's BVH.
///
/// # Panics
/// Panics for invalid meshes.
pub fn build(mesh: &Mesh, config: &Config) -> TriangleBvh {
    TriangleBvh::build_with(&mesh.positions, &mesh.triangles, *config).expect("fixtures are valid")
}

/// A binary BVH with boxes of this strategy, which fall back to axis-aligned ones.
///
/// # Panics
/// Panics for invalid meshes.
pub fn binary(mesh: &Mesh, strategy: Strategy, test: TriangleTest) -> Bvh2 {
    let config = Bvh2Config { volumes: VolumeConfig { strategy, fallback: true }, test, ..Bvh2Config::default() };
    Bvh2::build(&mesh.positions, &mesh.triangles, &config).expect("fixtures are valid")
}

/// Binary BVHs of every strategy and wide ones of few variants on every SIMD path, by name.
#[must_use]
pub fn every_bvh(mesh: &Mesh, test: TriangleTest) -> Vec<(String, Box<dyn Intersect>)> {
    let mut bvhs: Vec<(String, Box<dyn Intersect>)> = vec![];
    for strategy in Strategy::ALL {
        bvhs.push((format!("binary, {strategy:?}"), Box::new(binary(mesh, strategy, test))));
    }
    for (variant, config) in few_variants() {
        let bvh = build(mesh, &Config { test, ..config });
        for path in paths().0 {
            bvhs.push((format!("wide, {variant}, {}", path.name()), Box::new(bvh.clone().with_path(path))));
        }
    }
    bvhs
}

/// A top level of binary nodes with these volumes.
#[must_use]
pub fn binary_top(volumes: VolumeConfig) -> TopConfig {
    TopConfig::other(Bvh2Boxes::builder(volumes))
}

/// Available SIMD paths, and the names of the others.
#[must_use]
pub fn paths() -> (Vec<SimdPath>, Vec<&'static str>) {
    let (there, missing): (Vec<_>, Vec<_>) = SimdPath::ALL.into_iter().partition(|path| path.is_available());
    (there, missing.into_iter().map(SimdPath::name).collect())
}

/// The answers of the loop over all triangles.
#[must_use]
pub fn loop_over_all(mesh: &Mesh, test: TriangleTest, rays: &[Ray]) -> Vec<Option<Hit>> {
    rays.iter().map(brute::of_mesh(mesh, test)).collect()
}

/// The first ray for which a BVH differs from `wants`: alone, in a slice or for occlusion.
#[must_use]
pub fn first_difference(bvh: &dyn Intersect, rays: &[Ray], wants: &[Option<Hit>]) -> Option<String> {
    let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
    bvh.closest_hits(rays, &mut hits);
    bvh.occluded_many(rays, &mut occluded);
    rays.iter().zip(wants).enumerate().find_map(|(i, (ray, want))| {
        let alone = (bvh.closest_hit(ray), bvh.occluded(ray));
        let all = [(hits[i], occluded[i]), alone];
        let is_equal = all.iter().all(|&(hit, occluded)| is_same(hit, *want) && occluded == want.is_some());
        (!is_equal).then(|| format!("ray {i}, {ray:?}: {all:?}, not {want:?}"))
    })
}

/// The first query that differs from `wants`, the list of all hits of each ray: single rays, slices, and slices in parallel, each with
/// and without a filter.
#[must_use]
pub fn first_wrong_query(bvh: &dyn Intersect, rays: &[Ray], wants: &[Vec<Hit>]) -> Option<String> {
    let n = rays.len();
    let accepts = |i: usize, _: &Ray, hit: &Hit| !((hit.primitive.0 + hit.instance.0) as usize + i).is_multiple_of(3);
    let filtered: Vec<Vec<Hit>> = wants
        .iter()
        .enumerate()
        .map(|(i, hits)| hits.iter().copied().filter(|hit| accepts(i, &rays[i], hit)).collect())
        .collect();
    for (wants, is_filtered, is_parallel) in
        [(wants, false, false), (wants, false, true), (&filtered, true, false), (&filtered, true, true)]
    {
        // Old answers must be overwritten.
        let stale = wants.iter().flatten().next().copied();
        let (mut closest, mut occluded) = (vec![stale; n], vec![true; n]);
        let mut all = vec![Vec::from_iter(stale); n];
        match (is_filtered, is_parallel) {
            (false, false) => {
                bvh.closest_hits(rays, &mut closest);
                bvh.occluded_many(rays, &mut occluded);
                bvh.all_hits_many(rays, &mut all);
            }
            (false, true) => {
                bvh.par_closest_hits(rays, &mut closest);
                bvh.par_occluded_many(rays, &mut occluded);
                bvh.par_all_hits_many(rays, &mut all);
            }
            (true, false) => {
                bvh.closest_hits_with(rays, &mut closest, &accepts);
                bvh.occluded_many_with(rays, &mut occluded, &accepts);
                bvh.all_hits_many_with(rays, &mut all, &accepts);
            }
            (true, true) => {
                bvh.par_closest_hits_with(rays, &mut closest, &accepts);
                bvh.par_occluded_many_with(rays, &mut occluded, &accepts);
                bvh.par_all_hits_many_with(rays, &mut all, &accepts);
            }
        }
        for (i, (ray, want)) in rays.iter().zip(wants).enumerate() {
            let mut hits = vec![];
            let alone = if is_filtered {
                let mut query = Accept(|hit: &Hit| accepts(i, ray, hit));
                bvh.all_hits_with(ray, &mut query, &mut hits);
                (bvh.closest_hit_with(ray, &mut query), bvh.occluded_with(ray, &mut query), hits)
            } else {
                bvh.all_hits(ray, &mut hits);
                (bvh.closest_hit(ray), bvh.occluded(ray), hits)
            };
            let of_slice = (closest[i], occluded[i], std::mem::take(&mut all[i]));
            let is_right = |(closest, occluded, hits): &(Option<Hit>, bool, Vec<Hit>)| {
                is_same(*closest, want.first().copied()) && *occluded != want.is_empty() && hits == want
            };
            if !is_right(&alone) || !is_right(&of_slice) {
                let how = format!("ray {i}, {ray:?}, filtered {is_filtered}, parallel {is_parallel}");
                return Some(format!("{how}: {alone:?}, in a slice {of_slice:?}, not {want:?}"));
            }
        }
    }
    None
}

/// Whether two answers have the same bits; `==` does not distinguish -0.0 from 0.0.
#[must_use]
pub fn is_same(a: Option<Hit>, b: Option<Hit>) -> bool {
    let bits = |hit: Hit| ([hit.t, hit.u, hit.v].map(f32::to_bits), hit.primitive, hit.instance, hit.side);
    a.map(bits) == b.map(bits)
}

/// Compares BVHs with these configurations, on every SIMD path, with the loop.
///
/// # Panics
/// Panics if one differs.
pub fn agrees(test: TriangleTest, name: &str, mesh: &Mesh, variants: &[Variant], rays: &[Ray]) {
    let wants = loop_over_all(mesh, test, rays);
    for (variant, config) in variants {
        let mut bvh = build(mesh, &Config { test, ..*config });
        for path in paths().0 {
            bvh = bvh.with_path(path);
            let difference = first_difference(&bvh, rays, &wants);
            assert_eq!(difference, None, "{name}, {test}, {variant}, {}", path.name());
        }
    }
}
