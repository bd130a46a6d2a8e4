//! Triangles in every BVH that a device traces: wide ones that the CPU builds, binary and wide ones that the device builds, of every volume
//! strategy; generated meshes and models of others, one level and two, buffers of a program.

use std::path::Path;

use canted_fixtures::{
    Mesh,
    device_tests::{Test, needs_device},
    soup,
};
use canted_gpu::{
    Buffer, BufferScene, DeviceBvh, DeviceInstance, Gpu, IndexBuffer, InstanceBuffer, InstancedScene, MeshBuffers,
    Options, Source, TracedScene, block_on,
    build::{BuildConfig, STRATEGIES, Topology, WideConfig},
    wgpu,
};
use canted_lbvh::{Bits, Corners, Strategy};
use canted_obb::Affine;
use canted_renderer::{Levels, SceneBvh, SceneBvhConfig, flatten, traced_scene};
use canted_tests::{
    closed::placements,
    rays,
    scenes::{self, baked, transforms},
};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Intersect, Ray};
use canted_wide::{Config, TriangleBvh};

use super::{
    gpu,
    reference::{Tally, World, error_of_instance, error_of_one_level},
    setup::{build, few_variants},
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(grazing_rays_lose_no_hit),
        needs_device(grazing_rays_lose_no_hit_in_bvhs_of_the_device),
        needs_device(rays_in_the_planes_of_faces_lose_no_hit),
        needs_device(few_triangles_are_hit),
        needs_device(the_comparison_detects_lost_moved_and_renumbered_triangles),
        needs_device(rays_through_instances_lose_no_hit),
        needs_device(models_lose_no_hit).unless(scenes::missing()),
    ]
}

fn reach_of(positions: &[[f32; 3]]) -> f64 {
    positions.iter().flatten().fold(0.0, |all: f64, &x| all.max(f64::from(x).abs()))
}

fn corners(mesh: &Mesh) -> Vec<Corners> {
    mesh.triangles.iter().map(|triangle| triangle.map(|i| mesh.positions[i as usize])).collect()
}

/// Binary BVHs of every strategy that the device builds, then wide ones of every topology and strategy.
fn of_device() -> Vec<DeviceBvh> {
    let bits = |strategy| if strategy == Strategy::Quaternion { Bits::B30 } else { Bits::B63 };
    let binary = STRATEGIES.map(|strategy| DeviceBvh::from(BuildConfig { bits: bits(strategy), strategy }));
    let wide =
        |topology| STRATEGIES.map(|strategy| DeviceBvh::from(WideConfig { bits: Bits::B63, topology, strategy }));
    [binary, wide(Topology::Radix), wide(Topology::Ploc)].concat()
}

/// The scene of a mesh whose BVH the device builds.
fn built(gpu: &Gpu, mesh: &Mesh, bvh: DeviceBvh) -> TracedScene {
    block_on(TracedScene::new(gpu, Source::build([&corners(mesh)], bvh), Options::default())).unwrap()
}

/// The scene of a mesh whose BVH the CPU builds.
fn uploaded(gpu: &Gpu, mesh: &Mesh, config: &Config) -> TracedScene {
    block_on(TracedScene::new(gpu, Source::wide(&build(mesh, config)), Options::default())).unwrap()
}

/// Compares a scene on the device with the CPU's BVH over `mesh`.
fn compared(gpu: &Gpu, mesh: &Mesh, scene: &TracedScene, rays: &[Ray]) -> Result<Tally, String> {
    let reach = reach_of(&mesh.positions);
    let world = World {
        corners: &|_, primitive| mesh.corners(primitive as usize),
        error: &|ray, _| error_of_one_level(ray, reach),
    };
    let on_cpu = build(mesh, &Config::default());
    let mut tally = Tally::default();
    world.check_all(gpu, scene, rays, |ray| on_cpu.closest_hit(ray), &mut tally)?;
    Ok(tally)
}

/// Positions and indices of a mesh on the device.
type MeshOnDevice = (Buffer<[f32; 3]>, Buffer<[u32; 3]>);

/// Meshes in buffers on the device.
struct Buffers(Vec<MeshOnDevice>);

impl Buffers {
    fn new(gpu: &Gpu, meshes: &[Mesh]) -> Self {
        let of = |mesh: &Mesh| {
            (gpu.buffer("positions", &mesh.positions).unwrap(), gpu.buffer("indices", &mesh.triangles).unwrap())
        };
        Self(meshes.iter().map(of).collect())
    }

    fn meshes<'a>(&'a self) -> Vec<MeshBuffers<'a>> {
        let count = |n: usize| u32::try_from(n).unwrap();
        let mesh = |(positions, triangles): &'a MeshOnDevice| MeshBuffers {
            vertices: positions.wgpu(),
            first_byte: 0,
            stride: 12,
            n_vertices: count(positions.len()),
            indices: Some(IndexBuffer { buffer: triangles.wgpu(), format: wgpu::IndexFormat::Uint32, first_byte: 0 }),
            n_triangles: count(triangles.len()),
        };
        self.0.iter().map(mesh).collect()
    }
}

fn all_rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    [rays::of_all_classes(mesh, n, 20), rays::from_inside(mesh, 2 * n, 30), rays::from_afar(mesh, 1e3, n, 40)].concat()
}

fn add(all: &mut Tally, one: &Tally) {
    all.n_same += one.n_same;
    all.n_ties += one.n_ties;
    all.n_besides += one.n_besides;
    all.n_at_ends += one.n_at_ends;
    all.n_missed += one.n_missed;
    all.n_cut += one.n_cut;
    all.off = all.off.max(one.off);
}

fn grazing_rays_lose_no_hit() {
    let gpu = gpu();
    let variants = few_variants();
    let mut all = Tally::default();
    let mut check = |scenes::Case { name, mesh }: &scenes::Case, variant: &str, config: &Config| {
        let tally = compared(&gpu, mesh, &uploaded(&gpu, mesh, config), &all_rays(mesh, 30));
        add(&mut all, &tally.unwrap_or_else(|error| panic!("{name}, {variant}: {error}")));
    };
    // Each mesh with one configuration, in turn; meshes that suit oriented boxes with all.
    for (case, (variant, config)) in scenes::cases().iter().zip(variants.iter().cycle()) {
        check(case, variant, config);
    }
    for case in scenes::needles() {
        variants.iter().for_each(|(variant, config)| check(&case, variant, config));
    }
    all.report("generated meshes");
}

fn grazing_rays_lose_no_hit_in_bvhs_of_the_device() {
    let gpu = gpu();
    // Each mesh with a configuration of either kind, in turn; needles, which suit oriented boxes, with all.
    let (binary, wide) = (&of_device()[..STRATEGIES.len()], &of_device()[STRATEGIES.len()..]);
    for (case, (&binary, &wide)) in scenes::cases().iter().zip(binary.iter().cycle().zip(wide.iter().cycle())) {
        for bvh in [binary, wide] {
            let tally = compared(&gpu, &case.mesh, &built(&gpu, &case.mesh, bvh), &all_rays(&case.mesh, 20));
            tally.unwrap_or_else(|error| panic!("{}, {bvh:?}: {error}", case.name));
        }
    }
    for scenes::Case { name, mesh } in scenes::needles() {
        let rays = all_rays(&mesh, 20);
        let buffers = Buffers::new(&gpu, std::slice::from_ref(&mesh));
        for bvh in of_device() {
            let tally = compared(&gpu, &mesh, &built(&gpu, &mesh, bvh), &rays);
            let tally = tally.unwrap_or_else(|error| panic!("{name}, {bvh:?}: {error}"));
            assert!(tally.n_cut == 0 && tally.n_same > 0, "{name}, {bvh:?}: {tally:?}");
            // The same triangles in buffers, without reading anything back.
            let scene = block_on(BufferScene::new(&gpu, &buffers.meshes(), bvh)).unwrap();
            let in_buffers = compared(&gpu, &mesh, scene.traced(), &rays);
            let in_buffers = in_buffers.unwrap_or_else(|error| panic!("{name}, {bvh:?} in buffers: {error}"));
            assert_eq!(in_buffers, tally, "{name}, {bvh:?}");
        }
    }
}

fn rays_in_the_planes_of_faces_lose_no_hit() {
    let gpu = gpu();
    let mut all = Tally::default();
    for (case, (variant, config)) in scenes::cases().iter().step_by(2).zip(few_variants().iter().cycle()) {
        let mesh = rays::on_lattice(&case.mesh);
        let tally = compared(&gpu, &mesh, &uploaded(&gpu, &mesh, config), &rays::in_planes(&mesh, 150, 40));
        add(&mut all, &tally.unwrap_or_else(|error| panic!("{}, {variant}: {error}", case.name)));
    }
    all.report("rays in planes");
}

/// Numbers of triangles about those of leaves, and of clusters that a work-group merges.
fn few_triangles_are_hit() {
    let gpu = gpu();
    for n in [0, 1, 2, 3, 4, 5, 8, 9, 31, 33, 256, 257] {
        let mesh = soup(u64::from(n) + 1, n);
        for topology in [Topology::Radix, Topology::Ploc] {
            for strategy in [Strategy::Aabb, Strategy::Combined] {
                let bvh = WideConfig { bits: Bits::B63, topology, strategy }.into();
                let tally = compared(&gpu, &mesh, &built(&gpu, &mesh, bvh), &all_rays(&mesh, 10));
                tally.unwrap_or_else(|error| panic!("{n} triangles, {bvh:?}: {error}"));
            }
        }
    }
}

fn the_comparison_detects_lost_moved_and_renumbered_triangles() {
    let gpu = gpu();
    let mesh = scenes::shapes().remove(0).mesh;
    let rays = all_rays(&mesh, 100);
    let changed = |change: &dyn Fn(&mut Mesh)| {
        let mut there = mesh.clone();
        change(&mut there);
        there
    };
    let fails = |scene: &TracedScene| compared(&gpu, &mesh, scene, &rays).expect_err("the change is not seen");
    // Nothing hits a degenerate triangle.
    let there = changed(&|there| there.triangles[7][1] = there.triangles[7][0]);
    let lost = fails(&uploaded(&gpu, &there, &Config::default()));
    assert!(lost.contains("lost"), "{lost}");
    for bvh in of_device() {
        let lost = fails(&built(&gpu, &there, bvh));
        assert!(lost.contains("lost"), "{bvh:?}: {lost}");
    }
    let there = changed(&|there| there.positions.iter_mut().for_each(|p| p[0] += 1e-3));
    let moved = fails(&uploaded(&gpu, &there, &Config::default()));
    assert!(moved.contains("off its triangle") || moved.contains("lost"), "{moved}");
    let there = changed(&|there| there.triangles.swap(3, 4));
    let renumbered = fails(&uploaded(&gpu, &there, &Config::default()));
    assert!(renumbered.contains("off its triangle"), "{renumbered}");
}

/// Meshes, instances of them, and the same on the CPU.
struct Placed {
    meshes: [Mesh; 4],
    instances: Vec<Instance>,
    tlas: Tlas<TriangleBvh>,
    rays: Vec<Ray>,
}

impl Placed {
    fn new() -> Self {
        // The last mesh has no triangles, the one before a single one.
        let single = Mesh { triangles: vec![[0, 1, 2]], ..scenes::room(3, 20) };
        let empty = Mesh { triangles: vec![], ..single.clone() };
        let meshes = [scenes::needles().remove(0).mesh, scenes::room(3, 20).off_axis(), single, empty];
        let placed: Vec<Affine> = placements()
            .iter()
            .map(|placement| placement.world_from_object)
            .chain(transforms().into_iter().map(|(_, at)| at))
            .collect();
        // Two instances in each place.
        let places = placed.iter().flat_map(|&at| [at; 2]);
        let instances: Vec<Instance> =
            (0..).zip(places).map(|(i, at)| Instance::new(if i % 9 == 8 { 3 } else { i % 3 }, at)).collect();
        let rays = (0u64..)
            .zip(&instances)
            .flat_map(|(seed, instance)| {
                let there = baked(&meshes[instance.blas as usize], &instance.world_from_object);
                if there.triangles.is_empty() {
                    return vec![];
                }
                [rays::of_all_classes(&there, 20, 90 + seed), rays::from_inside(&there, 40, 120 + seed)].concat()
            })
            .collect();
        let bottom: Vec<TriangleBvh> = meshes.iter().map(|mesh| build(mesh, &Config::default())).collect();
        let tlas = Tlas::new(bottom, &instances, TopConfig::default()).unwrap();
        Self { meshes, instances, tlas, rays }
    }

    /// Calls `make` with the triangles of all meshes, and the instances.
    fn with<T>(&self, make: impl FnOnce(&[&[Corners]], &[Instance]) -> T) -> T {
        let all_corners: Vec<Vec<Corners>> = self.meshes.iter().map(corners).collect();
        let slices: Vec<&[Corners]> = all_corners.iter().map(Vec::as_slice).collect();
        make(&slices, &self.instances)
    }

    /// Asserts that a scene of the same gives the CPU's hits.
    #[track_caller]
    fn check(&self, gpu: &Gpu, scene: &TracedScene, name: &str) {
        let of = |instance: u32| {
            let instance = &self.instances[instance as usize];
            (&self.meshes[instance.blas as usize], instance)
        };
        let corners_of = |instance: u32, primitive: u32| {
            let (mesh, instance) = of(instance);
            mesh.corners(primitive as usize).map(|p| instance.world_from_object.point_f64(p))
        };
        let error = |ray: &Ray, instance: u32| {
            let (mesh, instance) = of(instance);
            error_of_instance(ray, &instance.world_from_object, reach_of(&mesh.positions))
        };
        let world = World { corners: &corners_of, error: &error };
        let mut tally = Tally::default();
        world
            .check_all(gpu, scene, &self.rays, |ray| self.tlas.closest_hit(ray), &mut tally)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        tally.report(name);
    }
}

fn rays_through_instances_lose_no_hit() {
    let gpu = gpu();
    let placed = Placed::new();
    for (variant, config) in few_variants() {
        let bottom: Vec<TriangleBvh> = placed.meshes.iter().map(|mesh| build(mesh, &config)).collect();
        let scene = Source::tlas(&bottom, &placed.instances);
        placed.check(&gpu, &block_on(TracedScene::new(&gpu, scene, Options::default())).unwrap(), &variant);
    }
    // The same instances in buffers: they are placed on the device, and nothing is read back.
    let buffers = Buffers::new(&gpu, &placed.meshes);
    let transform = |instance: &Instance| DeviceInstance::new(instance.blas, &instance.world_from_object);
    let transforms: Vec<DeviceInstance> = placed.instances.iter().map(transform).collect();
    let n_instances = u32::try_from(transforms.len()).unwrap();
    let transforms = gpu.buffer("transforms", &transforms).unwrap();
    let instances =
        InstanceBuffer { buffer: transforms.wgpu(), first_byte: 0, stride: 64, n_instances, has_masks: false };
    for bvh in of_device() {
        let scene = placed.with(|meshes, instances| {
            block_on(TracedScene::new(&gpu, Source::build(meshes, bvh).with_instances(instances), Options::default()))
                .unwrap()
        });
        placed.check(&gpu, &scene, &format!("{bvh:?}"));
        let scene = block_on(InstancedScene::new(&gpu, &buffers.meshes(), &instances, bvh)).unwrap();
        placed.check(&gpu, scene.traced(), &format!("recorded {bvh:?}"));
    }
}

/// Compares a model on the device with the CPU, in one level or in two.
fn check(gpu: &Gpu, folder: &Path, file: &str, levels: Levels) {
    let scene = canted_scene::read(&folder.join(file)).unwrap();
    let config = SceneBvhConfig { levels, ..SceneBvhConfig::default() };
    let bvh = SceneBvh::build(&scene, &config).unwrap();
    let traced = traced_scene(gpu, &scene, &bvh).unwrap();
    let (positions, triangles, first) = flatten(&scene).unwrap();
    let reach_world = reach_of(&positions);
    let reaches: Vec<f64> = scene.meshes.iter().map(|mesh| reach_of(&mesh.positions)).collect();
    let flat = Mesh { positions, triangles };
    let all_rays =
        [rays::of_all_classes(&flat, 300, 7), rays::from_inside(&flat, 2000, 8), rays::from_afar(&flat, 10.0, 500, 9)]
            .concat();
    // With one level the BVH is over vertices rounded in world space, with two over those of the meshes.
    let of_flat = |instance: u32, primitive: u32| flat.corners((first[instance as usize] + primitive) as usize);
    let of_instance = |instance: u32, primitive: u32| {
        let instance = &scene.instances[instance as usize];
        let mesh = &scene.meshes[instance.mesh.0 as usize];
        let corner = |i: u32| instance.world_from_object.point_f64(mesh.positions[i as usize].map(f64::from));
        mesh.triangles[primitive as usize].map(corner)
    };
    let error_of_flat = |ray: &Ray, _: u32| error_of_one_level(ray, reach_world);
    let error_of_placed = |ray: &Ray, instance: u32| {
        let instance = &scene.instances[instance as usize];
        error_of_instance(ray, &instance.world_from_object, reaches[instance.mesh.0 as usize])
    };
    let world = if levels == Levels::Two {
        World { corners: &of_instance, error: &error_of_placed }
    } else {
        World { corners: &of_flat, error: &error_of_flat }
    };
    let mut tally = Tally::default();
    world
        .check_all(gpu, &traced, &all_rays, |ray| bvh.closest_hit(ray), &mut tally)
        .unwrap_or_else(|error| panic!("{file}, {levels:?}: {error}"));
    tally.report(&format!("{file}, {levels:?}"));
}

fn models_lose_no_hit() {
    let gpu = gpu();
    let folder = scenes::folder();
    check(&gpu, &folder, "stanford/bunny.ply", Levels::One);
    check(&gpu, &folder, "sponza/sponza.obj", Levels::One);
    check(&gpu, &folder, "sponza/sponza.obj", Levels::Two);
    check(&gpu, &folder, "kitchen/country_kitchen.glb", Levels::Two);
    check(&gpu, &folder, "instanced/pine_forest.glb", Levels::Two);
}
