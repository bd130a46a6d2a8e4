//! Two levels: rotated, mirrored, sheared, tiny, huge and far instances.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_obb::Affine;
use canted_tests::{
    closed::{baked, placements},
    rays,
    scenes::{self, transforms},
};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Intersect, Ray};
use canted_wide::TriangleBvh;

use super::{
    gpu,
    reference::{Tally, World, error_of_instance},
    setup::{build, few_variants},
};

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_device(rays_through_instances_lose_no_hit)]
}

fn rays_through_instances_lose_no_hit() {
    let gpu = gpu();
    let meshes = [scenes::needles().remove(0).mesh, scenes::room(3, 20).off_axis()];
    let reach = meshes
        .each_ref()
        .map(|mesh| mesh.positions.iter().flatten().fold(0.0, |all: f64, &x| all.max(f64::from(x).abs())));
    let placed: Vec<Affine> = placements()
        .iter()
        .map(|placement| placement.world_from_object)
        .chain(transforms().into_iter().map(|(_, at)| at))
        .flat_map(|at| [at; 2])
        .collect();
    let instances: Vec<Instance> =
        placed.iter().zip([0, 1].into_iter().cycle()).map(|(&at, blas)| Instance::new(blas, at)).collect();
    let all_rays: Vec<Ray> = placed
        .iter()
        .zip(0..)
        .flat_map(|(at, i)| {
            let mesh = baked(&meshes[i % 2], at);
            [rays::of_all_classes(&mesh, 30, 90 + i as u64), rays::from_inside(&mesh, 60, 120 + i as u64)].concat()
        })
        .collect();
    let corners = |instance: u32, primitive: u32| {
        let i = instance as usize;
        meshes[i % 2].corners(primitive as usize).map(|p| placed[i].point_f64(p))
    };
    let error = |ray: &Ray, instance: u32| {
        let i = instance as usize;
        error_of_instance(ray, &placed[i], reach[i % 2])
    };
    let world = World { corners: &corners, error: &error };
    for (variant, config) in few_variants() {
        let bottom: Vec<TriangleBvh> = meshes.iter().map(|mesh| build(mesh, &config)).collect();
        let scene =
            canted_gpu::TracedScene::new(&gpu, canted_gpu::SceneInput::upload(&bottom).instances(&instances)).unwrap();
        let tlas = Tlas::new(bottom, &instances, TopConfig::default()).unwrap();
        let mut tally = Tally::default();
        world
            .check_all(&gpu, &scene, &all_rays, |ray| tlas.closest_hit(ray), &mut tally)
            .unwrap_or_else(|error| panic!("{variant}: {error}"));
        tally.report(&variant);
    }
}
