//! Round segments: what the device calls certain is the CPU's answer, in every class of rays and segments, at every level.

use canted_fixtures::SplitMix64;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{DeviceCurve, DeviceHit, DeviceRay, Gpu, Limits, Options, Outcome, Source, TracedScene, block_on};
use canted_obb::Affine;
use canted_tests::closed::placements;
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Hit, Intersect, Ray, RoundSegment, ScaledRay};
use canted_wide::{Config, TriangleBvh, WideBvh};

use super::gpu;
use super::setup::build;

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(certain_hits_on_segments_are_the_cpus),
        needs_device(with_negative_bounds_certain_hits_on_segments_are_wrong),
        needs_device(instances_of_triangles_and_segments_answer_as_on_the_cpu),
        needs_device(hair_leaves_few_rays_to_the_cpu),
        needs_device(devices_with_eight_buffers_leave_moving_segments_to_the_cpu),
        needs_device(what_needs_triangles_is_refused),
    ]
}

pub(super) fn unit(rng: &mut SplitMix64) -> f32 {
    (rng.next_u64() >> 40) as f32 / (1 << 23) as f32 - 1.0
}

pub(super) fn vector(rng: &mut SplitMix64) -> [f32; 3] {
    [unit(rng), unit(rng), unit(rng)]
}

pub(super) fn plus(a: [f32; 3], s: f32, b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|k| a[k] + s * b[k])
}

/// Segments of every shape: usual and thin ones, balls, points, lines without a radius, cones in which one ball contains the other or nearly does, radii of 1e-6 of
/// the length, and radii that vary a thousandfold.
fn segments(rng: &mut SplitMix64, n: usize, scale: f32, offset: [f32; 3]) -> Vec<RoundSegment> {
    let one = |i: usize| {
        let a = vector(rng);
        let length = [0.3, 0.3, 1e-3, 0.0, 0.05][i % 5];
        let b = plus(a, length, vector(rng));
        let long: f32 = (0..3).map(|k| (b[k] - a[k]) * (b[k] - a[k])).sum::<f32>().sqrt();
        let radius = [0.05, 1e-2, 1e-3, 0.1][i / 5 % 4];
        let radii = match i / 20 % 8 {
            0 | 1 => [radius, radius],
            2 => [radius, 0.3 * radius],
            3 => [radius, 0.0],
            4 => [0.0, 0.0],
            5 => [1e-3 * radius, radius],
            // One ball is just in the other, or touches it from inside.
            6 => [radius + long * [1.0, 1.01, 0.99, 1.000_001][i / 160 % 4], radius],
            _ => [1e-6 * long, 1e-6 * long],
        };
        let place = |p: [f32; 3]| plus(offset, scale, p);
        RoundSegment { ends: [place(a), place(b)], radii: radii.map(|r| scale * r) }
    };
    (0..n).map(one).collect()
}

/// The unit vector across an axis and a ray, along which the silhouette is; zero where they are parallel.
pub(super) fn across(towards: [f32; 3], axis: [f32; 3]) -> [f32; 3] {
    let across = [
        towards[1] * axis[2] - towards[2] * axis[1],
        towards[2] * axis[0] - towards[0] * axis[2],
        towards[0] * axis[1] - towards[1] * axis[0],
    ];
    let length = across.iter().map(|x| x * x).sum::<f32>().sqrt();
    if length > 0.0 { across.map(|x| x / length) } else { across }
}

/// How far from the axis ray `i` is aimed: anywhere inside, at the silhouette, within roundings of it, around it, or not at all.
pub(super) fn aside(rng: &mut SplitMix64, i: usize, radius: f32, scale: f32) -> f32 {
    match i / 3 % 6 {
        0 => radius * unit(rng),
        1 => radius * (1.0 + 1e-3 * unit(rng)),
        2 => radius * (1.0 + 3e-6 * unit(rng)) + 1e-6 * scale * unit(rng),
        3 => 1.5 * radius * unit(rng),
        _ => 0.0,
    }
}

/// Rays at the silhouettes of segments, at random points in and near them, along them, from inside, and with ends at hits.
fn rays(rng: &mut SplitMix64, segments: &[RoundSegment], n: usize, scale: f32) -> Vec<Ray> {
    let one = |i: usize| {
        let segment = &segments[rng.below(segments.len())];
        let s = 0.5 * unit(rng) + 0.5;
        let [a, b] = segment.ends;
        let axis = [0, 1, 2].map(|k| b[k] - a[k]);
        let on_axis = plus(a, s, axis);
        let radius = segment.radii[0] + s * (segment.radii[1] - segment.radii[0]);
        let mut origin = plus(on_axis, scale * [0.5, 3.0, 100.0][i % 3], vector(rng));
        let towards = [0, 1, 2].map(|k| on_axis[k] - origin[k]);
        let (across, aside) = (across(towards, axis), aside(rng, i, radius, scale));
        let mut target = plus(on_axis, aside, across);
        match i / 18 % 6 {
            // Along the axis.
            0 => {
                origin = plus(plus(a, -3.0, axis), 0.9 * radius, vector(rng));
                target = plus(origin, 1.0, axis);
            }
            // From inside.
            1 => origin = plus(on_axis, 0.5 * radius, vector(rng)),
            _ => {}
        }
        let direction = [0, 1, 2].map(|k| (target[k] - origin[k]) * [1.0, 1.0, 1e-3, 1e4][i / 108 % 4]);
        let mut ray = Ray::new(origin, direction);
        if let (3, Some([entry, exit])) = (i / 7 % 5, ScaledRay::new(&ray).and_then(|ray| segment.span_scaled(&ray))) {
            // `t` of scaled rays is a power of two times that of the ray.
            let scaled = ScaledRay::new(&ray).map_or(1.0, |scaled| scaled.caller_t(1.0));
            let [entry, exit] = [entry.t, exit.t].map(|t| (t * scaled).max(0.0));
            (ray.t_min, ray.t_max) = match i % 4 {
                0 => (0.0, entry),
                1 => (entry, f32::INFINITY),
                2 => (0.5 * (entry + exit), f32::INFINITY),
                _ => (exit.next_up(), f32::INFINITY),
            };
        }
        ray
    };
    (0..n).map(one).collect()
}

#[derive(Debug, Default)]
pub(super) struct Tally {
    pub(super) n_rays: usize,
    pub(super) n_hits: usize,
    pub(super) n_misses: usize,
    pub(super) n_left: usize,
    pub(super) n_wrong: usize,
    /// Greatest difference of `t`, relative to coordinates, of hits that are not grazing.
    pub(super) off: f64,
}

impl Tally {
    fn take(&mut self, ray: &Ray, cpu: Option<Hit>, device: Option<DeviceHit>) {
        match device {
            None => self.n_misses += 1,
            Some(_) => self.n_hits += 1,
        }
        let of_cpu = cpu.map(|hit| (hit.instance.0, hit.primitive.0));
        if of_cpu != device.map(|hit| (hit.instance, hit.primitive)) {
            self.n_wrong += 1;
        } else if let (Some(cpu), Some(device)) = (cpu, device) {
            let reach = ray.origin.iter().map(|x| f64::from(x.abs())).fold(0.0, f64::max);
            let along = ray.direction.iter().map(|x| f64::from(x.abs())).fold(0.0, f64::max);
            let way = f64::from(cpu.t) * along;
            self.off = self.off.max((f64::from(device.t) - f64::from(cpu.t)).abs() * along / (reach + way));
            assert!((0.0..=1.0).contains(&device.u), "{device:?}");
        }
    }

    /// What the first pass decides.
    pub(super) fn certain(
        &mut self,
        gpu: &Gpu,
        scene: &TracedScene,
        cpu: &dyn Intersect,
        rays: &[Ray],
        bound_scale: f64,
    ) {
        let rays: Vec<_> = rays.iter().filter_map(|ray| Some((ray, ScaledRay::new(ray)?))).collect();
        let there: Vec<DeviceRay> = rays.iter().map(|(_, scaled)| DeviceRay::scaled(scaled)).collect();
        self.n_rays += rays.len();
        for ((ray, scaled), outcome) in rays.iter().zip(block_on(scene.certain_hits(gpu, &there, bound_scale)).unwrap())
        {
            match outcome {
                Outcome::Incomplete => self.n_left += 1,
                Outcome::Complete(hit) => {
                    let hit = DeviceHit { t: scaled.caller_t(hit.t), ..hit };
                    self.take(ray, cpu.closest_hit(ray), (hit.instance != DeviceHit::NONE).then_some(hit));
                }
            }
        }
    }

    /// The answers of both queries, of which those that are incomplete are the CPU's.
    pub(super) fn queries(&mut self, gpu: &Gpu, scene: &TracedScene, cpu: &dyn Intersect, rays: &[Ray]) {
        self.n_rays += rays.len();
        for (ray, outcome) in rays.iter().zip(block_on(scene.closest_hits(gpu, rays)).unwrap()) {
            match outcome {
                Outcome::Incomplete => self.n_left += 1,
                Outcome::Complete(hit) => self.take(ray, cpu.closest_hit(ray), hit),
            }
        }
        for (ray, outcome) in rays.iter().zip(block_on(scene.occluded(gpu, rays)).unwrap()) {
            if let Outcome::Complete(occluded) = outcome {
                assert_eq!(occluded, cpu.occluded(ray), "{ray:?}");
            }
        }
    }
}

/// Scales and offsets of clouds of segments.
const CLOUDS: [(f32, [f32; 3]); 6] = [
    (1.0, [0.0; 3]),
    (1e-6, [0.0; 3]),
    (1e6, [0.0; 3]),
    (1.0, [1e3, -7e3, 2e3]),
    (1e3, [1e7, 0.0, -1e7]),
    (1.0, [1e7, 0.0, -1e7]),
];

/// One kind of primitives through every cloud, in one level; `cloud` makes the shapes of a number, a scale and an offset, and rays through them.
pub(super) fn of_kind<S, P: DeviceCurve + Clone>(
    name: &str,
    cloud: impl Fn(u64, f32, [f32; 3]) -> (Vec<S>, Vec<Ray>),
    bound_scale: f64,
    make: fn(&S) -> P,
    each: &mut impl FnMut(&str, &Tally),
) {
    let gpu = gpu();
    for (number, (scale, offset)) in (0..).zip(CLOUDS) {
        let (shapes, rays) = cloud(number, scale, offset);
        let mut tally = Tally::default();
        for config in [Config::default(), Config::default().axis_aligned()] {
            let bvh = WideBvh::over_with(shapes.iter().map(make).collect(), config).unwrap();
            let scene = block_on(TracedScene::new(&gpu, Source::wide(&bvh), Options::default())).unwrap();
            tally.certain(&gpu, &scene, &bvh, &rays, bound_scale);
        }
        each(&format!("{name}, scale {scale:e}, offset {offset:?}"), &tally);
    }
}

/// All classes of rays through every cloud, in one level.
fn of_clouds(n_rays: usize, bound_scale: f64, mut each: impl FnMut(&str, &Tally)) {
    let gpu = gpu();
    for (number, (scale, offset)) in (0..).zip(CLOUDS) {
        let mut rng = SplitMix64::new(40 + number);
        let segments = segments(&mut rng, 960, scale, offset);
        let rays = rays(&mut rng, &segments, n_rays, scale);
        let mut tally = Tally::default();
        for config in [Config::default(), Config::default().axis_aligned()] {
            let bvh = WideBvh::over_with(segments.clone(), config).unwrap();
            let scene = block_on(TracedScene::new(&gpu, Source::wide(&bvh), Options::default())).unwrap();
            tally.certain(&gpu, &scene, &bvh, &rays, bound_scale);
        }
        each(&format!("scale {scale:e}, offset {offset:?}"), &tally);
    }
}

#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn certain_hits_on_segments_are_the_cpus() {
    of_clouds(20_000, 1.0, |name, tally| {
        eprintln!("{name}: {tally:?}");
        assert_eq!(tally.n_wrong, 0, "{name}: {tally:?}");
        // At 1e7 a rounding of a coordinate is as large as segments of size 1: all rays pass through several centers.
        let is_rounded = name.starts_with("scale 1e0, offset [10000000");
        assert!(is_rounded || tally.n_hits > 2000 && tally.n_misses > 100, "{name}: {tally:?}");
        assert!(tally.n_left > 100, "{name}: {tally:?}");
    });
}

/// The comparison must find hits and misses that are called certain without reason.
fn with_negative_bounds_certain_hits_on_segments_are_wrong() {
    let mut n_wrong = 0;
    of_clouds(4000, -1.0, |_, tally| n_wrong += tally.n_wrong);
    assert!(n_wrong > 20, "{n_wrong} wrong answers");
}

/// Segments and triangles in one scene, each placed many times: mirrored, sheared, tiny and far.
#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn instances_of_triangles_and_segments_answer_as_on_the_cpu() {
    let gpu = gpu();
    let mut rng = SplitMix64::new(50);
    let segments = segments(&mut rng, 480, 1.0, [0.0; 3]);
    let curves = WideBvh::over(segments.clone()).unwrap();
    let mesh = canted_fixtures::displaced_icosphere(3, 2);
    let triangles: TriangleBvh = build(&mesh, &Config::default());
    let mirror = Affine { columns: [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [2.0, 0.0, 0.0]] };
    let places = placements().into_iter().map(|place| place.world_from_object).chain([mirror, Affine::IDENTITY]);
    let instances: Vec<Instance> = places.flat_map(|at| [Instance::new(0, at), Instance::new(1, at)]).collect();
    let all: Vec<Ray> = instances
        .iter()
        .filter(|instance| instance.blas == 0)
        .flat_map(|instance| {
            let map = &instance.world_from_object;
            let placed = |ray: &Ray| {
                let end = map.point(plus(ray.origin, 1.0, ray.direction));
                let origin = map.point(ray.origin);
                Ray::new(origin, [0, 1, 2].map(|k| end[k] - origin[k]))
            };
            rays(&mut rng, &segments, 1500, 1.0).iter().map(placed).collect::<Vec<_>>()
        })
        .filter(|ray| ray.direction != [0.0; 3])
        .collect();
    let scene = block_on(TracedScene::new(
        &gpu,
        Source::tlas([canted_gpu::HostBvh::from(&curves), canted_gpu::HostBvh::from(&triangles)], &instances),
        Options::default(),
    ))
    .unwrap();
    let bottom: Vec<Box<dyn Intersect>> = vec![Box::new(curves), Box::new(triangles)];
    let tlas = Tlas::new(bottom, &instances, TopConfig::default()).unwrap();
    let mut tally = Tally::default();
    tally.certain(&gpu, &scene, &tlas, &all, 1.0);
    tally.queries(&gpu, &scene, &tlas, &all);
    eprintln!("{tally:?}");
    assert_eq!(tally.n_wrong, 0, "{tally:?}");
    assert!(tally.n_hits > 5000 && tally.n_misses > 20, "{tally:?}");
    let mut of_negative = Tally::default();
    of_negative.certain(&gpu, &scene, &tlas, &all, -1.0);
    assert!(of_negative.n_wrong > 0, "{of_negative:?}");
}

/// Hairs of a thousandth of the head, seen whole.
#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn hair_leaves_few_rays_to_the_cpu() {
    let gpu = gpu();
    let mut rng = SplitMix64::new(60);
    let mut hairs = vec![];
    for _ in 0..2000 {
        let mut at = vector(&mut rng);
        for _ in 0..10 {
            let next = plus(at, 0.05, vector(&mut rng));
            hairs.push(RoundSegment { ends: [at, next], radii: [2e-3, 2e-3] });
            at = next;
        }
    }
    let bvh = WideBvh::over(hairs).unwrap();
    let scene = block_on(TracedScene::new(&gpu, Source::wide(&bvh), Options::default())).unwrap();
    let rays: Vec<Ray> = (0..20_000)
        .map(|_| {
            let origin = [3.0, 0.2, 0.1];
            let target = vector(&mut rng);
            Ray::new(origin, [0, 1, 2].map(|k| target[k] - origin[k]))
        })
        .collect();
    let mut tally = Tally::default();
    tally.queries(&gpu, &scene, &bvh, &rays);
    eprintln!("{tally:?}");
    assert_eq!(tally.n_wrong, 0, "{tally:?}");
    assert!(tally.n_hits > 5000 && tally.n_left * 20 < tally.n_rays, "{tally:?}");
}

/// Where the list of undecided rays would be the ninth buffer, the CPU traces all rays.
fn devices_with_eight_buffers_leave_moving_segments_to_the_cpu() {
    let lower = |limits: Limits| Limits { max_storage_buffers_per_shader_stage: 8, ..limits };
    let narrow = block_on(Gpu::with_limits(&canted_gpu::Choice::Best, lower)).unwrap();
    let bvh = WideBvh::over(vec![RoundSegment { ends: [[0.0; 3], [1.0, 0.0, 0.0]], radii: [0.25, 0.5] }]).unwrap();
    let ray = Ray::new([0.5, 0.0, 5.0], [0.0, 0.0, -1.0]);
    let still = Instance::new(0, Affine::IDENTITY);
    let moving = Instance { world_from_object_close: Some(Affine::translation([0.1, 0.0, 0.0])), ..still };
    let answer = |instance: Instance| {
        let instances = [instance];
        let scene = block_on(TracedScene::new(&narrow, Source::tlas([&bvh], &instances), Options::default())).unwrap();
        let hits = block_on(scene.closest_hits(&narrow, &[ray])).unwrap();
        (hits[0], block_on(scene.occluded(&narrow, &[ray])).unwrap()[0])
    };
    let (hit, occluded) = answer(still);
    let expected = bvh.closest_hit(&ray).unwrap();
    let Outcome::Complete(Some(hit)) = hit else { panic!("{hit:?}") };
    assert!((hit.t - expected.t).abs() < 1e-5 && (hit.u - expected.u).abs() < 1e-5, "{hit:?} {expected:?}");
    assert_eq!(occluded, Outcome::Complete(true));
    assert_eq!(answer(moving), (Outcome::Incomplete, Outcome::Incomplete));
}

fn what_needs_triangles_is_refused() {
    let gpu = gpu();
    let bvh = WideBvh::over(vec![RoundSegment { ends: [[0.0; 3], [1.0, 0.0, 0.0]], radii: [0.25, 0.5] }]).unwrap();
    let scene = block_on(TracedScene::new(&gpu, Source::wide(&bvh), Options::default())).unwrap();
    let refused = |error: canted_gpu::GpuError| error.to_string().contains("curves");
    assert!(refused(scene.module(1).unwrap_err()));
    assert!(refused(block_on(scene.download(&gpu)).unwrap_err()));
}
