//! A bottom-level BVH whose bounds or hit error are not its own, to show that checks detect it, and that counts reads of its
//! bounds.

use std::sync::atomic::{AtomicUsize, Ordering};

use canted_obb::Obb;
use canted_tlas::Blas;
use canted_trace::{HIT_ERROR, Hit, InstanceId, Query, Ray};

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
