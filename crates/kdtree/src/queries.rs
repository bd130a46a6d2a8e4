use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Kernel, Query, Ray, ScaledRay, SlabRay};

use crate::KdTree;

canted_trace::triangle_queries!(KdTree, canted_lbvh::per_item);

/// Queries that take a [`Query`]. It may be asked more than once about a hit of a triangle in several leaves, but for
/// [`Self::all_hits_with`].
impl<K: Kernel> KdTree<K> {
    /// The hit of least `t` that the query accepts; ties go to the lowest primitive.
    pub fn closest_hit_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        let ray = ScaledRay::new(ray)?;
        let prepared = K::prepare(&ray);
        let mut best: Option<Hit> = None;
        self.nodes.traverse(&SlabRay::new(&ray, 0.0), ray.t_max, query, |triangle, t_max, query| {
            query.triangles(1);
            match self.hit(&prepared, &ray, triangle, t_max, instance) {
                Some(hit) if best.is_none_or(|best| hit.before(&best)) && accepts(query, &ray, &hit) => {
                    best = Some(hit);
                    hit.t
                }
                _ => t_max,
            }
        });
        best.map(|hit| Hit { t: ray.caller_t(hit.t), ..hit })
    }

    /// Whether the query accepts any hit.
    pub fn occluded_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        let Some(ray) = ScaledRay::new(ray) else { return false };
        let prepared = K::prepare(&ray);
        let mut found = false;
        self.nodes.traverse(&SlabRay::new(&ray, 0.0), ray.t_max, query, |triangle, t_max, query| {
            query.triangles(1);
            match self.hit(&prepared, &ray, triangle, t_max, instance) {
                Some(hit) if accepts(query, &ray, &hit) => {
                    found = true;
                    -1.0
                }
                _ => t_max,
            }
        });
        found
    }

    /// Every hit that the query accepts, once, in the order of [`Self::all_hits`]. Replaces the contents of `hits`. The query is
    /// asked once about each hit, in that order.
    pub fn all_hits_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        hits.clear();
        let Some(ray) = ScaledRay::new(ray) else { return };
        let prepared = K::prepare(&ray);
        self.nodes.traverse(&SlabRay::new(&ray, 0.0), ray.t_max, query, |triangle, t_max, query| {
            query.triangles(1);
            hits.extend(self.hit(&prepared, &ray, triangle, t_max, instance));
            t_max
        });
        // Adding zero makes -0.0 positive: the two zeros are one `t`.
        hits.sort_unstable_by(|a, b| (a.t + 0.0).total_cmp(&(b.t + 0.0)).then(a.primitive.cmp(&b.primitive)));
        // A triangle in several leaves has the same hit in each.
        hits.dedup_by_key(|hit| hit.primitive);
        hits.retain_mut(|hit| {
            hit.t = ray.caller_t(hit.t);
            query.accepts(hit)
        });
    }

    /// The hit on a triangle, `t` scaled, whether or not the query accepts it.
    #[inline(always)]
    fn hit(
        &self,
        prepared: &K::Prepared,
        ray: &ScaledRay,
        triangle: u32,
        t_max: f32,
        instance: InstanceId,
    ) -> Option<Hit> {
        let hit = K::intersect(prepared, ray, &self.records[triangle as usize], t_max)?;
        Some(Hit { t: hit.t, u: hit.u, v: hit.v, primitive: PrimId(triangle), instance, side: hit.side })
    }
}

/// Whether the query accepts a hit, which it receives in the caller's units.
#[inline(always)]
fn accepts<Q: Query>(query: &mut Q, ray: &ScaledRay, hit: &Hit) -> bool {
    query.accepts(&Hit { t: ray.caller_t(hit.t), ..*hit })
}
