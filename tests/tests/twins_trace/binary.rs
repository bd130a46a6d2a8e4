//! Binary BVHs that the device builds: every volume strategy, one level and two.

use canted_fixtures::Mesh;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::build::{BuildConfig, STRATEGIES};
use canted_gpu::{
    Buffer, BufferScene, DeviceBvh, DeviceInstance, Gpu, IndexBuffer, InstanceBuffer, InstancedScene, MeshBuffers,
    SceneInput, TracedScene, wgpu,
};
use canted_lbvh::{Bits, Corners, Strategy};
use canted_tests::{rays, scenes};
use canted_trace::{Intersect, Ray};
use canted_wide::{Config, TriangleBvh};

use super::gpu;
use super::placed::Placed;
use super::reference::{Tally, World, error_of_one_level};
use super::setup::build;

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(grazing_rays_lose_no_hit),
        needs_device(missing_triangles_are_detected),
        needs_device(rays_through_instances_lose_no_hit),
    ]
}

pub(super) fn reach(mesh: &Mesh) -> f64 {
    mesh.positions.iter().flatten().fold(0.0, |all: f64, &x| all.max(f64::from(x).abs()))
}

pub(super) fn corners(mesh: &Mesh) -> Vec<Corners> {
    mesh.triangles.iter().map(|triangle| triangle.map(|i| mesh.positions[i as usize])).collect()
}

fn config(strategy: Strategy) -> BuildConfig {
    let bits = if strategy == Strategy::Quaternion { Bits::B30 } else { Bits::B63 };
    BuildConfig { bits, strategy }
}

/// Compares a BVH that the device builds over `there` with the CPU's over `mesh`.
fn compared(gpu: &Gpu, mesh: &Mesh, there: &Mesh, strategy: Strategy, rays: &[Ray]) -> Result<Tally, String> {
    compared_with(mesh, |world, on_cpu, tally| {
        let scene = TracedScene::new(gpu, SceneInput::build([&corners(there)], config(strategy))).unwrap();
        world.check_all(gpu, &scene, rays, |ray| on_cpu.closest_hit(ray), tally)
    })
}

/// Compares with the CPU's BVH over `mesh`.
fn compared_with(
    mesh: &Mesh,
    check: impl FnOnce(&World<'_>, &TriangleBvh, &mut Tally) -> Result<(), String>,
) -> Result<Tally, String> {
    let reach = reach(mesh);
    let world = World {
        corners: &|_, primitive| mesh.corners(primitive as usize),
        error: &|ray, _| error_of_one_level(ray, reach),
    };
    let mut tally = Tally::default();
    check(&world, &build(mesh, &Config::default()), &mut tally)?;
    Ok(tally)
}

/// Positions and indices of a mesh on the device.
type MeshOnDevice = (Buffer<[f32; 3]>, Buffer<[u32; 3]>);

/// Meshes in buffers on the device.
pub(super) struct Buffers(Vec<MeshOnDevice>);

impl Buffers {
    pub(super) fn new(gpu: &Gpu, meshes: &[Mesh]) -> Self {
        let of = |mesh: &Mesh| {
            (gpu.buffer("positions", &mesh.positions).unwrap(), gpu.buffer("indices", &mesh.triangles).unwrap())
        };
        Self(meshes.iter().map(of).collect())
    }

    pub(super) fn meshes<'a>(&'a self) -> Vec<MeshBuffers<'a>> {
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

pub(super) fn all_rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    [rays::of_all_classes(mesh, n, 20), rays::from_inside(mesh, 2 * n, 30), rays::from_afar(mesh, 1e3, n, 40)].concat()
}

fn grazing_rays_lose_no_hit() {
    let gpu = gpu();
    // Each mesh with one strategy, in turn; needles, which suit oriented boxes, with all.
    for (case, strategy) in scenes::cases().iter().zip(STRATEGIES.into_iter().cycle()) {
        let tally = compared(&gpu, &case.mesh, &case.mesh, strategy, &all_rays(&case.mesh, 20));
        tally.unwrap_or_else(|error| panic!("{}, {strategy:?}: {error}", case.name));
    }
    for case in scenes::needles() {
        for strategy in STRATEGIES {
            let rays = all_rays(&case.mesh, 20);
            let tally = compared(&gpu, &case.mesh, &case.mesh, strategy, &rays)
                .unwrap_or_else(|error| panic!("{}, {strategy:?}: {error}", case.name));
            assert!(tally.n_cut == 0 && tally.n_same > 0, "{}, {strategy:?}: {tally:?}", case.name);
            // The same triangles in buffers, without reading anything back.
            let recorded = compared_with(&case.mesh, |world, on_cpu, tally| {
                let buffers = Buffers::new(&gpu, std::slice::from_ref(&case.mesh));
                let scene = BufferScene::new(&gpu, &buffers.meshes(), config(strategy)).unwrap();
                world.check_all(&gpu, scene.traced(), &rays, |ray| on_cpu.closest_hit(ray), tally)
            });
            let recorded = recorded.unwrap_or_else(|error| panic!("{}, recorded {strategy:?}: {error}", case.name));
            assert_eq!(recorded, tally, "{}, {strategy:?}", case.name);
        }
    }
}

/// The comparison sees a BVH that lacks some triangles.
fn missing_triangles_are_detected() {
    let gpu = gpu();
    let mesh = scenes::shapes().remove(0).mesh;
    for strategy in STRATEGIES {
        let mut there = mesh.clone();
        // Nothing hits a degenerate triangle.
        there.triangles[7][1] = there.triangles[7][0];
        let error = compared(&gpu, &mesh, &there, strategy, &all_rays(&mesh, 100)).expect_err("the change is not seen");
        assert!(error.contains("lost"), "{strategy:?}: {error}");
    }
}

fn rays_through_instances_lose_no_hit() {
    let gpu = gpu();
    let placed = Placed::new();
    for strategy in STRATEGIES {
        let scene = placed.with(|meshes, instances| {
            TracedScene::new(&gpu, SceneInput::build(meshes, config(strategy)).instances(instances)).unwrap()
        });
        placed.check(&gpu, &scene, &format!("{strategy:?}"));
    }
    in_buffers(&gpu, &placed, STRATEGIES.map(|strategy| config(strategy).into()));
}

/// Checks rays through instances in buffers: instances are placed on the device, and nothing is read back.
pub(super) fn in_buffers(gpu: &Gpu, placed: &Placed, bvhs: impl IntoIterator<Item = DeviceBvh>) {
    let buffers = Buffers::new(gpu, placed.meshes());
    let transforms: Vec<DeviceInstance> = placed
        .instances()
        .iter()
        .map(|instance| DeviceInstance::new(instance.blas, &instance.world_from_object))
        .collect();
    let n_instances = u32::try_from(transforms.len()).unwrap();
    let transforms = gpu.buffer("transforms", &transforms).unwrap();
    let instances = InstanceBuffer { buffer: transforms.wgpu(), first_byte: 0, stride: 64, n_instances };
    for bvh in bvhs {
        let scene = InstancedScene::new(gpu, &buffers.meshes(), &instances, bvh).unwrap();
        placed.check(gpu, scene.traced(), &format!("recorded {bvh:?}"));
    }
}
