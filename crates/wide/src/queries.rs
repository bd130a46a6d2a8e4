use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay};

use crate::batch::{AllOfOne, ClosestOfOne, OccludedOne};
use crate::bvh::WideBvh;
use crate::leaf::LeafPrimitive;
use crate::sink::FilterQuery;
use crate::traverse::Stack;

/// Queries of single rays.
///
/// A ray with a NaN component, an infinite origin or direction, a zero direction or an empty interval never hits.
impl<P: LeafPrimitive> WideBvh<P> {
    /// The hit of least `t`; ties go to the lowest primitive.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.closest_hit_with(ray, InstanceId(0), &mut ())
    }

    /// Whether anything is hit: agrees with [`WideBvh::closest_hit`].
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.occluded_with(ray, InstanceId(0), &mut ())
    }

    /// Every hit with `t_min <= t <= t_max`, sorted by `t`, then by primitive. Replaces the content of `hits`.
    ///
    /// Each triangle appears once, and all triangles around an edge or a vertex that the ray passes through appear;
    /// [`WideBvh::crossings`] counts surfaces instead.
    pub fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>) {
        self.all_hits_with(ray, InstanceId(0), &mut (), hits);
    }

    /// The hit of least `t` among those that `accepts` accepts; ties go to the lowest primitive.
    ///
    /// The result of `accepts` must depend on its arguments alone: it is called for some of the hits only, in an order that
    /// depends on the BVH.
    #[must_use]
    pub fn closest_hit_where(&self, ray: &Ray, accepts: impl Fn(&Ray, &Hit) -> bool) -> Option<Hit> {
        let accepts = |_: usize, ray: &Ray, hit: &Hit| accepts(ray, hit);
        self.closest_hit_with(ray, InstanceId(0), &mut FilterQuery { accepts: &accepts, index: 0, ray })
    }

    /// Whether `accepts` accepts any hit; see [`WideBvh::closest_hit_where`].
    #[must_use]
    pub fn occluded_where(&self, ray: &Ray, accepts: impl Fn(&Ray, &Hit) -> bool) -> bool {
        let accepts = |_: usize, ray: &Ray, hit: &Hit| accepts(ray, hit);
        self.occluded_with(ray, InstanceId(0), &mut FilterQuery { accepts: &accepts, index: 0, ray })
    }

    /// Every hit that `accepts` accepts, as [`WideBvh::all_hits`] returns them.
    pub fn all_hits_where(&self, ray: &Ray, hits: &mut Vec<Hit>, accepts: impl Fn(&Ray, &Hit) -> bool) {
        let accepts = |_: usize, ray: &Ray, hit: &Hit| accepts(ray, hit);
        self.all_hits_with(ray, InstanceId(0), &mut FilterQuery { accepts: &accepts, index: 0, ray }, hits);
    }

    /// The hit of least `t` that the query accepts, as a hit on `instance`; ties go to the lowest primitive.
    pub fn closest_hit_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        self.closest_hit_scaled(&ScaledRay::new(ray)?, instance, query, &mut Stack::new())
    }

    /// Whether the query accepts any hit.
    pub fn occluded_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        ScaledRay::new(ray).is_some_and(|ray| self.occluded_scaled(&ray, instance, query, &mut Stack::new()))
    }

    /// Every hit that the query accepts, as hits on `instance`. Replaces the content of `hits`.
    ///
    /// The query may see a hit twice.
    pub fn all_hits_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        hits.clear();
        if let Some(ray) = &ScaledRay::new(ray) {
            self.path.run(AllOfOne { bvh: self, ray, instance, query, hits });
        }
    }

    /// As [`WideBvh::closest_hit_with`], of a ray that a TLAS has scaled and checked; `t` of the hit is that of the original ray.
    #[doc(hidden)]
    #[inline]
    pub fn closest_hit_scaled<Q: Query>(
        &self,
        ray: &ScaledRay,
        instance: InstanceId,
        query: &mut Q,
        stack: &mut Stack,
    ) -> Option<Hit> {
        self.path.run(ClosestOfOne { bvh: self, stack, ray, instance, query })
    }

    /// As [`WideBvh::occluded_with`], of a ray that a TLAS has scaled and checked.
    #[doc(hidden)]
    #[inline]
    pub fn occluded_scaled<Q: Query>(
        &self,
        ray: &ScaledRay,
        instance: InstanceId,
        query: &mut Q,
        stack: &mut Stack,
    ) -> bool {
        self.path.run(OccludedOne { bvh: self, stack, ray, instance, query })
    }
}
