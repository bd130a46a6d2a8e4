use canted_obb::Obb;
use canted_obb::round::up;
use canted_trace::{
    AcceptAt, Answers, Crossings, Hit, InstanceId, Intersect, ObjectRay, PlacedRay, Query, Ray, ScaledRay,
    SurfacePoint, Triangles, WorldRay, alternate_sides, answer_one_by_one,
};
use canted_wide::Order;

use crate::placement::Placement;
use crate::top::Entered;
use crate::{Motion, Tlas};

/// Appends what a ray finds on one instance.
type TraceInstance<'a, B> = dyn FnMut(&B, &ObjectRay, InstanceId, &mut [u64], &mut Vec<Hit>) + 'a;

/// Visits an instance that a ray may hit.
type VisitInstance<'a, B> = dyn FnMut(&B, &ObjectRay, InstanceId, &mut [u64]) + 'a;

/// Queries, of rays in world space. A hit has the number of its instance, and so have the hits that a query sees.
///
/// ```
/// use canted_obb::Affine;
/// use canted_tlas::{Instance, Tlas};
/// use canted_trace::{Accept, Counts, Hit, InstanceId, Intersect, Ray};
/// use canted_wide::TriangleBvh;
///
/// let bvh = TriangleBvh::build(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?;
/// // Two instances in the same position; only rays with bit 0 see the first.
/// let instances = [1, 2].map(|mask| Instance::new(0, Affine::IDENTITY).with_mask(mask));
/// let tlas = Tlas::new(vec![bvh], &instances, Default::default())?;
/// let ray = Ray::new([0.2, 0.2, -1.0], [0.0, 0.0, 1.0]);
/// assert_eq!(tlas.closest_hit(&ray).map(|hit| hit.instance), Some(InstanceId(0)));
/// assert_eq!(tlas.closest_hit(&ray.with_mask(2)).map(|hit| hit.instance), Some(InstanceId(1)));
/// let second = tlas.closest_hit_with(&ray, &mut Accept(|hit: &Hit| hit.instance != InstanceId(0)));
/// assert_eq!(second.map(|hit| hit.instance), Some(InstanceId(1)));
///
/// let mut counts = Counts::default();
/// tlas.closest_hit_with(&ray, &mut counts);
/// assert_eq!(counts.triangles, 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl<B: Intersect> Intersect for Tlas<B> {
    /// Contains all instances and what of the error of their hits does not depend on rays.
    fn bounds(&self) -> Obb {
        self.top.bounds()
    }

    /// The greatest of the instances, each with the condition of its transform.
    fn hit_error(&self) -> f32 {
        self.top.hit_error()
    }

    fn is_empty(&self) -> bool {
        self.top.aabb().is_empty()
    }

    fn stack_len(&self) -> usize {
        self.top.stack_len() + self.bottom_stack_len
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> Option<Hit> {
        let ray = WorldRay::new(ray);
        self.closest(&ray, query, stack.split_at_mut(self.top.stack_len()), (&self.top, &ray))
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        let ray = WorldRay::new(ray);
        self.any(&ray, query, stack.split_at_mut(self.top.stack_len()), (&self.top, &ray))
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        let n_boxes = self.collect(ray, stack, hits, &mut |blas, object, instance, stack, hits| {
            object.ask(query, instance, |query| blas.all_hits_scaled(&object.ray, query, stack, hits));
        });
        query.boxes(n_boxes);
    }

    fn answer(&self, rays: &[Ray], first: usize, accept: Option<&AcceptAt>, answers: Answers) {
        match (answers, accept) {
            (Answers::Closest(hits), None) => self.closest_of_slice(rays, hits),
            (Answers::Occluded(occluded), None) => self.occluded_of_slice(rays, occluded),
            (answers, accept) => answer_one_by_one(self, rays, first, accept, answers),
        }
    }
}

/// Crossings, once in each instance.
///
/// Instances are separate surfaces: where faces of two instances coincide, the ray crosses both. Where two open
/// instances share an edge, each rounds its edge for itself, so a ray through this seam may cross one of them, both
/// or neither; merge such meshes into one BVH instead.
///
/// ```
/// use canted_obb::Affine;
/// use canted_tlas::{Instance, Tlas};
/// use canted_trace::{Crossings, Intersect, Ray, Side};
/// use canted_wide::TriangleBvh;
///
/// // A square of two triangles; the ray passes through their shared edge.
/// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
/// let bvh = TriangleBvh::build(&positions, &[[0, 1, 2], [0, 2, 3]])?;
/// let at = |depth: f32| Instance::new(0, Affine::translation([0.0, 0.0, depth]));
/// let tlas = Tlas::new(vec![bvh], &[at(2.0), at(1.0)], Default::default())?;
/// let ray = Ray::new([0.5, 0.5, 0.0], [0.0, 0.0, 1.0]);
/// let mut hits = vec![];
/// tlas.all_hits(&ray, &mut hits);
/// assert_eq!(hits.len(), 4);
/// tlas.crossings(&ray, &mut hits);
/// let found: Vec<_> = hits.iter().map(|hit| (hit.t, hit.instance.0, hit.side)).collect();
/// assert_eq!(found, [(1.0, 1, Side::Back), (2.0, 0, Side::Back)]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl<B: Crossings> Crossings for Tlas<B> {
    fn crossings_scaled(&self, ray: &ScaledRay, stack: &mut [u64], crossings: &mut Vec<Hit>) {
        let first = crossings.len();
        self.collect(ray, stack, crossings, &mut |blas, object, _, stack, crossings| {
            blas.crossings_scaled(&object.ray, stack, crossings);
        });
        alternate_sides(&mut crossings[first..]);
    }
}

impl<B: Triangles> Tlas<B> {
    /// The point of a hit in world space: its position, its normal, and rays that continue from it. Of a moving instance, as the shutter
    /// opens.
    ///
    /// ```
    /// use canted_obb::Affine;
    /// use canted_tlas::{Instance, Tlas};
    /// use canted_trace::{Intersect, Ray};
    /// use canted_wide::TriangleBvh;
    ///
    /// let bvh = TriangleBvh::build(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?;
    /// let tlas = Tlas::new(vec![bvh], &[Instance::new(0, Affine::translation([0.0, 0.0, 5.0]))], Default::default())?;
    /// let hit = tlas.closest_hit(&Ray::new([0.25, 0.25, 9.0], [0.0, 0.0, -1.0])).expect("the ray points at the triangle");
    /// let point = tlas.surface_point(&hit);
    /// assert_eq!((point.position, point.normal), ([0.25, 0.25, 5.0], [0.0, 0.0, 1.0]));
    /// assert!(!tlas.occluded(&point.spawn_ray([0.1, 0.1, -1.0])));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Panics
    /// If there is no such instance or triangle.
    #[must_use]
    pub fn surface_point(&self, hit: &Hit) -> SurfacePoint {
        self.surface_point_at(hit, 0.0)
    }

    /// [`Tlas::surface_point`] at the time of the ray that hit.
    ///
    /// # Panics
    /// If there is no such instance or triangle.
    #[must_use]
    pub fn surface_point_at(&self, hit: &Hit, time: f32) -> SurfacePoint {
        let instance = self.instance(hit.instance).expect("a hit of this TLAS");
        let blas = &self.blas[instance.blas as usize];
        let (vertices, reach) = (blas.triangle(hit.primitive), blas.bounds().aabb().reach());
        let open = &instance.world_from_object;
        match &instance.world_from_object_close {
            None => SurfacePoint::in_instance(hit, vertices, reach, open),
            Some(close) => {
                let columns = Motion::new(open, close).world_from_object(time);
                SurfacePoint::under_map(hit, vertices, &columns, open.reach(reach).max(close.reach(reach)))
            }
        }
    }
}

impl<B: Intersect> Tlas<B> {
    /// The closest hit of a ray, with memory for the top level and for those below.
    #[inline(always)]
    pub(crate) fn closest(
        &self,
        ray: &WorldRay,
        query: &mut dyn Query,
        (top, bottom): (&mut [u64], &mut [u64]),
        entered: impl Entered,
    ) -> Option<Hit> {
        // With its scaled `t`, which is exact.
        let mut best: Option<(f64, Hit)> = None;
        let n_boxes = entered.each(Order::Nearest, top, |instance, t_max| {
            let mut made = None;
            let Some((blas, placement)) = self.seen(instance, ray, &mut made) else { return t_max };
            let limit = best.map_or(ray.t_max, |(t, _)| t);
            let found = match self.motion(instance) {
                None => {
                    let ray = PlacedRay { world: ray, map: &placement.map, t_max: limit };
                    blas.closest_hit_placed(&ray, instance, query, bottom)
                }
                Some(motion) => motion.ray_object(ray, limit).and_then(|object| {
                    object.closest_hit(query, instance, |ray, query| blas.closest_hit_scaled(ray, query, bottom))
                }),
            };
            let Some((t, hit)) = found else { return t_max };
            let order = |hit: &Hit| (hit.instance, hit.primitive);
            if best.is_none_or(|(best_t, best)| t < best_t || t == best_t && order(&hit) < order(&best)) {
                best = Some((t, hit));
                return up(t);
            }
            t_max
        });
        query.boxes(n_boxes);
        best.map(|(t, hit)| Hit { t: ray.caller_t(t), ..hit })
    }

    /// Whether a ray hits anything; see [`Tlas::closest`].
    #[inline(always)]
    pub(crate) fn any(
        &self,
        ray: &WorldRay,
        query: &mut dyn Query,
        (top, bottom): (&mut [u64], &mut [u64]),
        entered: impl Entered,
    ) -> bool {
        let mut found = false;
        let n_boxes = entered.each(Order::Any, top, |instance, t_max| {
            let mut made = None;
            let Some((blas, placement)) = self.seen(instance, ray, &mut made) else { return t_max };
            found = match self.motion(instance) {
                None => {
                    let ray = PlacedRay { world: ray, map: &placement.map, t_max: ray.t_max };
                    blas.occluded_placed(&ray, instance, query, bottom)
                }
                Some(motion) => motion.ray_object(ray, ray.t_max).is_some_and(|object| {
                    object.occluded(query, instance, |ray, query| blas.occluded_scaled(ray, query, bottom))
                }),
            };
            if found { -1.0 } else { t_max }
        });
        query.boxes(n_boxes);
        found
    }

    /// The BVH of an instance and its placement, which `made` holds where it is not stored; `None` if the ray does not see it.
    #[inline(always)]
    fn seen<'a>(
        &'a self,
        instance: InstanceId,
        ray: &WorldRay,
        made: &'a mut Option<Placement>,
    ) -> Option<(&'a B, &'a Placement)> {
        let placement = self.placements.of(instance.index(), made);
        if placement.mask & ray.ray.mask == 0 || placement.map.is_hidden() {
            return None;
        }
        Some((&self.blas[placement.blas as usize], placement))
    }

    /// The motion of an instance that moves.
    #[inline(always)]
    fn motion(&self, instance: InstanceId) -> Option<&Motion> {
        self.moving(instance.index()).and_then(|moving| moving.motion.as_ref())
    }

    /// The BVH of an instance, and the ray in its object space; `None` if the ray does not see it.
    fn enter(&self, instance: InstanceId, ray: &WorldRay) -> Option<(&B, ObjectRay)> {
        let mut made = None;
        let (_, placement) = self.seen(instance, ray, &mut made)?;
        let blas = &self.blas[placement.blas as usize];
        let object = match self.motion(instance) {
            None => PlacedRay { world: ray, map: &placement.map, t_max: ray.t_max }.object(),
            Some(motion) => motion.ray_object(ray, ray.t_max),
        };
        Some((blas, object?))
    }

    /// Appends what `trace` finds on each instance that the ray may hit, in order. Returns the number of box tests.
    fn collect(&self, ray: &ScaledRay, stack: &mut [u64], hits: &mut Vec<Hit>, trace: &mut TraceInstance<B>) -> u32 {
        let (mut of_instance, mut with_t): (Vec<Hit>, Vec<(f64, Hit)>) = (vec![], vec![]);
        let n_boxes = self.each_entered(ray, stack, &mut |blas, object, instance, stack| {
            trace(blas, object, instance, stack, &mut of_instance);
            with_t.extend(of_instance.drain(..).map(|hit| (object.world_t(hit.t), Hit { instance, ..hit })));
        });
        in_world_order(ray, with_t, hits);
        n_boxes
    }

    /// Calls `visit` with the BVH of each instance that a ray may hit, the ray in its object space, and memory for its traversal. Returns the number of
    /// box tests.
    #[doc(hidden)]
    pub fn each_entered(&self, ray: &ScaledRay, stack: &mut [u64], visit: &mut VisitInstance<B>) -> u32 {
        let ray = WorldRay::new(ray);
        let (top, bottom) = stack.split_at_mut(self.top.stack_len());
        self.top.traverse(&ray, Order::Any, top, |instance, t_max| {
            if let Some((blas, object)) = self.enter(instance, &ray) {
                visit(blas, &object, instance, bottom);
            }
            t_max
        })
    }
}

/// Appends hits of instances in order; each comes with its scaled `t` in world space.
#[doc(hidden)]
pub fn in_world_order(ray: &ScaledRay, mut found: Vec<(f64, Hit)>, hits: &mut Vec<Hit>) {
    found.sort_unstable_by(|(t_a, a), (t_b, b)| {
        // Adding zero makes -0.0 positive: the two zeros are one `t`.
        let by_t = (t_a + 0.0).total_cmp(&(t_b + 0.0));
        by_t.then((a.instance, a.primitive).cmp(&(b.instance, b.primitive)))
    });
    let ray = WorldRay::new(ray);
    hits.extend(found.into_iter().map(|(t, hit)| Hit { t: ray.caller_t(t), ..hit }));
}
