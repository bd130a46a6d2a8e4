//! Bottom levels, rays that graze their instances, and a bottom level that is not what it says.

use std::sync::atomic::{AtomicUsize, Ordering};

use canted_bvh2::Bvh2;
use canted_fixtures::{Grazing, Mesh, grazing, soup, torus};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::{Affine, Obb};
use canted_tests::{scenes::baked, variants};
use canted_tlas::{Instance, TopConfig};
use canted_trace::{HIT_ERROR, Hit, Intersect, Query, Ray, ScaledRay, TriangleTest};

pub(crate) use canted_tests::{
    rays::endless,
    scenes::{affine, crowd, transforms},
    variants::{binary_top, first_difference},
};

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

pub(crate) fn build(mesh: &Mesh, strategy: Strategy) -> Bvh2 {
    variants::binary(mesh, strategy, TriangleTest::Watertight)
}

/// Both bottom levels, binary.
pub(crate) fn bottom() -> Vec<Bvh2> {
    meshes().iter().map(|mesh| build(mesh, Strategy::Dop)).collect()
}

/// A top level of wide nodes, and of binary ones with oriented boxes.
pub(crate) fn tops() -> [TopConfig; 2] {
    [TopConfig::default(), binary_top(VolumeConfig { strategy: Strategy::Combined, fallback: true })]
}

/// Rays that graze the image of `mesh`, `n` of each class, half of them ending or starting near their target.
pub(crate) fn rays(mesh: &Mesh, world_from_object: &Affine, n: usize, seed: u64) -> Vec<Ray> {
    let image = baked(mesh, world_from_object);
    let intervals = [(0.0, f32::INFINITY), (0.0, 1.0), (0.5, f32::INFINITY), (0.0, f32::INFINITY)];
    let rays = Grazing::ALL.into_iter().flat_map(|class| grazing(&image, class, n, seed)).map(endless);
    rays.zip(intervals.into_iter().cycle()).map(|(ray, (t_min, t_max))| ray.between(t_min, t_max)).collect()
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

/// A bottom level whose bounds or hit error are not its own, to show that checks detect it, and that counts calls.
pub(crate) struct Altered<B> {
    bvh: B,
    /// Factor of the half-extents of the bounds.
    scale: f32,
    hit_error: f32,
    n_bounds: AtomicUsize,
    n_rays: AtomicUsize,
}

impl<B: Intersect> Altered<B> {
    /// Bounds and hit error of its own.
    pub(crate) fn unchanged(bvh: B) -> Self {
        let hit_error = bvh.hit_error();
        Self { bvh, scale: 1.0, hit_error, n_bounds: AtomicUsize::new(0), n_rays: AtomicUsize::new(0) }
    }

    /// A tenth of the bounds.
    pub(crate) fn shrunk(bvh: B) -> Self {
        Self { scale: 0.1, ..Self::unchanged(bvh) }
    }

    /// The hit error of triangles.
    pub(crate) fn with_error_of_triangles(bvh: B) -> Self {
        Self { hit_error: HIT_ERROR, ..Self::unchanged(bvh) }
    }

    /// How often its bounds were read, and rays traced, since the last call.
    pub(crate) fn take_counts(&self) -> (usize, usize) {
        (self.n_bounds.swap(0, Ordering::Relaxed), self.n_rays.swap(0, Ordering::Relaxed))
    }
}

impl<B: Intersect> Intersect for Altered<B> {
    fn bounds(&self) -> Obb {
        self.n_bounds.fetch_add(1, Ordering::Relaxed);
        let bounds = self.bvh.bounds();
        Obb { half_extents: bounds.half_extents.map(|half| half * self.scale), ..bounds }
    }

    fn hit_error(&self) -> f32 {
        self.hit_error
    }

    fn is_empty(&self) -> bool {
        self.bvh.is_empty()
    }

    fn stack_len(&self) -> usize {
        self.bvh.stack_len()
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> Option<Hit> {
        self.n_rays.fetch_add(1, Ordering::Relaxed);
        self.bvh.closest_hit_scaled(ray, query, stack)
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        self.n_rays.fetch_add(1, Ordering::Relaxed);
        self.bvh.occluded_scaled(ray, query, stack)
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        self.n_rays.fetch_add(1, Ordering::Relaxed);
        self.bvh.all_hits_scaled(ray, query, stack, hits);
    }
}
