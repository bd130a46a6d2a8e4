use std::cmp::Ordering;

use canted_obb::round::up;
use canted_trace::{Hit, HitFilter, InstanceId, Query, Ray};
use canted_wide::Stack;

use crate::blas::{Blas, CrossingBlas};
use crate::world_ray::{ObjectRay, WorldRay};
use crate::{RayOptions, Tlas};

/// Memory for nodes that wait: of the top level, and of all bottom-level BVHs in turn.
#[derive(Default)]
pub(crate) struct Stacks {
    top: Stack,
    bottom: Stack,
}

/// Queries of single rays.
///
/// A ray with a NaN component, an infinite origin or direction, a zero direction or an empty interval never hits.
///
/// Forms with `_where` count only the hits that `accepts` accepts. `accepts` must decide by its arguments alone: the
/// order of its calls depends on the BVHs, and it does not see every hit. Forms with `_with` take a [`Query`], which sets
/// mask and time of the ray, counts tests and filters hits; [`RayOptions`] sets mask and time alone.
impl<B: Blas> Tlas<B> {
    /// The hit of least `t`; ties go to the lowest (instance, primitive).
    ///
    /// ```
    /// use canted_bvh2::{BuildConfig, Bvh2};
    /// use canted_obb::Affine;
    /// use canted_tlas::{Instance, Tlas, TopConfig};
    /// use canted_trace::{Ray, Watertight};
    ///
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let bvh = Bvh2::<Watertight>::build(&positions, &[[0, 1, 2]], &BuildConfig::default())?;
    /// let [x, y, z, _] = Affine::IDENTITY.columns;
    /// let at = |depth: f32| Instance::new(0, Affine { columns: [x, y, z, [0.0, 0.0, depth]] });
    /// let tlas = Tlas::new(vec![bvh], &[at(3.0), at(2.0)], TopConfig::default())?;
    /// let hit = tlas.closest_hit(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])).expect("the ray points at both instances");
    /// assert_eq!((hit.t, hit.instance.0, hit.primitive.0), (2.0, 1, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn closest_hit(&self, ray_world: &Ray) -> Option<Hit> {
        self.closest_hit_with(ray_world, &mut ())
    }

    /// Whether the ray hits anything: agrees with [`Tlas::closest_hit`].
    #[must_use]
    pub fn occluded(&self, ray_world: &Ray) -> bool {
        self.occluded_with(ray_world, &mut ())
    }

    /// Every hit with `t_min <= t <= t_max`: least `t` first, then lowest (instance, primitive). Replaces the contents of
    /// `hits`.
    pub fn all_hits(&self, ray_world: &Ray, hits: &mut Vec<Hit>) {
        self.all_hits_with(ray_world, &mut (), hits);
    }

    /// The hit of least `t` that `accepts` accepts; ties go to the lowest (instance, primitive).
    ///
    /// ```
    /// # use canted_bvh2::{BuildConfig, Bvh2};
    /// # use canted_obb::Affine;
    /// # use canted_tlas::{Instance, Tlas, TopConfig};
    /// # use canted_trace::{InstanceId, Ray, Watertight};
    /// # let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// # let bvh = Bvh2::<Watertight>::build(&positions, &[[0, 1, 2]], &BuildConfig::default())?;
    /// # let tlas = Tlas::new(vec![bvh], &[Instance::new(0, Affine::IDENTITY); 2], TopConfig::default())?;
    /// let ray = Ray::new([0.2, 0.2, -1.0], [0.0, 0.0, 1.0]);
    /// let hit = tlas.closest_hit_where(&ray, |_ray, hit| hit.instance != InstanceId(0));
    /// assert_eq!(hit.map(|hit| hit.instance), Some(InstanceId(1)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn closest_hit_where(&self, ray_world: &Ray, accepts: impl Fn(&Ray, &Hit) -> bool) -> Option<Hit> {
        self.closest_hit_with(ray_world, &mut HitFilter(|hit: &Hit| accepts(ray_world, hit)))
    }

    /// Whether `accepts` accepts any hit.
    #[must_use]
    pub fn occluded_where(&self, ray_world: &Ray, accepts: impl Fn(&Ray, &Hit) -> bool) -> bool {
        self.occluded_with(ray_world, &mut HitFilter(|hit: &Hit| accepts(ray_world, hit)))
    }

    /// Every hit that `accepts` accepts, in the order of [`Tlas::all_hits`]. Replaces the contents of `hits`.
    pub fn all_hits_where(&self, ray_world: &Ray, hits: &mut Vec<Hit>, accepts: impl Fn(&Ray, &Hit) -> bool) {
        self.all_hits_with(ray_world, &mut HitFilter(|hit: &Hit| accepts(ray_world, hit)), hits);
    }

    /// The hit of least `t` that the query accepts; ties go to the lowest (instance, primitive).
    ///
    /// ```
    /// # use canted_bvh2::{BuildConfig, Bvh2};
    /// # use canted_obb::Affine;
    /// # use canted_tlas::{Instance, RayOptions, Tlas, TopConfig};
    /// # use canted_trace::{Counts, InstanceId, Ray, Watertight};
    /// # let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// # let bvh = Bvh2::<Watertight>::build(&positions, &[[0, 1, 2]], &BuildConfig::default())?;
    /// // Two instances in the same position; only rays with bit 0 see the first.
    /// let instances = [1, 2].map(|mask| Instance::new(0, Affine::IDENTITY).with_mask(mask));
    /// let tlas = Tlas::new(vec![bvh], &instances, TopConfig::default())?;
    /// let ray = Ray::new([0.2, 0.2, -1.0], [0.0, 0.0, 1.0]);
    /// let hit = tlas.closest_hit_with(&ray, &mut RayOptions::mask(2));
    /// assert_eq!(hit.map(|hit| hit.instance), Some(InstanceId(1)));
    ///
    /// let mut counts = Counts::default();
    /// tlas.closest_hit_with(&ray, &mut counts);
    /// assert_eq!(counts.triangles, 2);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn closest_hit_with<Q: Query>(&self, ray_world: &Ray, query: &mut Q) -> Option<Hit> {
        self.closest_hit_on(&mut Stacks::default(), ray_world, query)
    }

    /// [`Tlas::closest_hit_with`] on the stacks of earlier rays.
    #[inline]
    pub(crate) fn closest_hit_on<Q: Query>(
        &self,
        stacks: &mut Stacks,
        ray_world: &Ray,
        query: &mut Q,
    ) -> Option<Hit> {
        let ray = WorldRay::new(ray_world)?;
        let Stacks { top, bottom } = stacks;
        let mask = query.mask();
        // With its scaled `t`, which is exact.
        let mut best: Option<(f64, Hit)> = None;
        self.top.traverse::<_, true>(&ray.top, query, top, |instance, t_max, query| {
            let placement = &self.placements[instance.0 as usize];
            if placement.mask & mask == 0 {
                return t_max;
            }
            let limit = best.map_or(ray.t_max, |(t, _)| t);
            let Some(object) = placement.ray_object(&ray, limit, query) else { return t_max };
            let blas = &self.blas[placement.blas as usize];
            let Some(hit) = blas.closest_hit_scaled(&object.ray, instance, &mut object.query(query), bottom) else {
                return t_max;
            };
            let t = object.world_t(hit.t);
            let order = |t: f64, hit: &Hit| (t, hit.instance, hit.primitive);
            if best.is_none_or(|(best_t, best)| order(t, &hit) < order(best_t, &best)) {
                best = Some((t, hit));
                return up(t);
            }
            t_max
        });
        best.map(|(t, hit)| Hit { t: ray.caller_t(t), ..hit })
    }

    /// Whether the query accepts any hit.
    pub fn occluded_with<Q: Query>(&self, ray_world: &Ray, query: &mut Q) -> bool {
        self.occluded_on(&mut Stacks::default(), ray_world, query)
    }

    /// [`Tlas::occluded_with`] on the stacks of earlier rays.
    #[inline]
    pub(crate) fn occluded_on<Q: Query>(&self, stacks: &mut Stacks, ray_world: &Ray, query: &mut Q) -> bool {
        let Some(ray) = WorldRay::new(ray_world) else { return false };
        let Stacks { top, bottom } = stacks;
        let mask = query.mask();
        let mut found = false;
        self.top.traverse::<_, false>(&ray.top, query, top, |instance, t_max, query| {
            let placement = &self.placements[instance.0 as usize];
            if placement.mask & mask == 0 {
                return t_max;
            }
            let Some(object) = placement.ray_object(&ray, ray.t_max, query) else { return t_max };
            let blas = &self.blas[placement.blas as usize];
            found = blas.occluded_scaled(&object.ray, instance, &mut object.query(query), bottom);
            if found { -1.0 } else { t_max }
        });
        found
    }

    /// Every hit that the query accepts, in the order of [`Tlas::all_hits`]. Replaces the contents of `hits`.
    pub fn all_hits_with<Q: Query>(&self, ray_world: &Ray, query: &mut Q, hits: &mut Vec<Hit>) {
        self.collect(ray_world, query, hits, |blas, object, instance, query, hits| {
            blas.all_hits_with(&object.ray.to_ray(), instance, &mut object.query(query), hits);
        });
    }

    /// What `trace` finds on each instance that the ray may hit, in the order of [`Tlas::all_hits`].
    fn collect<Q: Query>(
        &self,
        ray_world: &Ray,
        query: &mut Q,
        hits: &mut Vec<Hit>,
        trace: impl Fn(&B, &ObjectRay, InstanceId, &mut Q, &mut Vec<Hit>),
    ) {
        hits.clear();
        let Some(ray) = WorldRay::new(ray_world) else { return };
        let mask = query.mask();
        let (mut of_instance, mut with_t): (Vec<Hit>, Vec<(f64, Hit)>) = (vec![], vec![]);
        self.top.traverse::<_, false>(&ray.top, query, &mut Stack::new(), |instance, t_max, query| {
            let placement = &self.placements[instance.0 as usize];
            if placement.mask & mask != 0
                && let Some(object) = placement.ray_object(&ray, ray.t_max, query)
            {
                trace(&self.blas[placement.blas as usize], &object, instance, query, &mut of_instance);
                with_t.extend(of_instance.drain(..).map(|hit| (object.world_t(hit.t), hit)));
            }
            t_max
        });
        with_t.sort_unstable_by(in_order);
        hits.extend(with_t.into_iter().map(|(t, hit)| Hit { t: ray.caller_t(t), ..hit }));
    }
}

/// Crossings, for bottom-level BVHs that support them.
impl<B: CrossingBlas> Tlas<B> {
    /// Every crossing of a surface, once in each instance: least `t` first, then lowest (instance, primitive). Replaces
    /// the contents of `crossings`.
    ///
    /// A ray that starts and ends outside of a closed instance crosses it an even number of times, half of them inward.
    /// Instances are separate surfaces: where faces of two instances coincide, the ray crosses both. Where two open
    /// instances share an edge, each rounds its edge for itself, so a ray through this seam may cross one of them, both
    /// or neither; merge such meshes into one BVH instead.
    ///
    /// ```
    /// use canted_obb::Affine;
    /// use canted_tlas::{Instance, Tlas, TopConfig};
    /// use canted_trace::{Ray, Side};
    /// use canted_wide::{Config, TriangleBvh};
    ///
    /// // A square of two triangles; the ray passes through their shared edge.
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    /// let bvh: TriangleBvh = TriangleBvh::build(&positions, &[[0, 1, 2], [0, 2, 3]], &Config::default())?;
    /// let [x, y, z, _] = Affine::IDENTITY.columns;
    /// let at = |depth: f32| Instance::new(0, Affine { columns: [x, y, z, [0.0, 0.0, depth]] });
    /// let tlas = Tlas::new(vec![bvh], &[at(2.0), at(1.0)], TopConfig::default())?;
    /// let ray = Ray::new([0.5, 0.5, 0.0], [0.0, 0.0, 1.0]);
    /// let mut hits = vec![];
    /// tlas.all_hits(&ray, &mut hits);
    /// assert_eq!(hits.len(), 4);
    /// tlas.crossings(&ray, &mut hits);
    /// let found: Vec<_> = hits.iter().map(|hit| (hit.t, hit.instance.0, hit.side)).collect();
    /// assert_eq!(found, [(1.0, 1, Side::Back), (2.0, 0, Side::Back)]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn crossings(&self, ray_world: &Ray, crossings: &mut Vec<Hit>) {
        self.crossings_with(ray_world, &RayOptions::default(), crossings);
    }

    /// [`Tlas::crossings`] of the instances that a ray of this mask sees, at its time.
    pub fn crossings_with(&self, ray_world: &Ray, options: &RayOptions, crossings: &mut Vec<Hit>) {
        self.collect(ray_world, &mut { *options }, crossings, |blas, object, instance, _, crossings| {
            blas.crossings(&object.ray.to_ray(), instance, crossings);
        });
    }
}

/// The order of [`Tlas::all_hits`], of hits with their scaled `t`.
fn in_order((t_a, a): &(f64, Hit), (t_b, b): &(f64, Hit)) -> Ordering {
    // Adding zero makes -0.0 positive: the two zeros are one `t`.
    let by_t = (t_a + 0.0).total_cmp(&(t_b + 0.0));
    by_t.then((a.instance, a.primitive).cmp(&(b.instance, b.primitive)))
}
