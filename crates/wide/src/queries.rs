use canted_trace::{Hit, InstanceId, Query, Ray};

use crate::batch::{AllOfOne, ClosestOfOne, OccludedOne};
use crate::bvh::WideBvh;
use crate::leaf::LeafPrimitive;
use crate::sink::FilterQuery;

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
        self.path.run(ClosestOfOne { bvh: self, ray, instance, query })
    }

    /// Whether the query accepts any hit.
    pub fn occluded_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        self.path.run(OccludedOne { bvh: self, ray, instance, query })
    }

    /// Every hit that the query accepts, as hits on `instance`. Replaces the content of `hits`.
    ///
    /// The query may see a hit twice.
    pub fn all_hits_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        self.path.run(AllOfOne { bvh: self, ray, instance, query, hits });
    }
}
