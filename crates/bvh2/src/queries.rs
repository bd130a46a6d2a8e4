use canted_trace::{Hit, HitFilter, InstanceId, Kernel, Query, Ray, ScaledRay, SlabRay};

use crate::Bvh2;

/// Queries of single rays.
///
/// A ray with a NaN component, an infinite origin or direction, a zero direction or an empty interval never hits.
///
/// Forms with `_where` count only the hits that `accepts` accepts. `accepts` must decide by its arguments alone: the
/// order of its calls depends on the BVH, and it is not called for every hit. Forms with `_with` take a [`Query`], which may
/// also count tests, and write `instance` into the hits.
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

    /// Every hit with `t_min <= t <= t_max`: least `t` first, then lowest primitive. Replaces the contents of `hits`.
    ///
    /// ```
    /// use canted_bvh2::{BuildConfig, Bvh2};
    /// use canted_trace::{Ray, Watertight};
    ///
    /// let positions = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// let bvh = Bvh2::<Watertight>::build(&positions, &[[0, 1, 2], [3, 4, 5]], &BuildConfig::default())?;
    /// let mut hits = vec![];
    /// bvh.all_hits(&Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]), &mut hits);
    /// assert_eq!(hits.iter().map(|hit| (hit.t, hit.primitive.0)).collect::<Vec<_>>(), [(1.0, 1), (2.0, 0)]);
    /// # Ok::<(), canted_lbvh::GeometryError>(())
    /// ```
    pub fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>) {
        self.all_hits_with(ray, InstanceId(0), &mut (), hits);
    }

    /// The hit of least `t` that `accepts` accepts; ties go to the lowest primitive.
    #[must_use]
    pub fn closest_hit_where(&self, ray: &Ray, accepts: impl Fn(&Ray, &Hit) -> bool) -> Option<Hit> {
        self.closest_hit_with(ray, InstanceId(0), &mut HitFilter(|hit: &Hit| accepts(ray, hit)))
    }

    /// Whether `accepts` accepts any hit.
    #[must_use]
    pub fn occluded_where(&self, ray: &Ray, accepts: impl Fn(&Ray, &Hit) -> bool) -> bool {
        self.occluded_with(ray, InstanceId(0), &mut HitFilter(|hit: &Hit| accepts(ray, hit)))
    }

    /// Every hit that `accepts` accepts, in the order of [`Bvh2::all_hits`]. Replaces the contents of `hits`.
    pub fn all_hits_where(&self, ray: &Ray, hits: &mut Vec<Hit>, accepts: impl Fn(&Ray, &Hit) -> bool) {
        self.all_hits_with(ray, InstanceId(0), &mut HitFilter(|hit: &Hit| accepts(ray, hit)), hits);
    }

    /// The hit of least `t` that the query accepts; ties go to the lowest primitive.
    pub fn closest_hit_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        let ray = ScaledRay::new(ray)?;
        let prepared = K::prepare(&ray);
        let mut best: Option<Hit> = None;
        let slab_ray = SlabRay::new(&ray, 0.0);
        self.pairs.traverse_ordered(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
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
    pub fn occluded_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        let Some(ray) = ScaledRay::new(ray) else { return false };
        let prepared = K::prepare(&ray);
        let mut found = false;
        let slab_ray = SlabRay::new(&ray, 0.0);
        self.pairs.traverse_any(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
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

    /// Every hit that the query accepts, in the order of [`Bvh2::all_hits`]. Replaces the contents of `hits`.
    pub fn all_hits_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        hits.clear();
        let Some(ray) = ScaledRay::new(ray) else { return };
        let prepared = K::prepare(&ray);
        let slab_ray = SlabRay::new(&ray, 0.0);
        self.pairs.traverse_any(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
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

    /// The hit in a leaf, `t` scaled, whether or not the query accepts it.
    #[inline(always)]
    fn hit(&self, prepared: &K::Prepared, ray: &ScaledRay, leaf: u32, t_max: f32, instance: InstanceId) -> Option<Hit> {
        let hit = K::intersect(prepared, ray, &self.records[leaf as usize], t_max)?;
        let primitive = self.leaves[leaf as usize];
        Some(Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance, side: hit.side })
    }
}

/// Whether the query accepts a hit, which it receives in the caller's units.
#[inline(always)]
fn accepts<Q: Query>(query: &mut Q, ray: &ScaledRay, hit: &Hit) -> bool {
    query.accepts(&Hit { t: ray.caller_t(hit.t), ..*hit })
}
