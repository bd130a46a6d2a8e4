//! Bottom levels, rays that graze their instances, and a bottom level that is not what it says.

use std::sync::atomic::{AtomicUsize, Ordering};

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::{Grazing, Mesh, grazing, soup, torus};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::{Affine, Obb};
use canted_tlas::{Blas, Instance};
use canted_trace::{HIT_ERROR, Hit, InstanceId, Kernel, Query, Ray};

pub(crate) use canted_tests::scenes::{affine, crowd, transforms};

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

pub(crate) struct Altered<B> {
    bvh: B,
    /// Factor of the half-extents of the bounds.
    scale: f32,
    hit_error: f32,
    n_reads: AtomicUsize,
}

impl<B: Blas> Altered<B> {
    /// Bounds and hit error of its own.
    pub(crate) fn unchanged(bvh: B) -> Self {
        let hit_error = bvh.hit_error();
        Self { bvh, scale: 1.0, hit_error, n_reads: AtomicUsize::new(0) }
    }

    /// A tenth of the bounds.
    pub(crate) fn shrunk(bvh: B) -> Self {
        Self { scale: 0.1, ..Self::unchanged(bvh) }
    }

    /// The hit error of triangles.
    pub(crate) fn with_error_of_triangles(bvh: B) -> Self {
        Self { hit_error: HIT_ERROR, ..Self::unchanged(bvh) }
    }

    /// How often the bounds were read since the last call.
    pub(crate) fn take_n_reads(&self) -> usize {
        self.n_reads.swap(0, Ordering::Relaxed)
    }
}

impl<B: Blas> Blas for Altered<B> {
    fn bounds(&self) -> Obb {
        self.n_reads.fetch_add(1, Ordering::Relaxed);
        let bounds = self.bvh.bounds();
        Obb { half_extents: bounds.half_extents.map(|half| half * self.scale), ..bounds }
    }

    fn hit_error(&self) -> f32 {
        self.hit_error
    }

    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        self.bvh.closest_hit_with(ray_object, instance, query)
    }

    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        self.bvh.occluded_with(ray_object, instance, query)
    }

    fn all_hits_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        self.bvh.all_hits_with(ray_object, instance, query, hits);
    }
}
