//! What the first pass on the device calls certain is the CPU's answer, bit for bit in triangle and miss; and it leaves few rays to exact
//! arithmetic.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_fixtures::{Hair, Mesh, displaced_icosphere, grid, hair, object_views, scaffold, soup, truss};
use canted_gpu::{Choice, DeviceHit, DeviceRay, Gpu, Limits, Options, Outcome, Source, TracedScene, block_on};
use canted_tests::closed::placements;
use canted_tests::rays;
use canted_tests::scenes::{baked, transforms};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Intersect, Ray, ScaledRay};
use canted_wide::{Config, NodeKind, TriangleBvh};

use super::gpu;
use super::setup::{build, of_one_kind};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(certain_hits_are_the_cpus),
        needs_device(with_negative_bounds_certain_hits_are_wrong),
        needs_device(certain_hits_of_instances_are_the_cpus),
        needs_device(instances_leave_few_rays_undecided),
        needs_device(kernels_without_checks_answer_as_those_with_them),
        needs_device(devices_with_eight_buffers_answer_alike),
        needs_device(few_rays_are_undecided),
    ]
}

/// Answers of the first pass.
#[derive(Debug, Default)]
struct Tally {
    n_rays: usize,
    n_certain_hits: usize,
    n_undecided: usize,
    /// Certain answers that are not the CPU's.
    n_wrong: usize,
}

impl Tally {
    fn add(&mut self, gpu: &Gpu, bvh: &TriangleBvh, rays: &[Ray], bound_scale: f64) {
        let scene = block_on(TracedScene::new(gpu, Source::wide(bvh), Options::default())).unwrap();
        self.compare(gpu, &scene, bvh, rays, bound_scale);
    }

    fn compare(&mut self, gpu: &Gpu, scene: &TracedScene, cpu: &dyn Intersect, rays: &[Ray], bound_scale: f64) {
        let rays: Vec<_> = rays.iter().filter_map(|ray| Some((ray, ScaledRay::new(ray)?))).collect();
        let there: Vec<DeviceRay> = rays.iter().map(|(_, scaled)| DeviceRay::scaled(scaled)).collect();
        self.n_rays += rays.len();
        for ((ray, _), outcome) in rays.iter().zip(block_on(scene.certain_hits(gpu, &there, bound_scale)).unwrap()) {
            let Outcome::Complete(hit) = outcome else {
                self.n_undecided += 1;
                continue;
            };
            let device = (hit.instance != DeviceHit::NONE).then_some((hit.instance, hit.primitive));
            self.n_certain_hits += usize::from(device.is_some());
            self.n_wrong += usize::from(cpu.closest_hit(ray).map(|hit| (hit.instance.0, hit.primitive.0)) != device);
        }
    }
}

fn meshes() -> Vec<(&'static str, Mesh)> {
    vec![
        ("soup", soup(7, 500)),
        ("displaced icosphere", displaced_icosphere(3, 3)),
        ("scaffold", scaffold(1, true)),
        ("scaffold, far away", scaffold(2, false).placed(|p| [p[0] + 3e3, p[1] - 7e3, p[2] + 1e3])),
        ("truss", truss(4)),
    ]
}

/// All grazing rays, and rays from afar, through BVHs of each kind of nodes.
fn of_grazing_rays(bound_scale: f64, mut each: impl FnMut(&str, &Tally)) {
    let gpu = gpu();
    for (name, mesh) in meshes() {
        let mut all = rays::of_all_classes(&mesh, 150, 11);
        all.extend(rays::from_afar(&mesh, 100.0, 300, 12));
        all.extend(rays::from_inside(&mesh, 300, 13));
        let mut tally = Tally::default();
        for config in [Config::default(), of_one_kind(NodeKind::Aligned), of_one_kind(NodeKind::Oriented)] {
            tally.add(&gpu, &build(&mesh, &config), &all, bound_scale);
        }
        each(name, &tally);
    }
}

#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn certain_hits_are_the_cpus() {
    of_grazing_rays(1.0, |name, tally| {
        eprintln!("{name}: {tally:?}");
        assert_eq!(tally.n_wrong, 0, "{name}: {tally:?}");
        assert!(tally.n_certain_hits > 100 && tally.n_undecided > 100, "{name}: {tally:?}");
    });
}

/// The comparison must find hits that are called certain without reason. Bounds of zero would not do: where a device rounds as the CPU does, the
/// order of two rounded products is that of the exact ones.
fn with_negative_bounds_certain_hits_are_wrong() {
    let mut n_wrong = 0;
    of_grazing_rays(-1.0, |_, tally| n_wrong += tally.n_wrong);
    assert!(n_wrong > 20, "{n_wrong} wrong hits");
}

/// Two instances of two meshes in each of many places, mirrored, sheared, tiny and far ones among them.
fn placed_twice() -> ([Mesh; 2], Vec<Instance>) {
    let meshes = [displaced_icosphere(3, 2), scaffold(1, true)];
    let places = placements().iter().map(|placement| placement.world_from_object).collect::<Vec<_>>();
    let places = places.into_iter().chain(transforms().into_iter().map(|(_, at)| at));
    let instances = (0..).zip(places.flat_map(|at| [at; 2])).map(|(i, at)| Instance::new(i % 2, at)).collect();
    (meshes, instances)
}

/// Rays that graze the edges of instances, through every kind of node; with negative bounds some certain hits are wrong.
#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn certain_hits_of_instances_are_the_cpus() {
    let gpu = gpu();
    let (meshes, instances) = placed_twice();
    let all_rays: Vec<Ray> = (0u64..)
        .zip(&instances)
        .flat_map(|(seed, instance)| {
            let there = baked(&meshes[instance.blas as usize], &instance.world_from_object);
            [rays::of_all_classes(&there, 20, 90 + seed), rays::from_inside(&there, 40, 120 + seed)].concat()
        })
        .collect();
    let mut n_wrong = 0;
    for config in [Config::default(), of_one_kind(NodeKind::Aligned), of_one_kind(NodeKind::Oriented)] {
        let bottom: Vec<TriangleBvh> = meshes.iter().map(|mesh| build(mesh, &config)).collect();
        let scene = block_on(TracedScene::new(&gpu, Source::tlas(&bottom, &instances), Options::default())).unwrap();
        let tlas = Tlas::new(bottom, &instances, TopConfig::default()).unwrap();
        let [mut tally, mut of_negative] = [Tally::default(), Tally::default()];
        tally.compare(&gpu, &scene, &tlas, &all_rays, 1.0);
        eprintln!("{config:?}: {tally:?}");
        assert_eq!(tally.n_wrong, 0, "{config:?}: {tally:?}");
        assert!(tally.n_certain_hits > 100 && tally.n_undecided > 100, "{config:?}: {tally:?}");
        of_negative.compare(&gpu, &scene, &tlas, &all_rays, -1.0);
        n_wrong += of_negative.n_wrong;
    }
    assert!(n_wrong > 20, "{n_wrong} wrong hits");
}

/// Views of instances that rotate, scale and move.
#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn instances_leave_few_rays_undecided() {
    let gpu = gpu();
    let mesh = displaced_icosphere(3, 4);
    let instances: Vec<Instance> =
        placements().iter().map(|placement| Instance::new(0, placement.world_from_object)).collect();
    let bottom = [build(&mesh, &Config::default())];
    let scene = block_on(TracedScene::new(&gpu, Source::tlas(&bottom, &instances), Options::default())).unwrap();
    let tlas = Tlas::new(bottom.into(), &instances, TopConfig::default()).unwrap();
    for instance in &instances {
        let there = baked(&mesh, &instance.world_from_object);
        let rays: Vec<Ray> = object_views(&there).iter().flat_map(|view| view.rays(32)).map(rays::endless).collect();
        let mut tally = Tally::default();
        tally.compare(&gpu, &scene, &tlas, &rays, 1.0);
        eprintln!("{:?}: {tally:?}", instance.world_from_object);
        assert_eq!(tally.n_wrong, 0, "{tally:?}");
        assert!(tally.n_certain_hits > 30, "{tally:?}");
        assert!((tally.n_undecided as f64) < 0.05 * tally.n_rays as f64, "{tally:?}");
    }
}

/// Views of whole objects, and the shares of rays that they may leave to exact arithmetic.
#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn few_rays_are_undecided() {
    let gpu = gpu();
    for (name, mesh, most) in [
        ("displaced icosphere", displaced_icosphere(3, 5), 0.01),
        ("terrain", grid(5, [60, 60]), 0.01),
        ("scaffold", scaffold(1, false), 0.05),
        ("truss", truss(4), 0.05),
        ("hair as tubes", hair(3, &Hair { n_strands: 1_000, ..Hair::THIN_TUBES }), 0.05),
        ("hair as ribbons", hair(3, &Hair { n_strands: 1_000, ..Hair::RIBBONS }), 0.05),
    ] {
        let rays: Vec<Ray> = object_views(&mesh).iter().flat_map(|view| view.rays(96)).map(rays::endless).collect();
        let mut tally = Tally::default();
        tally.add(&gpu, &build(&mesh, &Config::default()), &rays, 1.0);
        eprintln!("{name}: {tally:?}");
        assert_eq!(tally.n_wrong, 0, "{name}: {tally:?}");
        assert!(tally.n_certain_hits > 300, "{name}: {tally:?}");
        assert!((tally.n_undecided as f64) < most * tally.n_rays as f64, "{name}: {tally:?}");
    }
}

/// The same instances while they move a little.
fn moved(instances: &[Instance]) -> Vec<Instance> {
    let one = |instance: &Instance| {
        let mut close = instance.world_from_object;
        close.columns[3][0] += 0.125;
        Instance { world_from_object_close: Some(close), ..*instance }
    };
    instances.iter().map(one).collect()
}

/// Eight storage buffers are the default of WebGPU. Where the list of undecided rays would be the ninth, exact kernels trace all rays.
fn devices_with_eight_buffers_answer_alike() {
    let wide = gpu();
    let lower = |limits: Limits| Limits { max_storage_buffers_per_shader_stage: 8, ..limits };
    let narrow = block_on(Gpu::with_limits(&Choice::Best, lower)).unwrap();
    let (meshes, still) = placed_twice();
    let bottom: Vec<TriangleBvh> = meshes.iter().map(|mesh| build(mesh, &Config::default())).collect();
    let all_rays = rays::from_inside(&meshes[0], 300, 6);
    for (instances, all_are_exact) in [(&still, false), (&moved(&still), true)] {
        let answers = [&wide, &narrow].map(|gpu| {
            let scene = block_on(TracedScene::new(gpu, Source::tlas(&bottom, instances), Options::default())).unwrap();
            let answers = (
                block_on(scene.closest_hits(gpu, &all_rays)).unwrap(),
                block_on(scene.occluded(gpu, &all_rays)).unwrap(),
            );
            (answers, scene.n_exact_rays())
        });
        assert!(answers[0].0 == answers[1].0);
        assert!(answers[0].1 < all_rays.len() as u64);
        assert_eq!(answers[1].1 == 2 * all_rays.len() as u64, all_are_exact);
    }
}

/// Kernels without the checks of `wgpu` answer as those with them, bit for bit, at every level.
fn kernels_without_checks_answer_as_those_with_them() {
    let [unchecked, checked] = [gpu(), gpu()];
    checked.check_all_kernels();
    let mesh = scaffold(1, true);
    let (meshes, instances) = placed_twice();
    let moving = moved(&instances);
    let all_rays = [rays::of_all_classes(&mesh, 20, 5), rays::from_inside(&mesh, 300, 6)].concat();
    for config in [of_one_kind(NodeKind::Aligned), of_one_kind(NodeKind::Oriented)] {
        let flat = build(&mesh, &config);
        let bottom: Vec<TriangleBvh> = meshes.iter().map(|mesh| build(mesh, &config)).collect();
        let inputs = || {
            [
                (Source::wide(&flat), Options::default()),
                (Source::wide(&flat), Options { parts: &[0, 7], ..Options::default() }),
                (Source::tlas(&bottom, &instances), Options::default()),
                (Source::tlas(&bottom, &moving), Options::default()),
            ]
        };
        for (number, (one, other)) in inputs().into_iter().zip(inputs()).enumerate() {
            let [without, with] = [(&unchecked, one), (&checked, other)].map(|(gpu, (source, options))| {
                let scene = block_on(TracedScene::new(gpu, source, options)).unwrap();
                (
                    block_on(scene.closest_hits(gpu, &all_rays)).unwrap(),
                    block_on(scene.occluded(gpu, &all_rays)).unwrap(),
                )
            });
            assert!(without == with, "input {number}, {config:?}");
        }
    }
}
