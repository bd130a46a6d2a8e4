//! Scenes, rays, and the oracle: every triangle tested.

use canted_fixtures as fixtures;
use canted_fixtures::{Grazing, Hair, Mesh, SplitMix64, Strand};
use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Kernel, Ray, ScaledRay, TriangleTest};
use canted_wide::{Config, Preset, SimdPath, TriangleBvh};

/// Scenes on which BVHs and triangle tests fail first.
pub(crate) fn scenes() -> Vec<(&'static str, Mesh)> {
    let hair = Hair { n_strands: 40, n_segments: 5, width: 0.004, strand: Strand::Tube };
    vec![
        ("scaffold", fixtures::scaffold_of(1, true, 3)),
        ("hair", fixtures::hair(3, &hair)),
        ("soup", fixtures::soup(1, 700)),
        ("slivers", fixtures::slivers(2, 400)),
        ("identical", fixtures::identical(300)),
        ("coplanar_quads", fixtures::coplanar_quads(12)),
        ("fan", fixtures::fan(100)),
        ("outlier", fixtures::outlier(100)),
        ("icosphere", fixtures::icosphere(2)),
        ("flat box", fixtures::thin_box(0.0)),
    ]
}

/// Rays of every grazing class; one for an empty mesh.
pub(crate) fn grazing_rays(mesh: &Mesh, n: usize, seed: u64) -> Vec<Ray> {
    if mesh.triangles.is_empty() {
        return vec![Ray::new([0.0; 3], [1.0, 0.0, 0.0])];
    }
    let rays = Grazing::ALL.into_iter().flat_map(|class| fixtures::grazing(mesh, class, n, seed));
    rays.map(|ray| Ray { t_max: ray.t_max, ..Ray::new(ray.origin, ray.direction) }).collect()
}

/// Rays of every grazing class, some of them bounded, and some from anywhere to anywhere.
pub(crate) fn rays(mesh: &Mesh, n: usize, seed: u64) -> Vec<Ray> {
    let mut rng = SplitMix64::new(seed);
    let mut rays = grazing_rays(mesh, n, seed);
    for ray in rays.iter_mut().step_by(5) {
        ray.t_min = rng.unit() as f32;
        ray.t_max = ray.t_min + rng.unit() as f32;
    }
    let [min, max] = mesh.bounds();
    let mut point = || std::array::from_fn(|k| min[k] + (rng.unit() as f32 * 1.4 - 0.2) * (max[k] - min[k]));
    for _ in 0..n {
        let (from, to): ([f32; 3], [f32; 3]) = (point(), point());
        rays.push(Ray::new(from, std::array::from_fn(|k| to[k] - from[k])));
    }
    rays
}

/// Every hit of the kernel, in the order of `closest_hit`.
pub(crate) fn brute<K: Kernel<Record = [[f32; 3]; 3]>>(mesh: &Mesh, ray: &Ray) -> Vec<Hit> {
    let Some(scaled) = ScaledRay::new(ray) else { return vec![] };
    let prepared = K::prepare(&scaled);
    let mut hits: Vec<Hit> = (0u32..)
        .zip(&mesh.triangles)
        .filter_map(|(i, triangle)| {
            let record = K::record(triangle.map(|v| mesh.positions[v as usize]));
            let hit = K::intersect(&prepared, &scaled, &record, scaled.t_max)?;
            let (primitive, instance) = (PrimId(i), InstanceId(0));
            Some(Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance, side: hit.side })
        })
        .collect();
    hits.sort_by(|a, b| (a.t, a.primitive).partial_cmp(&(b.t, b.primitive)).unwrap());
    for hit in &mut hits {
        hit.t = scaled.caller_t(hit.t);
    }
    hits
}

/// A BVH over the mesh.
pub(crate) fn build(mesh: &Mesh, preset: Preset) -> TriangleBvh {
    build_for(TriangleTest::Watertight, mesh, preset)
}

/// A BVH over the mesh with another triangle test.
pub(crate) fn build_for(test: TriangleTest, mesh: &Mesh, preset: Preset) -> TriangleBvh {
    let config = Config { test, ..Config::preset(preset) };
    TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).expect("fixtures are valid")
}

/// Paths of this machine; prints those that are missing.
pub(crate) fn paths() -> Vec<SimdPath> {
    let (there, missing): (Vec<_>, Vec<_>) = SimdPath::ALL.into_iter().partition(|path| path.is_available());
    if !missing.is_empty() {
        let names: Vec<_> = missing.iter().map(|path| path.name()).collect();
        #[expect(clippy::print_stderr, reason = "paths that are not tested are reported")]
        {
            eprintln!("not tested, this machine has no {}", names.join(", "));
        }
    }
    there
}
