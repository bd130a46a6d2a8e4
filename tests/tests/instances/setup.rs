//! Bottom levels, and rays that graze their instances.

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::{Grazing, Mesh, grazing, soup, torus};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::Affine;
pub(crate) use canted_tests::transforms::{affine, crowd, transforms};
use canted_tlas::Instance;
use canted_trace::{Kernel, Ray};

/// Two bottom levels that instances alternate between.
pub(crate) fn meshes() -> [Mesh; 2] {
    [soup(5, 120), torus(10, 6)]
}

/// The bottom level of an instance.
pub(crate) fn blas_of(instance: usize) -> usize {
    instance % 2
}

pub(crate) fn instances(placed: &[Affine]) -> Vec<Instance> {
    let blas = |i: usize| u32::try_from(blas_of(i)).unwrap();
    placed.iter().enumerate().map(|(i, &affine)| Instance::new(blas(i), affine)).collect()
}

pub(crate) fn build<K: Kernel>(mesh: &Mesh, strategy: Strategy) -> Bvh2<K> {
    let volumes = VolumeConfig { strategy, fallback: true };
    Bvh2::build(&mesh.positions, &mesh.triangles, &BuildConfig { volumes, ..BuildConfig::default() }).unwrap()
}

/// Rays that graze the image of `mesh`, `n` of each class, half of them ending or starting near their target.
pub(crate) fn rays(mesh: &Mesh, world_from_object: &Affine, n: usize, seed: u64) -> Vec<Ray> {
    let positions = mesh.positions.iter().map(|&p| world_from_object.point(p)).collect();
    let image = Mesh { positions, triangles: mesh.triangles.clone() };
    Grazing::ALL
        .into_iter()
        .flat_map(|class| grazing(&image, class, n, seed))
        .enumerate()
        .map(|(i, ray)| {
            let (t_min, t_max) = [(0.0, f32::INFINITY), (0.0, 1.0), (0.5, f32::INFINITY), (0.0, f32::INFINITY)][i % 4];
            Ray { origin: ray.origin, direction: ray.direction, t_min, t_max }
        })
        .collect()
}

/// Rays at every instance of a scene.
pub(crate) fn all_rays(placed: &[Affine], n: usize) -> Vec<Ray> {
    let meshes = meshes();
    placed
        .iter()
        .enumerate()
        .zip(60..)
        .flat_map(|((i, affine), seed)| rays(&meshes[blas_of(i)], affine, n, seed))
        .collect()
}
