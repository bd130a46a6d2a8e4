//! Instances: their transforms at the limits; many instances with directions of any length, intervals of any size, mixed scales, and one
//! instance far away.

use canted_fixtures::{Mesh, Rotation, SplitMix64, soup};
use canted_gpu::{Choice, Gpu, Options, Source, TracedScene, block_on};
use canted_lbvh::VolumeConfig;
use canted_obb::Affine;
use canted_tlas::{Instance, MAX_CONDITION, Tlas, TopConfig};
use canted_trace::{Hit, Intersect, Ray, TriangleTest};
use canted_wide::{SimdPath, TriangleBvh};

use super::{Oracle, Promise, Row, hierarchy::SAME};
use crate::{
    brute::{self, distance},
    scenes::affine,
    tracers::{Guarantee, Method},
    variants::{binary_top, is_same},
};

#[path = "../../../crates/tlas/tests/rays/oracle.rs"]
#[expect(dead_code, reason = "shared with the tests of canted-tlas, which use more of it")]
mod exact;

/// Transforms by name.
fn placements() -> Vec<(&'static str, Affine)> {
    let turn = Rotation::off_axis();
    let mut sheared = affine(&turn, [1.0; 3], [0.3, 0.1, -2.0]);
    sheared.columns[1][0] += 0.9;
    vec![
        ("mirrored", affine(&turn, [-1.0, 1.0, 1.0], [0.0; 3])),
        ("sheared", sheared),
        ("scaled by 1e2, 1e-3 and 1", affine(&turn, [1e2, 1e-3, 1.0], [5.0, 5.0, 5.0])),
        ("scaled by 1e-6", affine(&turn, [1e-6; 3], [0.0; 3])),
        ("scaled by 1e6", affine(&turn, [1e6; 3], [0.0; 3])),
        ("size 1e-3 at 1e7", affine(&turn, [1e-3; 3], [1e7, -1e7, 1e7])),
        (
            "condition just below 2^10",
            affine(&Rotation::IDENTITY, [1.0, 1.0, 1.01 / canted_gpu::MAX_CONDITION], [0.5; 3]),
        ),
        ("condition just below 2^20", affine(&Rotation::IDENTITY, [1.0, 1.0, 1.01 / MAX_CONDITION], [0.5; 3])),
    ]
}

/// World-space rays at vertices, edges and triangles of the instanced mesh.
fn rays(mesh: &Mesh, world_from_object: &Affine, n: usize) -> Vec<Ray> {
    let mut rng = SplitMix64::new(110);
    let ray = |i: usize| {
        let [a, b, c] = mesh.corners(rng.below(mesh.triangles.len()));
        let [u, v] = [[0.0, 0.0], [rng.unit(), 0.0], [0.4 * rng.unit(), 0.4 * rng.unit()]][i % 3];
        let target = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
        let from = std::array::from_fn(|k| target[k] + 1.5 * rng.signed3()[k]);
        let [target, from] = [target, from].map(|p| world_from_object.point_f64(p));
        let origin = from.map(|x| x as f32);
        Ray::new(origin, std::array::from_fn(|k| (target[k] - f64::from(origin[k])) as f32))
    };
    (0..n).map(ray).filter(|ray| ray.direction.iter().any(|&d| d != 0.0)).collect()
}

/// A mesh with its transform.
struct Placement<'a> {
    mesh: &'a Mesh,
    world_from_object: Affine,
    /// Greatest coordinate of the mesh.
    reach: f32,
}

impl Placement<'_> {
    /// Distance of a hit from its exact position relative to the bound, in `f64`, whose rounding is a billionth of the bound.
    fn of_promised(&self, guarantee: Guarantee, ray: &Ray, hit: &Hit) -> f64 {
        let Self { mesh, world_from_object, reach } = self;
        if let Guarantee::Device(_) = guarantee {
            return self.off_device(ray, hit.t, hit);
        }
        // Distance between the point on the ray and the image of the barycentric point.
        let [a, b, c] = mesh.corners(hit.primitive.index());
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        let object: [f64; 3] = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
        let (image, on_ray) = (world_from_object.point_f64(object), ray.at(f64::from(hit.t)));
        // The barycentric weights are rounded too: one unit of two edges, which the bound on the point does not include.
        let weights = f64::from(f32::EPSILON) * norm(world_from_object) * f64::from(*reach);
        let distances = [0, 1, 2].map(|k| (image[k] - on_ray[k]).abs());
        let distance = distances.iter().fold(0.0, greater);
        distance / (brute::hit_error(world_from_object, *reach, ray) + weights)
    }

    /// Distance of a point on the ray from the hit triangle, relative to the device's bound.
    fn off_device(&self, ray: &Ray, t: f32, hit: &Hit) -> f64 {
        let Self { mesh, world_from_object, reach } = self;
        let corners = mesh.corners(hit.primitive.index()).map(|corner| world_from_object.point_f64(corner));
        let promised = brute::SQRT_3 * brute::device_hit_error(ray, world_from_object, f64::from(*reach));
        distance(ray.at(f64::from(t)), corners) / promised
    }

    /// Whether a ray starts so close to the triangle that a device may place the start on either side.
    fn begins_in(&self, ray: &Ray, hit: &Hit) -> bool {
        self.off_device(ray, ray.t_min, hit) <= 1.0
    }
}

/// The greater of two, or NaN if either is NaN, which `f64::max` would drop.
fn greater(all: f64, &x: &f64) -> f64 {
    if x > all || x.is_nan() { x } else { all }
}

/// Greatest row sum of the linear part.
fn norm(map: &Affine) -> f64 {
    (0..3).map(|k| map.columns[..3].iter().map(|column| f64::from(column[k].abs())).sum()).fold(0.0, f64::max)
}

/// The rows of these tracers: ours for every transform that they accept; for peers only whether anything is hit, because they may
/// round the ray or the vertices in undocumented steps.
#[must_use]
pub fn rows(effort: usize, methods: &[&Method]) -> Vec<Row> {
    let mut rows = vec![];
    let mesh = &soup(25, 80);
    let reach = mesh.positions.iter().flatten().fold(0.0f32, |all, x| all.max(x.abs()));
    let in_mesh = brute::of_mesh(mesh, TriangleTest::Watertight);
    for (name, world_from_object) in placements() {
        let same = Promise::none("instance", name, SAME, Oracle::Loop, "rays");
        let near = Promise { promise: NEAR, oracle: Oracle::Known, bound: 1.0, unit: "of the stated error", ..same };
        let placement = Placement { mesh, world_from_object, reach };
        let rays = rays(mesh, &world_from_object, 300 * effort);
        let trace = |_: usize, ray: &Ray| in_mesh(ray);
        let wants: Vec<_> =
            rays.iter().map(|ray| brute::closest_hit_of_instances(&[world_from_object], ray, trace)).collect();
        let mut by_promise: [Vec<Row>; 2] = Default::default();
        let is_ill = brute::condition(&world_from_object) > canted_gpu::MAX_CONDITION;
        for method in methods.iter().filter(|method| !(is_ill && matches!(method.guarantee, Guarantee::Device(_)))) {
            let tracer = (method.make)(mesh, &world_from_object);
            let ((hits, occluded), n_cut) = method.with_cuts(|| (tracer.closest(&rays), tracer.occluded(&rays)));
            let differs = |i: usize| match (method.guarantee, wants[i], hits[i]) {
                (Guarantee::Loop, want, hit) => !is_same(hit, want) || occluded[i] != want.is_some(),
                (Guarantee::Peer, want, hit) => hit.is_some() != want.is_some(),
                (Guarantee::Device(_), None, _) => false,
                (Guarantee::Device(_), Some(_), None) => true,
                // A farther hit must be within the error of the nearer one.
                (Guarantee::Device(_), Some(want), Some(hit)) => {
                    !occluded[i] || hit.t > want.t && placement.off_device(&rays[i], hit.t, &want) > 1.0
                }
            };
            // For a device only lost hits count.
            let counts = |&i: &usize| match method.guarantee {
                Guarantee::Device(_) => wants[i].is_some_and(|want| !placement.begins_in(&rays[i], &want)),
                Guarantee::Loop | Guarantee::Peer => true,
            };
            let counted: Vec<usize> = (0..rays.len()).filter(counts).collect();
            let n_other = counted.iter().filter(|&&i| differs(i)).count();
            let is_peer = method.guarantee == Guarantee::Peer;
            by_promise[0].push(Row { is_peer, n_cut, ..same.count_certain(&method.name, counted.len(), n_other) });
            if !is_peer {
                let share = |(ray, hit): (&Ray, &Option<Hit>)| {
                    Some(placement.of_promised(method.guarantee, ray, hit.as_ref()?))
                };
                let shares: Vec<f64> = rays.iter().zip(&hits).filter_map(share).collect();
                let worst = shares.iter().fold(0.0, greater);
                by_promise[1].push(Row { n_cut, ..near.row(&method.name, shares.len(), worst) });
            }
        }
        rows.extend(by_promise.concat());
    }
    rows.extend(refused(mesh));
    rows
}

/// The promise about the positions of hits.
pub const NEAR: &str = "hits lie on the image of their triangle";

/// Transforms that are too close to singular, on the CPU and on the best device if there is one.
fn refused(mesh: &Mesh) -> Vec<Row> {
    const REFUSED: Promise = Promise::none(
        "instance",
        "singular; condition above 2^20; NaN, infinity",
        "an error that names the instance",
        Oracle::Known,
        "transforms accepted",
    );
    const ON_DEVICE: Promise =
        Promise { case: "singular; condition above 2^10, on a device; NaN, infinity", ..REFUSED };
    let turn = Rotation::off_axis();
    let mut bad = vec![
        affine(&turn, [1.0, 1.0, 0.0], [0.0; 3]),
        affine(&turn, [1e-30, 1e-30, 0.0], [0.0; 3]),
        affine(&turn, [1.0, 1.0, 0.4 / MAX_CONDITION], [0.0; 3]),
        affine(&turn, [1e9, 1e-9, 1.0], [0.0; 3]),
    ];
    for x in [f32::NAN, f32::INFINITY] {
        let mut map = Affine::IDENTITY;
        map.columns[1][2] = x;
        bad.push(map);
    }
    let wide = || TriangleBvh::build(&mesh.positions, &mesh.triangles).expect("finite vertices");
    let row = |promise: Promise, routine: &str, bad: &[Affine], error: &dyn Fn(&[Instance]) -> Option<String>| {
        let instances = |map: &Affine| [Affine::IDENTITY, *map].map(|map| Instance::new(0, map));
        let is_taken = |map: &&Affine| error(&instances(map)).is_none_or(|error| !error.contains("instance 1"));
        promise.count(routine, bad.len(), bad.iter().filter(is_taken).count())
    };
    let on_cpu = |instances: &[Instance]| {
        Tlas::new(vec![wide()], instances, TopConfig::default()).err().map(|error| error.to_string())
    };
    let mut rows = vec![row(REFUSED, "Tlas::new", &bad, &on_cpu)];
    if let Ok(gpu) = block_on(Gpu::open(&Choice::Best)) {
        bad.push(affine(&Rotation::IDENTITY, [1.0, 1.0, 0.99 / canted_gpu::MAX_CONDITION], [0.5; 3]));
        let on_device = |instances: &[Instance]| {
            block_on(TracedScene::new(&gpu, Source::tlas([&wide()], instances), Options::default()))
                .err()
                .map(|error| error.to_string())
        };
        rows.push(row(ON_DEVICE, "TracedScene::new", &bad, &on_device));
    }
    rows
}

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
fn rays_of_case(case: &Case, meshes: &[Mesh], instances: &[Instance], n: usize, rng: &mut SplitMix64) -> Vec<Ray> {
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
pub(super) fn rows_of_many(effort: usize) -> Vec<Row> {
    let large = {
        let mut rng = SplitMix64::new(7);
        let positions = (0..36).map(|_| exact::affine([rng.signed3(); 4]).columns[0]).collect();
        Mesh { positions, triangles: (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect() }
    };
    let meshes = [large, soup(26, 12)];
    let bvh = |mesh: &Mesh| TriangleBvh::build(&mesh.positions, &mesh.triangles).expect("a mesh of finite vertices");
    let mut rows = vec![];
    for (seed, case) in (200..).zip(&CASES) {
        let mut rng = SplitMix64::new(seed);
        let promise = Promise::none("instance", case.name, CLOSEST, Oracle::Exact, "rays");
        let mut tops: Vec<(String, TopConfig, SimdPath)> =
            vec![("binary".to_owned(), binary_top(VolumeConfig::default()), SimdPath::Scalar)];
        for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
            tops.push((format!("wide {}", path.name()), TopConfig::default(), path));
        }
        let mut counts = vec![[0; 2]; tops.len()];
        for _ in 0..4 * effort {
            let instances = instances(case, &mut rng);
            let rays = rays_of_case(case, &meshes, &instances, 30, &mut rng);
            let wants: Vec<_> = rays
                .iter()
                .map(|ray| exact::all_hits(&meshes, &instances, ray, 0.0).first().map(|&(_, hit)| hit))
                .collect();
            for ((_, top, path), [n, n_failed]) in tops.iter().zip(&mut counts) {
                let blas = meshes.iter().map(|mesh| bvh(mesh).with_path(*path)).collect();
                let tlas =
                    Tlas::new(blas, &instances, top.clone()).expect("transforms far from singular").with_path(*path);
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
