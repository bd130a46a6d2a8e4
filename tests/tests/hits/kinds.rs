//! Every kind of scene through every preset, BIHs and kd-trees: hits and occlusion are those of a loop over all triangles and instances.
//!
//! Not covered: large scenes, and speed. `cargo xtask bench kinds` compares both.

use canted_bih::{Bih, BihConfig, LeafSize};
use canted_fixtures::{
    Mesh,
    kinds::{self, RayKind, Scene},
};
use canted_kdtree::{KdTraversal, KdTree, KdTreeConfig};
use canted_obb::Affine;
use canted_tests::{brute, rays::endless, variants::first_difference};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Hit, Intersect, Ray, TriangleTest};
use canted_wide::{Config, Preset, TriangleBvh};
use rayon::prelude::*;

const SIZE: usize = 2_000;
const N_RAYS: usize = 150;
const PRESETS: [Preset; 4] = [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality];

/// A scene of either number of levels.
fn traced<B: Intersect + 'static>(scene: &Scene, top: Preset, build: impl Fn(&Mesh) -> B) -> Box<dyn Intersect> {
    let mut blas: Vec<B> = scene.meshes.iter().map(build).collect();
    if scene.instances.is_empty() {
        return Box::new(blas.remove(0));
    }
    let placed = transforms(scene).into_iter().zip(&scene.instances);
    let instances: Vec<Instance> =
        placed.map(|(map, placed)| Instance::new(u32::try_from(placed.mesh).unwrap(), map)).collect();
    Box::new(Tlas::new(blas, &instances, TopConfig::Wide(Config::preset(top))).unwrap())
}

fn wide(scene: &Scene, preset: Preset) -> Box<dyn Intersect> {
    let build = |mesh: &Mesh| TriangleBvh::build_with(&mesh.positions, &mesh.triangles, preset).unwrap();
    traced(scene, preset, build)
}

/// BIHs of two configurations, and kd-trees with both traversals.
fn others(scene: &Scene) -> [Box<dyn Intersect>; 4] {
    let [one, automatic] =
        [BihConfig { leaf_size: LeafSize::AtMost(1), tight_factor: 1.0, ..Default::default() }, BihConfig::default()];
    let bih = |config: BihConfig| {
        traced(scene, Preset::Fast, |mesh| Bih::build(&mesh.positions, &mesh.triangles, &config).unwrap())
    };
    let kd_tree = |traversal| {
        let config = KdTreeConfig { traversal, ..KdTreeConfig::default() };
        traced(scene, Preset::Fast, |mesh| KdTree::build(&mesh.positions, &mesh.triangles, &config).unwrap())
    };
    [bih(one), bih(automatic), kd_tree(KdTraversal::Stack), kd_tree(KdTraversal::Ropes)]
}

fn transforms(scene: &Scene) -> Vec<Affine> {
    scene.instances.iter().map(|placed| Affine::from(placed.world_from_object)).collect()
}

fn rays(scene: &Scene, seed: u64) -> Vec<Ray> {
    let rays = RayKind::ALL.into_iter().flat_map(|kind| scene.rays(kind, N_RAYS, seed));
    rays.map(endless).collect()
}

/// The closest hit of each ray by the loop.
fn looped(scene: &Scene, rays: &[Ray]) -> Vec<Option<Hit>> {
    let in_mesh: Vec<_> = scene.meshes.iter().map(|mesh| brute::of_mesh(mesh, TriangleTest::Watertight)).collect();
    let transforms = transforms(scene);
    let hit = |ray: &Ray| match scene.instances.is_empty() {
        true => in_mesh[0](ray),
        false => brute::closest_hit_of_instances(&transforms, ray, |i, ray| in_mesh[scene.instances[i].mesh](ray)),
    };
    rays.iter().map(hit).collect()
}

#[test]
fn every_structure_hits_what_the_loop_hits() {
    kinds::all().par_iter().chain(kinds::fresh()).for_each(|kind| {
        for seed in [1, 2] {
            let scene = kind.generate(SIZE, seed);
            let rays = rays(&scene, seed);
            let truth = looped(&scene, &rays);
            for preset in PRESETS {
                let wrong = first_difference(&wide(&scene, preset), &rays, &truth);
                assert_eq!(wrong, None, "{}, seed {seed}, {preset:?}", kind.name);
            }
            for (i, other) in others(&scene).iter().enumerate() {
                assert_eq!(first_difference(other, &rays, &truth), None, "{}, seed {seed}, {i}", kind.name);
            }
        }
    });
}

#[test]
fn the_comparison_sees_a_lost_triangle_and_a_lost_instance() {
    for name in ["room", "far_1e6", "nested_shells", "mirrored"] {
        let scene = kinds::named(name).unwrap().generate(SIZE, 1);
        let rays = rays(&scene, 1);
        let truth = looped(&scene, &rays);
        let hit = truth.iter().flatten().next().expect("a ray hits something");
        let mut lost = scene.clone();
        if lost.instances.is_empty() {
            // The triangle shrinks to a point; the others keep their numbers.
            let corners = &mut lost.meshes[0].triangles[hit.primitive.index()];
            *corners = [corners[0]; 3];
        } else {
            lost.instances.remove(hit.instance.0 as usize);
        }
        assert!(first_difference(&wide(&lost, Preset::Fast), &rays, &truth).is_some(), "{name}");
    }
}
