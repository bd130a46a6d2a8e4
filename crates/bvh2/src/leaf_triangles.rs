//! Queries of the triangles in the leaves of any structure that reports which leaves a ray may hit. Not part of the stable
//! interface.

use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Kernel, Query, Ray, ReferencePoint, ScaledRay, SlabRay};

use crate::PairBvh;

/// A structure that reports the leaves that a ray may hit.
pub trait Leaves {
    /// Calls `leaf` with the position of each leaf that `ray` may hit at or before `t_max`, nearer subtrees first where
    /// `ORDERED`. `ray` is prepared with a reach of 0. `t_max` is scaled, and `leaf` returns the new one; without `ORDERED`, a
    /// negative one ends the traversal.
    ///
    /// Holds: `leaf` receives every leaf with a hit at or before the least `t_max` returned, ties included.
    fn traverse<const ORDERED: bool, Q: Query>(
        &self,
        ray: &SlabRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    );
}

impl Leaves for PairBvh {
    #[inline(always)]
    fn traverse<const ORDERED: bool, Q: Query>(
        &self,
        ray: &SlabRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        if ORDERED {
            self.traverse_ordered(ray, t_max, query, leaf);
        } else {
            self.traverse_any(ray, t_max, query, leaf);
        }
    }
}

/// Nodes, and one triangle for each leaf position.
pub struct LeafTriangles<'a, N, K: Kernel> {
    /// Reports leaf positions.
    pub nodes: &'a N,
    /// The triangle of each leaf position.
    pub records: &'a [K::Record],
    /// Its number in the caller's array. Two positions may refer to the same triangle.
    pub primitives: &'a [PrimId],
    /// What the nodes are relative to; triangles are in object space.
    pub reference: ReferencePoint,
}

impl<N: Leaves, K: Kernel> LeafTriangles<'_, N, K> {
    /// The hit of least `t` that the query accepts; ties go to the lowest primitive.
    #[inline(always)]
    pub fn closest_hit<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        let ray = ScaledRay::new(ray)?;
        let prepared = K::prepare(&ray);
        let mut best: Option<Hit> = None;
        let slab_ray = self.slab_ray(&ray);
        self.nodes.traverse::<true, Q>(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
            query.triangles(1);
            match self.hit(&prepared, &ray, leaf, t_max, instance) {
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
    #[inline(always)]
    pub fn occluded<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        let Some(ray) = ScaledRay::new(ray) else { return false };
        let prepared = K::prepare(&ray);
        let mut found = false;
        let slab_ray = self.slab_ray(&ray);
        self.nodes.traverse::<false, Q>(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
            query.triangles(1);
            match self.hit(&prepared, &ray, leaf, t_max, instance) {
                Some(hit) if accepts(query, &ray, &hit) => {
                    found = true;
                    -1.0
                }
                _ => t_max,
            }
        });
        found
    }

    /// Every hit that the query accepts, once: least `t` first, then lowest primitive. Replaces the contents of `hits`.
    #[inline(always)]
    pub fn all_hits<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        hits.clear();
        let Some(ray) = ScaledRay::new(ray) else { return };
        let prepared = K::prepare(&ray);
        let slab_ray = self.slab_ray(&ray);
        self.nodes.traverse::<false, Q>(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
            query.triangles(1);
            let hit = self.hit(&prepared, &ray, leaf, t_max, instance);
            hits.extend(hit.filter(|hit| accepts(query, &ray, hit)));
            t_max
        });
        // Adding zero makes -0.0 positive: the two zeros are one `t`.
        hits.sort_unstable_by(|a, b| (a.t + 0.0).total_cmp(&(b.t + 0.0)).then(a.primitive.cmp(&b.primitive)));
        // A tree with spatial splits refers to a triangle more than once.
        hits.dedup_by_key(|hit| (hit.t.to_bits(), hit.primitive));
        for hit in hits {
            hit.t = ray.caller_t(hit.t);
        }
    }

    /// The ray for the nodes.
    #[inline(always)]
    fn slab_ray(&self, ray: &ScaledRay) -> SlabRay {
        SlabRay::new(&self.reference.moved_ray(ray), 0.0)
    }

    /// The hit at a leaf position, `t` scaled, whether or not the query accepts it.
    #[inline(always)]
    fn hit(&self, prepared: &K::Prepared, ray: &ScaledRay, leaf: u32, t_max: f32, instance: InstanceId) -> Option<Hit> {
        let hit = K::intersect(prepared, ray, &self.records[leaf as usize], t_max)?;
        let primitive = self.primitives[leaf as usize];
        Some(Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance, side: hit.side })
    }
}

/// Whether the query accepts a hit, which it receives in the caller's units.
#[inline(always)]
fn accepts<Q: Query>(query: &mut Q, ray: &ScaledRay, hit: &Hit) -> bool {
    query.accepts(&Hit { t: ray.caller_t(hit.t), ..*hit })
}
