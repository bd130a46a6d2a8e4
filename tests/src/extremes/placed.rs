//! Many instances: directions of any length, intervals of any size, mixed scales, one instance far away.
//!
//! The reference tests every triangle of every instance and compares `t` without rounding. Not covered: devices, which accept a
//! smaller range of transforms and directions (`instance.rs`).

#[path = "../../../crates/tlas/tests/rays/oracle.rs"]
mod exact;

use canted_fixtures::{Mesh, SplitMix64, soup};
use canted_lbvh::VolumeConfig;
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Ray, Watertight};
use canted_wide::{Config, SimdPath, TriangleBvh};

use super::{Oracle, Promise, Row, hierarchy::is_same};

/// What the rows promise.
const CLOSEST: &str = "the least exact t of all triangles, ties to the lowest instance and primitive; occlusion agrees";

/// A kind of scene.
#[derive(Clone, Copy)]
struct Case {
    name: &'static str,
    /// Powers of ten of the instances' scales.
    scales: [f64; 2],
    /// Powers of ten of the lengths of directions.
    lengths: [f64; 2],
    /// Distance of the last instance from the others, where it is far away.
    far: Option<f64>,
    /// Distance of all instances from the origin of the world.
    away: f64,
    /// Whether instances repeat each other's transform, and rays have short and odd intervals.
    overlaps: bool,
    odd_intervals: bool,
}

const ORDINARY: Case =
    Case { name: "", scales: [0.0; 2], lengths: [0.0; 2], far: None, away: 0.0, overlaps: false, odd_intervals: false };

const CASES: [Case; 9] = [
    Case { name: "scaled by 1e-6, directions of 1e-40 to 1e38", scales: [-6.0; 2], lengths: [-40.0, 38.0], ..ORDINARY },
    Case { name: "scaled by 1e6, directions of 1e-40 to 1e38", scales: [6.0; 2], lengths: [-40.0, 38.0], ..ORDINARY },
    Case { name: "scales of 1e-6 to 1e6 in one scene", scales: [-6.0, 6.0], lengths: [-3.0, 3.0], ..ORDINARY },
    Case {
        name: "overlapping instances, directions of 1e30 to 1e38",
        lengths: [30.0, 38.0],
        overlaps: true,
        ..ORDINARY
    },
    Case {
        name: "intervals that are subnormal, empty or infinite",
        lengths: [36.0, 38.0],
        odd_intervals: true,
        ..ORDINARY
    },
    Case { name: "one instance at 1e8", far: Some(1e8), ..ORDINARY },
    Case {
        name: "one instance at 1e8, directions of 1e-40 to 1e38",
        far: Some(1e8),
        lengths: [-40.0, 38.0],
        ..ORDINARY
    },
    Case { name: "all instances at 1e6", away: 1e6, scales: [1.0, 3.0], ..ORDINARY },
    Case {
        name: "all instances at 1e6, overlapping, one at 1e8",
        away: 1e6,
        far: Some(1e8),
        scales: [1.0, 3.0],
        overlaps: true,
        ..ORDINARY
    },
];

/// Instances of two meshes around the origin.
fn instances(case: &Case, rng: &mut SplitMix64) -> Vec<Instance> {
    let mut all: Vec<Instance> = vec![];
    for blas in [0, 1, 0, 1, 0, 1, 0, 1] {
        let scale = between(rng, case.scales);
        let map = loop {
            let columns = [rng.signed3(), rng.signed3(), rng.signed3()];
            let [a, b, c] = columns;
            let volume = a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0]);
            if volume.abs() > 0.1 {
                let [x, y, z] = rng.signed3().map(|x| 0.3 * scale * x);
                let shift = [x + case.away, y - case.away, z];
                let [x, y, z] = columns.map(|column| column.map(|x| x * scale));
                break exact::affine([x, y, z, shift]);
            }
        };
        let map = match all.last() {
            Some(last) if case.overlaps && blas == 1 => last.world_from_object,
            _ => map,
        };
        all.push(Instance::new(blas, map));
    }
    if let Some(far) = case.far {
        let mut map = all[0].world_from_object;
        map.columns[3] = exact::affine([[far, -far, far]; 4]).columns[3];
        all.push(Instance::new(0, map));
    }
    all
}

/// A power of ten between two.
fn between(rng: &mut SplitMix64, [low, high]: [f64; 2]) -> f64 {
    10f64.powf(low + (high - low) * rng.unit())
}

/// Rays at triangles of random instances.
#[expect(clippy::cast_possible_truncation, reason = "rays are rounded like everything")]
fn rays(case: &Case, meshes: &[Mesh], instances: &[Instance], n: usize, rng: &mut SplitMix64) -> Vec<Ray> {
    let ray = |_| {
        let Instance { blas, world_from_object, .. } = &instances[rng.below(instances.len())];
        let mesh = &meshes[*blas as usize];
        let [a, b, c] = mesh.corners(rng.below(mesh.triangles.len()));
        let (u, v) = (0.5 * rng.unit(), 0.5 * rng.unit());
        let target = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
        let offset = rng.signed3();
        let from = std::array::from_fn(|k| target[k] + 1.5 * offset[k]);
        let [target, from] = [target, from].map(|p| world_from_object.point_f64(p));
        let d: [f64; 3] = std::array::from_fn(|k| target[k] - f64::from(from[k] as f32));
        let length = between(rng, case.lengths) / d.iter().fold(f64::MIN_POSITIVE, |most: f64, x| most.max(x.abs()));
        let mut ray = Ray::new(from.map(|x| x as f32), d.map(|x| (x * length) as f32));
        if case.odd_intervals {
            let ends = [0.0, f32::from_bits(1), 1e-42, 1e-38, 1e-37, 1e-36, f32::MAX, f32::INFINITY];
            (ray.t_min, ray.t_max) = (ends[rng.below(4)], ends[rng.below(ends.len())]);
        }
        ray
    };
    (0..n).map(ray).filter(|ray| ray.direction.iter().any(|&d| d != 0.0)).collect()
}

/// Both kinds of top level, the wide one on every available SIMD path.
#[must_use]
pub(super) fn rows(effort: usize) -> Vec<Row> {
    let large = {
        let mut rng = SplitMix64::new(7);
        let positions = (0..36).map(|_| exact::affine([rng.signed3(); 4]).columns[0]).collect();
        Mesh { positions, triangles: (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect() }
    };
    let meshes = [large, soup(26, 12)];
    let bvh = |mesh: &Mesh| {
        TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &Config::default())
            .expect("a mesh of finite vertices")
    };
    let mut rows = vec![];
    for (seed, case) in (200..).zip(&CASES) {
        let mut rng = SplitMix64::new(seed);
        let promise = Promise::none("instance", case.name, CLOSEST, Oracle::Exact, "rays");
        let mut tops: Vec<(String, TopConfig, SimdPath)> =
            vec![("binary".to_owned(), TopConfig::Binary(VolumeConfig::default()), SimdPath::Scalar)];
        for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
            tops.push((format!("wide {}", path.name()), TopConfig::default(), path));
        }
        let mut counts = vec![[0; 2]; tops.len()];
        for _ in 0..4 * effort {
            let instances = instances(case, &mut rng);
            let rays = rays(case, &meshes, &instances, 30, &mut rng);
            let wants: Vec<_> = rays
                .iter()
                .map(|ray| exact::all_hits(&meshes, &instances, ray, 0.0).first().map(|&(_, hit)| hit))
                .collect();
            for ((_, top, path), [n, n_failed]) in tops.iter().zip(&mut counts) {
                let blas = meshes.iter().map(|mesh| bvh(mesh).with_path(*path)).collect();
                let tlas = Tlas::new(blas, &instances, *top).expect("transforms far from singular").with_path(*path);
                for (ray, want) in rays.iter().zip(&wants) {
                    let hit = tlas.closest_hit(ray);
                    *n += usize::from(want.is_some() || hit.is_some());
                    *n_failed += usize::from(!is_same(hit, *want) || tlas.occluded(ray) != want.is_some());
                }
            }
        }
        rows.extend(
            tops.iter().zip(counts).map(|((name, ..), [n, n_failed])| promise.count_certain(name, n, n_failed)),
        );
    }
    rows
}
