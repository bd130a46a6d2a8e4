//! Small things far from each other: hits are the CPU's, however small a triangle is relative to its distance from the ray's origin.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_fixtures::{Mesh, SplitMix64, icosphere};
use canted_gpu::build::BuildConfig;
use canted_gpu::{DeviceHit, Gpu, Options, Outcome, Source, TracedScene, block_on};
use canted_lbvh::{Bits, Corners, Strategy};
use canted_obb::Affine;
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Hit, Intersect, Ray};
use canted_wide::{Config, TriangleBvh};

use super::gpu;
use super::setup::build;

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(small_spheres_in_one_level_are_hit_as_on_the_cpu),
        needs_device(small_spheres_in_two_levels_are_hit_as_on_the_cpu),
        needs_device(steps_below_the_precision_of_the_origin_are_hit_as_on_the_cpu),
        needs_device(directions_of_any_length_hit_at_a_finite_t),
        needs_device(other_spheres_are_detected),
    ]
}

const N_SPHERES: usize = 400;

/// Answers that differ, of so many hits on the CPU.
#[derive(Debug, Default)]
struct Differences {
    n_hits: usize,
    n_lost: usize,
    n_invented: usize,
    n_others: usize,
    /// `t` off by more than a fiftieth of the radius.
    n_off: usize,
}

impl Differences {
    fn count(&mut self, ray: &Ray, radius: f64, cpu: Option<Hit>, device: Outcome<Option<DeviceHit>>) {
        let Outcome::Complete(device) = device else { panic!("{ray:?} has no answer") };
        self.n_hits += usize::from(cpu.is_some());
        match (cpu, device) {
            (Some(cpu), Some(device)) => {
                self.n_others += usize::from((cpu.instance.0, cpu.primitive.0) != (device.instance, device.primitive));
                let off = (f64::from(cpu.t) - f64::from(device.t)).abs();
                self.n_off += usize::from(off > 0.02 * radius);
            }
            (Some(_), None) => self.n_lost += 1,
            (None, Some(_)) => self.n_invented += 1,
            (None, None) => {}
        }
    }
}

/// Centers of spheres in a cube of this size, and rays of unit length from one place in it toward points near them.
fn spheres_and_rays(extent: f64, radius: f64, n_rays: usize) -> (Vec<[f32; 3]>, Vec<Ray>) {
    let mut rng = SplitMix64::new(17);
    let mut in_cube = || [0; 3].map(|_| ((rng.unit() - 0.5) * extent) as f32);
    let centers: Vec<[f32; 3]> = (0..N_SPHERES).map(|_| in_cube()).collect();
    let origin = [0.5, 0.4, 0.45].map(|x| (x * extent) as f32);
    let mut rng = SplitMix64::new(18);
    let rays = (0..n_rays).map(|i| {
        let center = centers[i % N_SPHERES];
        let toward = rng.on_sphere();
        // Up to the silhouette and a little beyond it.
        let reach = 1.1 * radius * rng.unit().sqrt();
        let to: [f64; 3] = std::array::from_fn(|k| f64::from(center[k]) + reach * toward[k] - f64::from(origin[k]));
        let length = to.iter().map(|x| x * x).sum::<f64>().sqrt();
        Ray::new(origin, to.map(|x| (x / length) as f32))
    });
    let rays = rays.collect();
    (centers, rays)
}

/// All spheres in one mesh.
fn merged(centers: &[[f32; 3]], radius: f64) -> Mesh {
    let sphere = icosphere(2);
    let mut mesh = Mesh { positions: vec![], triangles: vec![] };
    centers.iter().for_each(|&center| place(&sphere, center, radius, &mut mesh));
    mesh
}

fn place(sphere: &Mesh, center: [f32; 3], radius: f64, all: &mut Mesh) {
    let first = all.positions.len() as u32;
    all.positions.extend(sphere.positions.iter().map(|p| {
        let at: [f32; 3] = std::array::from_fn(|k| (radius * f64::from(p[k]) + f64::from(center[k])) as f32);
        at
    }));
    all.triangles.extend(sphere.triangles.iter().map(|triangle| triangle.map(|i| i + first)));
}

fn answers(
    gpu: &Gpu,
    scene: &TracedScene,
    rays: &[Ray],
    radius: f64,
    on_cpu: impl Fn(&Ray) -> Option<Hit>,
) -> Differences {
    let mut differences = Differences::default();
    for (ray, hit) in rays.iter().zip(block_on(scene.closest_hits(gpu, rays)).unwrap()) {
        differences.count(ray, radius, on_cpu(ray), hit);
    }
    differences
}

#[track_caller]
#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn check(name: &str, differences: &Differences) {
    eprintln!("{name}: {differences:?}");
    let n = differences.n_hits;
    assert!(n > 1000, "{name}: {differences:?}");
    // The decision is the CPU's; only the choice between triangles that share an edge is that of a rounded `t`.
    assert_eq!((differences.n_lost, differences.n_invented), (0, 0), "{name}: {differences:?}");
    assert!(differences.n_others * 20 <= n && differences.n_off * 100 <= n, "{name}: {differences:?}");
}

/// Extents and radii: the distances are 5,000 and 10,000 times the radius.
const SCENES: [(f64, f64); 3] = [(50.0, 0.01), (1e4, 1.0), (1.0, 1e-4)];

fn small_spheres_in_one_level_are_hit_as_on_the_cpu() {
    let gpu = gpu();
    for (extent, radius) in SCENES {
        let (centers, rays) = spheres_and_rays(extent, radius, 8000);
        let mesh = merged(&centers, radius);
        let bvh: TriangleBvh = build(&mesh, &Config::default());
        let name = |kind: &str| format!("{kind}, radius {radius} in {extent}");
        let wide = block_on(TracedScene::new(&gpu, Source::wide(&bvh), Options::default())).unwrap();
        check(&name("wide"), &answers(&gpu, &wide, &rays, radius, |ray| bvh.closest_hit(ray)));
        let corners: Vec<Corners> =
            mesh.triangles.iter().map(|triangle| triangle.map(|i| mesh.positions[i as usize])).collect();
        let config = BuildConfig { bits: Bits::B63, strategy: Strategy::Aabb };
        let binary = block_on(TracedScene::new(&gpu, Source::build([&corners], config), Options::default())).unwrap();
        check(&name("built on the device"), &answers(&gpu, &binary, &rays, radius, |ray| bvh.closest_hit(ray)));
    }
}

fn small_spheres_in_two_levels_are_hit_as_on_the_cpu() {
    let gpu = gpu();
    for (extent, radius) in SCENES {
        let (centers, rays) = spheres_and_rays(extent, radius, 8000);
        let mut rng = SplitMix64::new(19);
        let instances: Vec<Instance> = centers
            .iter()
            .map(|&center| {
                // Turned, stretched and mirrored in turn, so that no entry of the inverse is simple.
                let mut columns = [[0.0f32; 3]; 4];
                for (k, column) in columns.iter_mut().take(3).enumerate() {
                    let tilt = rng.on_sphere();
                    *column =
                        std::array::from_fn(|j| (radius * (0.1 * tilt[j] + if j == k { 1.0 } else { 0.0 })) as f32);
                }
                columns[3] = center;
                Instance::new(0, Affine { columns })
            })
            .collect();
        let bvh: TriangleBvh = build(&icosphere(2), &Config::default());
        let scene = block_on(TracedScene::new(&gpu, Source::tlas([&bvh], &instances), Options::default())).unwrap();
        let tlas = Tlas::new(vec![bvh], &instances, TopConfig::default()).unwrap();
        let differences = answers(&gpu, &scene, &rays, radius, |ray| tlas.closest_hit(ray));
        check(&format!("two levels, radius {radius} in {extent}"), &differences);
    }
}

/// Vertices that are equal relative to the device's origin of a ray may differ relative to the CPU's.
fn steps_below_the_precision_of_the_origin_are_hit_as_on_the_cpu() {
    let gpu = gpu();
    let mut mesh = Mesh { positions: vec![], triangles: vec![] };
    for i in 0..8 * 8_u32 {
        let [x, y] = [i % 8, i / 8].map(|k| k as f32 * 0.5);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([[x, y, 0.0], [x + 0.5, y, 0.0], [x + 0.5, y + 0.5, 0.5], [x, y + 0.5, 0.5]]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    let (s, c) = (0.6_f32, 0.8_f32);
    let map = Affine { columns: [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0], [0.3, -0.7, 0.1]] };
    let instances = [Instance::new(0, map)];
    let corners = |mesh: &Mesh| -> Vec<Corners> {
        mesh.triangles.iter().map(|triangle| triangle.map(|i| mesh.positions[i as usize])).collect()
    };
    let bvh: TriangleBvh = build(&mesh, &Config::default());
    let two = [
        block_on(TracedScene::new(&gpu, Source::tlas([&bvh], &instances), Options::default())).unwrap(),
        block_on(TracedScene::new(
            &gpu,
            Source::build(&[&corners(&mesh)], BuildConfig::default()).with_instances(&instances),
            Options::default(),
        ))
        .unwrap(),
    ];
    let tlas = Tlas::new(vec![bvh], &instances, TopConfig::default()).unwrap();
    let mut there = mesh;
    there.positions.iter_mut().for_each(|p| *p = map.point(*p));
    let bvh: TriangleBvh = build(&there, &Config::default());
    let one = [
        block_on(TracedScene::new(&gpu, Source::wide(&bvh), Options::default())).unwrap(),
        block_on(TracedScene::new(&gpu, Source::build([&corners(&there)], BuildConfig::default()), Options::default()))
            .unwrap(),
    ];
    let mut rng = SplitMix64::new(23);
    let rays: Vec<Ray> = (0..20_000)
        .map(|_| {
            let direction = rng.on_sphere();
            let far = 1.5e7 * (0.5 + rng.unit());
            let to = map.point([4.0 * rng.unit() as f32, 4.0 * rng.unit() as f32, 0.25]);
            let origin = std::array::from_fn(|k| (f64::from(to[k]) - far * direction[k]) as f32);
            Ray::new(origin, direction.map(|x| x as f32))
        })
        .collect();
    let compare = |name: &str, scene: &TracedScene, on_cpu: &dyn Fn(&Ray) -> Option<Hit>| {
        let (mut n_hits, mut n_other) = (0, 0);
        for (ray, found) in rays.iter().zip(block_on(scene.closest_hits(&gpu, &rays)).unwrap()) {
            let Outcome::Complete(found) = found else { panic!("{ray:?} has no answer") };
            let on_cpu = on_cpu(ray);
            n_hits += usize::from(on_cpu.is_some());
            n_other += usize::from(on_cpu.is_some() != found.is_some());
        }
        assert!(n_hits > 5000, "{name}: {n_hits} hits");
        assert_eq!(n_other, 0, "{name}: of {n_hits}");
    };
    two.iter().for_each(|scene| compare("two levels", scene, &|ray| tlas.closest_hit(ray)));
    one.iter().for_each(|scene| compare("one level", scene, &|ray| bvh.closest_hit(ray)));
}

/// What a short direction reaches only beyond the greatest number is not hit, on either device, at one level and at two.
fn directions_of_any_length_hit_at_a_finite_t() {
    let gpu = gpu();
    let bvh: TriangleBvh = build(&icosphere(1), &Config::default());
    let instance = Instance::new(0, Affine::scale([0.5, 1.0, 2.0]));
    let one = block_on(TracedScene::new(&gpu, Source::wide(&bvh), Options::default())).unwrap();
    let two = block_on(TracedScene::new(&gpu, Source::tlas([&bvh], &[instance]), Options::default())).unwrap();
    let tlas = Tlas::new(vec![bvh.clone()], &[instance], TopConfig::default()).unwrap();
    let mut rng = SplitMix64::new(29);
    let mut rays = vec![];
    // The surface is at a distance of 4 to 8: `t` is far from the greatest number, but for what it is beyond.
    for length in [1e30, 1.0, 1e-20, 1e-36, 1e-37, 5e-39, 1e-40, 1e-45] {
        for _ in 0..40 {
            let [away, aside] = [rng.on_sphere(), rng.signed3()];
            let origin: [f32; 3] = std::array::from_fn(|k| (7.0 * away[k] + 0.3 * aside[k]) as f32);
            rays.push(Ray::new(origin, away.map(|x| (-length * x) as f32)));
        }
    }
    for (name, scene, on_cpu) in
        [("one level", &one, &bvh as &dyn Intersect), ("two levels", &two, &tlas as &dyn Intersect)]
    {
        let mut counts = [0; 2];
        for (ray, hit) in rays.iter().zip(block_on(scene.closest_hits(&gpu, &rays)).unwrap()) {
            let Outcome::Complete(hit) = hit else { panic!("{name}: {ray:?} is incomplete") };
            assert_eq!(hit.is_some(), on_cpu.closest_hit(ray).is_some(), "{name}: {ray:?} {hit:?}");
            assert!(hit.is_none_or(|hit| hit.t.is_finite()), "{name}: {ray:?} {hit:?}");
            counts[usize::from(hit.is_some())] += 1;
        }
        assert!(counts.iter().all(|&n| n >= 100), "{name}: {counts:?}");
    }
}

/// A two-hundredth more of the radius is seen.
fn other_spheres_are_detected() {
    let gpu = gpu();
    let (extent, radius) = SCENES[0];
    let (centers, rays) = spheres_and_rays(extent, radius, 8000);
    let on_cpu: TriangleBvh = build(&merged(&centers, radius), &Config::default());
    let there: TriangleBvh = build(&merged(&centers, 1.005 * radius), &Config::default());
    let scene = block_on(TracedScene::new(&gpu, Source::wide(&there), Options::default())).unwrap();
    let differences = answers(&gpu, &scene, &rays, radius, |ray| on_cpu.closest_hit(ray));
    assert!(differences.n_invented > 20, "{differences:?}");
}
