//! Wide BVHs that the device builds: radix and clustered trees, aligned and oriented nodes, one level and two.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_fixtures::{Mesh, soup};
use canted_gpu::build::{STRATEGIES, Topology, WideConfig};
use canted_gpu::{BufferScene, Gpu, SceneInput, TracedScene};
use canted_lbvh::{Bits, Strategy};
use canted_tests::scenes;
use canted_trace::{Intersect, Ray};
use canted_wide::Config;

use super::binary::{Buffers, all_rays, corners, in_buffers, reach};
use super::gpu;
use super::placed::Placed;
use super::reference::{Tally, World, error_of_one_level};
use super::setup::build;

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(grazing_rays_lose_no_hit),
        needs_device(few_triangles_are_hit),
        needs_device(missing_triangles_are_detected),
        needs_device(rays_through_instances_lose_no_hit),
    ]
}

/// Every topology and strategy.
fn configs() -> impl Iterator<Item = WideConfig> + Clone {
    let of = |topology| STRATEGIES.map(|strategy| WideConfig { bits: Bits::B63, topology, strategy });
    [Topology::Radix, Topology::Ploc].into_iter().flat_map(of)
}

/// Compares a BVH that the device builds over `there` with the CPU's over `mesh`.
fn compared(gpu: &Gpu, mesh: &Mesh, there: &Mesh, config: WideConfig, rays: &[Ray]) -> Result<Tally, String> {
    let scene = TracedScene::new(gpu, SceneInput::build([&corners(there)], config)).unwrap();
    compared_with(gpu, mesh, &scene, rays)
}

/// Compares a scene with the CPU's BVH over `mesh`.
fn compared_with(gpu: &Gpu, mesh: &Mesh, scene: &TracedScene, rays: &[Ray]) -> Result<Tally, String> {
    let reach = reach(mesh);
    let world = World {
        corners: &|_, primitive| mesh.corners(primitive as usize),
        error: &|ray, _| error_of_one_level(ray, reach),
    };
    let on_cpu = build(mesh, &Config::default());
    let mut tally = Tally::default();
    world.check_all(gpu, scene, rays, |ray| on_cpu.closest_hit(ray), &mut tally)?;
    Ok(tally)
}

fn grazing_rays_lose_no_hit() {
    let gpu = gpu();
    // Each mesh with one configuration, in turn; needles, which suit oriented boxes, with all.
    for (case, config) in scenes::cases().iter().zip(configs().cycle()) {
        let tally = compared(&gpu, &case.mesh, &case.mesh, config, &all_rays(&case.mesh, 20));
        tally.unwrap_or_else(|error| panic!("{}, {config:?}: {error}", case.name));
    }
    for case in scenes::needles() {
        for config in configs() {
            let rays = all_rays(&case.mesh, 20);
            let tally = compared(&gpu, &case.mesh, &case.mesh, config, &rays)
                .unwrap_or_else(|error| panic!("{}, {config:?}: {error}", case.name));
            assert!(tally.n_cut == 0 && tally.n_same > 0, "{}, {config:?}: {tally:?}", case.name);
            // The same triangles in buffers.
            let buffers = Buffers::new(&gpu, std::slice::from_ref(&case.mesh));
            let scene = BufferScene::new(&gpu, &buffers.meshes(), config).unwrap();
            let in_buffers = compared_with(&gpu, &case.mesh, scene.traced(), &rays);
            let in_buffers = in_buffers.unwrap_or_else(|error| panic!("{}, {config:?} in buffers: {error}", case.name));
            assert_eq!(in_buffers, tally, "{}, {config:?}", case.name);
        }
    }
}

/// Numbers of triangles about those of leaves, and of clusters that a work-group merges.
fn few_triangles_are_hit() {
    let gpu = gpu();
    let numbers = [0, 1, 2, 3, 4, 5, 8, 9, 31, 33, 256, 257];
    let few = || configs().filter(|config| matches!(config.strategy, Strategy::Aabb | Strategy::Combined));
    for (n, config) in numbers.into_iter().flat_map(|n| few().map(move |config| (n, config))) {
        let mesh = soup(u64::from(n) + 1, n);
        let rays = if n == 0 { vec![Ray::new([0.0; 3], [1.0; 3])] } else { all_rays(&mesh, 10) };
        let tally = compared(&gpu, &mesh, &mesh, config, &rays);
        tally.unwrap_or_else(|error| panic!("{n} triangles, {config:?}: {error}"));
    }
}

/// The comparison sees a BVH that lacks some triangles.
fn missing_triangles_are_detected() {
    let gpu = gpu();
    let mesh = scenes::shapes().remove(0).mesh;
    for config in configs() {
        let mut there = mesh.clone();
        // Nothing hits a degenerate triangle.
        there.triangles[7][1] = there.triangles[7][0];
        let error = compared(&gpu, &mesh, &there, config, &all_rays(&mesh, 100)).expect_err("the change is not seen");
        assert!(error.contains("lost"), "{config:?}: {error}");
    }
}

fn rays_through_instances_lose_no_hit() {
    let gpu = gpu();
    let placed = Placed::new();
    // Each strategy with one topology, in turn.
    let topologies = [Topology::Radix, Topology::Ploc].into_iter().cycle();
    for (strategy, topology) in STRATEGIES.into_iter().zip(topologies) {
        let config = WideConfig { bits: Bits::B63, topology, strategy };
        let scene = placed.with(|meshes, instances| {
            TracedScene::new(&gpu, SceneInput::build(meshes, config).instances(instances)).unwrap()
        });
        placed.check(&gpu, &scene, &format!("{config:?}"));
    }
    in_buffers(&gpu, &placed, configs().step_by(5).map(Into::into));
}
