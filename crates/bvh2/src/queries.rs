use canted_trace::{Hit, InstanceId, Kernel, Query, Ray, ScaledRay, SlabRay};

use crate::Bvh2;

/// Queries of single rays.
///
/// A ray with a NaN component, an infinite origin or direction, a zero direction or an empty interval never hits.
impl<K: Kernel> Bvh2<K> {
    /// The hit of least `t`; ties go to the lowest primitive.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.closest_hit_with(ray, InstanceId(0), &mut ())
    }

    /// Whether the ray hits anything: agrees with [`Bvh2::closest_hit`].
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.occluded_with(ray, InstanceId(0), &mut ())
    }

    /// The hit of least `t` that the query accepts, as a hit on `instance`; ties go to the lowest primitive.
    pub fn closest_hit_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        let ray = ScaledRay::new(ray)?;
        let prepared = K::prepare(&ray);
        let mut best: Option<Hit> = None;
        let slab_ray = SlabRay::new(&ray, self.pairs.reach());
        self.pairs.traverse_ordered(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
            query.triangles(1);
            match self.hit(&prepared, &ray, leaf, t_max, instance) {
                Some(hit) if best.is_none_or(|best| hit.before(&best)) && accepted(&hit, &ray, query) => {
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
        let slab_ray = SlabRay::new(&ray, self.pairs.reach());
        self.pairs.traverse_any(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
            query.triangles(1);
            match self.hit(&prepared, &ray, leaf, t_max, instance) {
                Some(hit) if accepted(&hit, &ray, query) => {
                    found = true;
                    -1.0
                }
                _ => t_max,
            }
        });
        found
    }

    /// The hit in a leaf, `t` scaled, whether or not the query accepts it.
    #[inline(always)]
    fn hit(&self, prepared: &K::Prepared, ray: &ScaledRay, leaf: u32, t_max: f32, instance: InstanceId) -> Option<Hit> {
        let hit = K::intersect(prepared, ray, &self.records[leaf as usize], t_max)?;
        let primitive = self.leaves[leaf as usize];
        Some(Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance, side: hit.side })
    }
}

/// Passes a hit to the query in the caller's units.
#[inline(always)]
fn accepted<Q: Query>(hit: &Hit, ray: &ScaledRay, query: &mut Q) -> bool {
    query.accepts(&Hit { t: ray.caller_t(hit.t), ..*hit })
}
