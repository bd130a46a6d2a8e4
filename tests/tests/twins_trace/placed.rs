//! Meshes in instances of every kind of transform, with rays past them.

use canted_fixtures::Mesh;
use canted_gpu::{Gpu, TracedScene};
use canted_lbvh::Corners;
use canted_obb::Affine;
use canted_tests::{
    closed::{baked, placements},
    rays,
    scenes::{self, transforms},
};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Intersect, Ray};
use canted_wide::{Config, TriangleBvh};

use super::{
    binary::{corners, reach},
    reference::{Tally, World, error_of_instance},
    setup::build,
};

/// Meshes, instances of them, and the same on the CPU.
pub(super) struct Placed {
    meshes: [Mesh; 4],
    instances: Vec<Instance>,
    tlas: Tlas<TriangleBvh>,
    rays: Vec<Ray>,
}

impl Placed {
    pub(super) fn new() -> Self {
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

    pub(super) fn meshes(&self) -> &[Mesh] {
        &self.meshes
    }

    pub(super) fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Calls `make` with the triangles of all meshes, and the instances.
    pub(super) fn with<T>(&self, make: impl FnOnce(&[&[Corners]], &[Instance]) -> T) -> T {
        let all_corners: Vec<Vec<Corners>> = self.meshes.iter().map(corners).collect();
        let slices: Vec<&[Corners]> = all_corners.iter().map(Vec::as_slice).collect();
        make(&slices, &self.instances)
    }

    /// Asserts that a scene of the same gives the CPU's hits.
    #[track_caller]
    pub(super) fn check(&self, gpu: &Gpu, scene: &TracedScene, name: &str) {
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
            error_of_instance(ray, &instance.world_from_object, reach(mesh))
        };
        let world = World { corners: &corners_of, error: &error };
        let mut tally = Tally::default();
        world
            .check_all(gpu, scene, &self.rays, |ray| self.tlas.closest_hit(ray), &mut tally)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        tally.report(name);
    }
}
