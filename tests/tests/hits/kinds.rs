//! Every kind of scene through every preset: hits and occlusion are those of a loop over all triangles and instances.
//!
//! Not covered: large scenes, and speed. `cargo xtask bench kinds` compares both.

use canted_fixtures::{
    Mesh,
    kinds::{self, RayKind, Scene},
};
use canted_obb::Affine;
use canted_tests::brute;
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Hit, Ray, Watertight};
use canted_wide::{Config, Preset, TriangleBvh};
use rayon::prelude::*;

const SIZE: usize = 2_000;
const N_RAYS: usize = 150;
const PRESETS: [Preset; 4] = [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality];

/// A scene of either number of levels behind one query.
enum Traced {
    One(TriangleBvh<Watertight>),
    Two(Tlas<TriangleBvh<Watertight>>),
}

impl Traced {
    fn new(scene: &Scene, preset: Preset) -> Self {
        let config = Config::preset(preset);
        let build = |mesh: &Mesh| TriangleBvh::build(&mesh.positions, &mesh.triangles, &config).unwrap();
        let mut blas: Vec<TriangleBvh<Watertight>> = scene.meshes.iter().map(build).collect();
        if scene.instances.is_empty() {
            return Self::One(blas.remove(0));
        }
        let transforms = transforms(scene).into_iter().zip(&scene.instances);
        let instance = |(transform, placed): (Affine, &kinds::Placement)| {
            Instance::new(u32::try_from(placed.mesh).unwrap(), transform)
        };
        let instances: Vec<Instance> = transforms.map(instance).collect();
        Self::Two(Tlas::new(blas, &instances, TopConfig::Wide(config)).unwrap())
    }

    fn closest(&self, ray: &Ray) -> Option<Hit> {
        match self {
            Self::One(bvh) => bvh.closest_hit(ray),
            Self::Two(tlas) => tlas.closest_hit(ray),
        }
    }

    fn occluded(&self, ray: &Ray) -> bool {
        match self {
            Self::One(bvh) => bvh.occluded(ray),
            Self::Two(tlas) => tlas.occluded(ray),
        }
    }
}

fn transforms(scene: &Scene) -> Vec<Affine> {
    scene.instances.iter().map(|placed| Affine { columns: placed.world_from_object }).collect()
}

fn rays(scene: &Scene, seed: u64) -> Vec<Ray> {
    let rays = RayKind::ALL.into_iter().flat_map(|kind| scene.rays(kind, N_RAYS, seed));
    rays.map(|ray| Ray { t_max: ray.t_max, ..Ray::new(ray.origin, ray.direction) }).collect()
}

/// The closest hit of each ray by the loop.
fn looped(scene: &Scene, rays: &[Ray]) -> Vec<Option<Hit>> {
    let records: Vec<_> =
        scene.meshes.iter().map(|mesh| brute::records::<Watertight>(&mesh.positions, &mesh.triangles)).collect();
    let in_mesh = |mesh: usize, ray: &Ray| brute::closest_hit::<Watertight>(&records[mesh], ray);
    let transforms = transforms(scene);
    let hit = |ray: &Ray| match scene.instances.is_empty() {
        true => in_mesh(0, ray),
        false => brute::closest_hit_of_instances(&transforms, ray, |i, ray| in_mesh(scene.instances[i].mesh, ray)),
    };
    rays.iter().map(hit).collect()
}

/// The first ray whose answers are not those of the loop.
fn wrong(traced: &Traced, rays: &[Ray], truth: &[Option<Hit>]) -> Option<usize> {
    let is_wrong =
        |(ray, truth): (&Ray, &Option<Hit>)| traced.closest(ray) != *truth || traced.occluded(ray) != truth.is_some();
    rays.iter().zip(truth).position(is_wrong)
}

#[test]
fn every_preset_hits_what_the_loop_hits() {
    kinds::all().par_iter().for_each(|kind| {
        for seed in [1, 2] {
            let scene = kind.generate(SIZE, seed);
            let rays = rays(&scene, seed);
            let truth = looped(&scene, &rays);
            for preset in PRESETS {
                let wrong = wrong(&Traced::new(&scene, preset), &rays, &truth);
                assert_eq!(wrong, None, "ray of {}, seed {seed}, {preset:?}", kind.name);
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
        assert!(wrong(&Traced::new(&lost, Preset::Fast), &rays, &truth).is_some(), "{name}");
    }
}
