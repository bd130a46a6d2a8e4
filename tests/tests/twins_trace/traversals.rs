//! All traversal variants: none loses a hit.

use canted_fixtures::Mesh;
use canted_gpu::{Gpu, TracedScene, Traversal};
use canted_obb::Affine;
use canted_tests::{closed::placements, rays, scenes};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Ray, Watertight};

use super::gpu;
use super::reference::{Tally, World, error_of_instance};
use super::setup::{build, few_variants};

/// A mesh large enough for several levels, in the placements of closed meshes.
fn placed() -> (Mesh, Vec<Instance>) {
    let instances = placements().iter().map(|transform| Instance::new(0, transform.world_from_object)).collect();
    (scenes::room(3, 40).off_axis(), instances)
}

#[test]
fn no_traversal_loses_a_hit() {
    let Some(gpu) = gpu("no_traversal_loses_a_hit") else { return };
    let (mesh, instances) = placed();
    let reach = mesh.positions.iter().flatten().fold(0.0, |all: f64, &x| all.max(f64::from(x).abs()));
    let (variant, config) = few_variants().remove(0);
    let tree = build::<Watertight>(&mesh, &config);
    let at_home = [Instance::new(0, Affine::IDENTITY)];
    let tlas = [&at_home[..], &instances].map(|instances| {
        let bottom = vec![build::<Watertight>(&mesh, &config)];
        Tlas::new(bottom, instances, TopConfig::default()).unwrap()
    });
    for traversal in Traversal::ALL {
        let scenes: [TracedScene; 2] = [
            TracedScene::single_level(&gpu, &tree, &[0]).unwrap(),
            TracedScene::two_level(&gpu, &[&tree], &instances).unwrap(),
        ];
        for ((scene, tlas), instances) in scenes.into_iter().zip(&tlas).zip([&at_home[..], &instances]) {
            let scene = scene.with_traversal(&gpu, traversal).unwrap();
            let transform = |instance: u32| instances[instance as usize].world_from_object;
            let corners = |instance: u32, primitive: u32| {
                mesh.corners(primitive as usize).map(|p| transform(instance).point_f64(p))
            };
            let error = |ray: &Ray, instance: u32| error_of_instance(ray, &transform(instance), reach);
            let world = World { corners: &corners, error: &error };
            let mut tally = Tally::default();
            world
                .check_all(&gpu, &scene, &all_rays(&mesh, instances), |ray| tlas.closest_hit(ray), &mut tally)
                .unwrap_or_else(|error| panic!("{traversal:?}, {variant}, {} instances: {error}", instances.len()));
            tally.report(&format!("{traversal:?}, {} instances", instances.len()));
        }
    }
}

/// Rays at all instances of the mesh.
fn all_rays(mesh: &Mesh, instances: &[Instance]) -> Vec<Ray> {
    let at = |instance: &Instance| {
        let there = canted_tests::closed::baked(mesh, &instance.world_from_object);
        [rays::of_all_classes(&there, 30, 3), rays::from_inside(&there, 200, 4)].concat()
    };
    instances.iter().flat_map(at).collect()
}

#[test]
fn missing_parent_links_are_detected() {
    let Some(gpu) = gpu("missing_parent_links_are_detected") else { return };
    let (mesh, _) = placed();
    let tree = build::<Watertight>(&mesh, &few_variants().remove(0).1);
    let rays = rays::from_inside(&mesh, 500, 4);
    let hits = |gpu: &Gpu, scene: &TracedScene| scene.closest_hits(gpu, &rays).unwrap();
    let scene = |traversal: Traversal| {
        TracedScene::single_level(&gpu, &tree, &[0]).unwrap().with_traversal(&gpu, traversal).unwrap()
    };
    let stack = hits(&gpu, &scene(Traversal::Stack));
    for traversal in [Traversal::Bits, Traversal::Links] {
        assert_eq!(hits(&gpu, &scene(traversal)).len(), stack.len());
        assert_ne!(hits(&gpu, &scene(traversal).without_parent_links(&gpu).unwrap()), stack, "{traversal:?}");
    }
}
