use canted_trace::{Hit, InstanceId, Query, Ray};

use crate::WideBvh;
use crate::answers::{AllOfOne, One};
use crate::traced::FilterQuery;
use crate::traverse::LaneKernel;

/// Queries of single rays.
///
/// A ray that can hit nothing, because its direction is zero, a number is not finite or its interval empty, misses.
impl<K: LaneKernel> WideBvh<K> {
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

    /// Every hit with `t_min <= t <= t_max`, in the order of [`WideBvh::closest_hit`]: least `t`, then lowest primitive.
    ///
    /// Replaces what `hits` held. Each triangle appears once, but all triangles around an edge or a vertex that the ray
    /// passes through appear; [`WideBvh::crossings`] counts surfaces instead.
    pub fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>) {
        self.all_hits_with(ray, InstanceId(0), &mut (), hits);
    }

    /// The hit of least `t` among those that `accepts` accepts; ties go to the lowest primitive.
    ///
    /// `accepts` must answer by the hit alone: it is asked about hits in an order that changes with the tree, and not
    /// about all.
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

    /// The hit of least `t` that the query accepts, as a hit on `instance`; ties go to the lowest primitive.
    pub fn closest_hit_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        self.path.run(One::<_, _, true> { tree: self, ray, instance, query })
    }

    /// Whether the query accepts any hit.
    pub fn occluded_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        self.path.run(One::<_, _, false> { tree: self, ray, instance, query }).is_some()
    }

    /// Every hit that the query accepts, as hits on `instance`; replaces what `hits` held.
    ///
    /// The query may be asked about a hit twice.
    pub fn all_hits_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        self.path.run(AllOfOne { tree: self, ray, instance, query, hits });
    }
}
