use alloc::{boxed::Box, sync::Arc, vec::Vec};

use canted_obb::{Obb, PrimId};

use crate::stack::with_stack;
use crate::{Accept, Hit, HitLists, InstanceId, PlacedRay, Query, Ray, ScaledRay, Side, SurfacePoint};

/// Rays that a thread takes at a time.
const CHUNK: usize = 1024;

/// A function that accepts or rejects a hit, by the index of the ray in its slice, the ray and the hit alone. It may get a hit twice, and hits of
/// neighboring rays in turn.
pub type AcceptAt<'a> = dyn Fn(usize, &Ray, &Hit) -> bool + Sync + 'a;

/// Where the answers for a slice of rays go, one for each ray.
pub enum Answers<'a> {
    /// The closest hits.
    Closest(&'a mut [Option<Hit>]),
    /// Whether there is a hit.
    Occluded(&'a mut [bool]),
    /// All hits, each ray's in memory of its own.
    All(&'a mut [Vec<Hit>]),
    /// All hits, in one array; each ray appends its list.
    Lists(&'a mut HitLists),
}

/// Where the answer for one ray goes.
pub enum Answer<'a> {
    /// The closest hit; none so far.
    Closest(&'a mut Option<Hit>),
    /// Whether there is a hit; none so far.
    Occluded(&'a mut bool),
    /// All hits are appended.
    All(&'a mut Vec<Hit>),
}

impl Answers<'_> {
    /// Calls `fill` with where the answer for ray `i` goes. Rays come in order.
    #[inline(always)]
    pub fn fill(&mut self, i: usize, fill: impl FnOnce(Answer)) {
        match self {
            Self::Closest(hits) => {
                hits[i] = None;
                fill(Answer::Closest(&mut hits[i]));
            }
            Self::Occluded(occluded) => {
                occluded[i] = false;
                fill(Answer::Occluded(&mut occluded[i]));
            }
            Self::All(hits) => {
                hits[i].clear();
                fill(Answer::All(&mut hits[i]));
            }
            Self::Lists(lists) => lists.add_ray(|hits| fill(Answer::All(hits))),
        }
    }
}

/// Whatever rays can hit: a BVH, instances of BVHs, a shape.
///
/// An implementor answers three queries of one scaled ray; all other forms are provided. BVHs, `&B`, `Box<B>` and `Arc<B>` implement it,
/// and so does `dyn Intersect`: a TLAS may be over `Box<dyn Intersect>`, each of another kind.
///
/// [`Intersect::closest_hit`] returns the hit of least `t`; ties go to the lowest (instance, primitive). So it does not depend on the BVH. A ray with a NaN
/// component, an infinite origin or direction, a zero direction, an empty mask or an empty interval never hits.
///
/// # Forms
/// * Methods ending in `_with` take a [`Query`], which filters hits and counts tests: [`Accept`] wraps a function.
/// * Slices give the same answers as single rays, at a lower cost per ray. Their `_with` forms take a function that accepts a hit by the
///   index of the ray, the ray and the hit alone. Forms with `par_` use all threads of the current rayon pool, and one thread
///   without the feature `parallel`; answers are the same. All panic if the slices differ in length.
///
/// # Examples
/// ```
/// use canted_obb::{Aabb, Obb, PrimId};
/// use canted_trace::{Accept, HIT_ERROR, Hit, InstanceId, Intersect, Kernel, Query, Ray, ScaledRay, Watertight};
///
/// /// One triangle, without a BVH.
/// struct Single([[f32; 3]; 3]);
///
/// impl Intersect for Single {
///     fn bounds(&self) -> Obb {
///         Obb::from_aabb(&Aabb::from_points(self.0))
///     }
///     fn hit_error(&self) -> f32 {
///         HIT_ERROR
///     }
///     fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64]) -> Option<Hit> {
///         let found = Watertight::intersect(&Watertight::prepare(ray), ray, &Watertight::record(self.0), ray.t_max)?;
///         let (instance, primitive) = (InstanceId(0), PrimId(0));
///         let hit = Hit { t: ray.caller_t(found.t), u: found.u, v: found.v, side: found.side, instance, primitive };
///         query.accepts(&hit).then_some(hit)
///     }
///     fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
///         self.closest_hit_scaled(ray, query, stack).is_some()
///     }
///     fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
///         hits.extend(self.closest_hit_scaled(ray, query, stack));
///     }
/// }
///
/// let triangle = Single([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]);
/// let ray = Ray::new([2.0, 1.0, 3.0], [0.0, 0.0, -10.0]);
/// assert_eq!(triangle.closest_hit(&ray).map(|hit| hit.t), Some(0.3));
/// assert!(!triangle.occluded_with(&ray, &mut Accept(|hit: &Hit| hit.u > 0.5)));
/// ```
pub trait Intersect: Send + Sync {
    /// A box around everything, object space.
    fn bounds(&self) -> Obb;

    /// At least the product of `direction` with each point that can be hit, but for [`Intersect::hit_error`]; finite. `None` for every direction
    /// where nothing is known but [`Intersect::bounds`].
    ///
    /// Rotated instances in a TLAS have smaller boxes where it is known.
    fn support(&self, direction: [f64; 3]) -> Option<f64> {
        let _ = direction;
        None
    }

    /// How far a hit may lie outside of the bounds: each coordinate of `o + t·d`, in real arithmetic, by at most
    /// `hit_error·(|o|∞ + ρ∞)`, with `|o|∞` the greatest coordinate of the ray's origin and `ρ∞` that of the bounds.
    ///
    /// [`HIT_ERROR`](crate::HIT_ERROR) for triangles. A TLAS pads its boxes by it: if it is too small, hits are lost.
    fn hit_error(&self) -> f32;

    /// Whether the bound of [`Intersect::hit_error`] also holds relative to every point of object space, with distances from that point
    /// instead of coordinates. A TLAS then has smaller boxes for content that is far from the origin.
    fn has_local_error(&self) -> bool {
        false
    }

    /// Whether it is known that there is nothing to hit. Its instances in a TLAS then have no bounds.
    fn is_empty(&self) -> bool {
        false
    }

    /// Number of stack entries that a traversal needs.
    fn stack_len(&self) -> usize {
        0
    }

    /// The hit of least `t` that the query accepts, as instance 0; ties go to the lowest primitive.
    ///
    /// `t` of the hit and of those that the query sees is the caller's: [`ScaledRay::caller_t`]. `stack` has at least
    /// [`Intersect::stack_len`] entries of any content.
    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> Option<Hit>;

    /// Whether the query accepts any hit: agrees with [`Intersect::closest_hit_scaled`].
    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> bool;

    /// Appends every hit that the query accepts, each once: least `t` first, then lowest (instance, primitive). The query may see a
    /// hit twice.
    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>);

    /// The closest hit of an instance, with its scaled world `t`. Replaced where the ray is better mapped with the instructions of a path.
    #[doc(hidden)]
    fn closest_hit_placed(
        &self,
        ray: &PlacedRay,
        instance: InstanceId,
        query: &mut dyn Query,
        stack: &mut [u64],
    ) -> Option<(f64, Hit)> {
        ray.object()?.closest_hit(query, instance, |ray, query| self.closest_hit_scaled(ray, query, stack))
    }

    /// Whether an instance is hit; agrees with `closest_hit_placed`.
    #[doc(hidden)]
    fn occluded_placed(&self, ray: &PlacedRay, instance: InstanceId, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        ray.object().is_some_and(|object| {
            object.occluded(query, instance, |ray, query| self.occluded_scaled(ray, query, stack))
        })
    }

    /// Answers the rays of a slice, of which the first has the index `first`; without `accept`, every hit is accepted.
    ///
    /// Provided: one ray after another. A BVH that prepares several rays at once replaces it.
    fn answer(&self, rays: &[Ray], first: usize, accept: Option<&AcceptAt>, answers: Answers) {
        answer_one_by_one(self, rays, first, accept, answers);
    }

    /// The hit of least `t`; ties go to the lowest (instance, primitive).
    #[doc(alias = "intersect")]
    #[doc(alias = "first_hit")]
    #[inline]
    #[must_use]
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let ray = ScaledRay::new(ray)?;
        with_stack(self.stack_len(), |stack| self.closest_hit_scaled(&ray, &mut (), stack))
    }

    /// Whether the ray hits anything: agrees with [`Intersect::closest_hit`].
    #[doc(alias = "any_hit")]
    #[inline]
    #[must_use]
    fn occluded(&self, ray: &Ray) -> bool {
        self.occluded_with(ray, &mut ())
    }

    /// Every hit with `t_min <= t <= t_max`, each once: least `t` first, then lowest (instance, primitive). Replaces the content of
    /// `hits`.
    ///
    /// All triangles around an edge or a vertex that the ray passes through appear; `crossings` counts surfaces instead.
    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>) {
        self.all_hits_with(ray, &mut (), hits);
    }

    /// The hit of least `t` that the query accepts; ties go to the lowest (instance, primitive).
    #[inline]
    fn closest_hit_with(&self, ray: &Ray, query: &mut dyn Query) -> Option<Hit> {
        let ray = ScaledRay::new(ray)?;
        with_stack(self.stack_len(), |stack| self.closest_hit_scaled(&ray, query, stack))
    }

    /// Whether the query accepts any hit.
    #[inline]
    fn occluded_with(&self, ray: &Ray, query: &mut dyn Query) -> bool {
        let Some(ray) = ScaledRay::new(ray) else { return false };
        with_stack(self.stack_len(), |stack| self.occluded_scaled(&ray, query, stack))
    }

    /// Every hit that the query accepts, in the order of [`Intersect::all_hits`]. Replaces the content of `hits`.
    fn all_hits_with(&self, ray: &Ray, query: &mut dyn Query, hits: &mut Vec<Hit>) {
        hits.clear();
        if let Some(ray) = ScaledRay::new(ray) {
            with_stack(self.stack_len(), |stack| self.all_hits_scaled(&ray, query, stack, hits));
        }
    }

    /// The closest hit of each ray. Put rays that are alike one after another, as those of neighboring pixels: BVHs over triangles without oriented
    /// nodes may walk with 16 of them at once.
    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        check(rays, hits);
        self.answer(rays, 0, None, Answers::Closest(hits));
    }

    /// The closest hit of each ray, on all threads.
    fn par_closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        parallel(rays, hits, &|first, rays, hits| self.answer(rays, first, None, Answers::Closest(hits)));
    }

    /// The closest hit of each ray that `accept` accepts.
    fn closest_hits_with(&self, rays: &[Ray], hits: &mut [Option<Hit>], accept: &AcceptAt) {
        check(rays, hits);
        self.answer(rays, 0, Some(accept), Answers::Closest(hits));
    }

    /// As [`Intersect::closest_hits_with`], on all threads.
    fn par_closest_hits_with(&self, rays: &[Ray], hits: &mut [Option<Hit>], accept: &AcceptAt) {
        parallel(rays, hits, &|first, rays, hits| self.answer(rays, first, Some(accept), Answers::Closest(hits)));
    }

    /// Whether each ray hits anything.
    fn occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        check(rays, occluded);
        self.answer(rays, 0, None, Answers::Occluded(occluded));
    }

    /// Whether each ray hits anything, on all threads.
    fn par_occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        parallel(rays, occluded, &|first, rays, out| self.answer(rays, first, None, Answers::Occluded(out)));
    }

    /// Whether `accept` accepts any hit of each ray.
    fn occluded_many_with(&self, rays: &[Ray], occluded: &mut [bool], accept: &AcceptAt) {
        check(rays, occluded);
        self.answer(rays, 0, Some(accept), Answers::Occluded(occluded));
    }

    /// As [`Intersect::occluded_many_with`], on all threads.
    fn par_occluded_many_with(&self, rays: &[Ray], occluded: &mut [bool], accept: &AcceptAt) {
        parallel(rays, occluded, &|first, rays, out| self.answer(rays, first, Some(accept), Answers::Occluded(out)));
    }

    /// Every hit of each ray, in the order of [`Intersect::all_hits`].
    fn all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        check(rays, hits);
        self.answer(rays, 0, None, Answers::All(hits));
    }

    /// Every hit of each ray, on all threads.
    fn par_all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        parallel(rays, hits, &|first, rays, hits| self.answer(rays, first, None, Answers::All(hits)));
    }

    /// Every hit of each ray that `accept` accepts.
    fn all_hits_many_with(&self, rays: &[Ray], hits: &mut [Vec<Hit>], accept: &AcceptAt) {
        check(rays, hits);
        self.answer(rays, 0, Some(accept), Answers::All(hits));
    }

    /// As [`Intersect::all_hits_many_with`], on all threads.
    fn par_all_hits_many_with(&self, rays: &[Ray], hits: &mut [Vec<Hit>], accept: &AcceptAt) {
        parallel(rays, hits, &|first, rays, hits| self.answer(rays, first, Some(accept), Answers::All(hits)));
    }

    /// Every hit of each ray, in the order of [`Intersect::all_hits`], in one array. Replaces the content of `lists`.
    fn all_hits_listed(&self, rays: &[Ray], lists: &mut HitLists) {
        lists.clear(rays.len());
        self.answer(rays, 0, None, Answers::Lists(lists));
    }
}

/// What [`Intersect::answer`] does where it is not replaced.
#[doc(hidden)]
pub fn answer_one_by_one<B: Intersect + ?Sized>(
    bvh: &B,
    rays: &[Ray],
    first: usize,
    accept: Option<&AcceptAt>,
    mut answers: Answers,
) {
    with_stack(bvh.stack_len(), |stack| {
        for (i, ray) in rays.iter().enumerate() {
            answers.fill(i, |answer| {
                let Some(scaled) = ScaledRay::new(ray) else { return };
                let mut filter;
                let query: &mut dyn Query = match accept {
                    None => &mut (),
                    Some(accept) => {
                        filter = Accept(|hit: &Hit| accept(first + i, ray, hit));
                        &mut filter
                    }
                };
                match answer {
                    Answer::Closest(hit) => *hit = bvh.closest_hit_scaled(&scaled, query, stack),
                    Answer::Occluded(occluded) => *occluded = bvh.occluded_scaled(&scaled, query, stack),
                    Answer::All(hits) => bvh.all_hits_scaled(&scaled, query, stack, hits),
                }
            });
        }
    });
}

fn check<T>(rays: &[Ray], answers: &[T]) {
    assert_eq!(rays.len(), answers.len(), "one answer for each ray");
}

/// Answers consecutive rays, of which the first has the index given.
type AnswerSome<'a, T> = dyn Fn(usize, &[Ray], &mut [T]) + Sync + 'a;

/// Calls `answer` with consecutive rays, the index of the first, and their answers.
fn parallel<T: Send>(rays: &[Ray], answers: &mut [T], answer: &AnswerSome<T>) {
    check(rays, answers);
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        let chunks = rays.par_chunks(CHUNK).zip(answers.par_chunks_mut(CHUNK)).enumerate();
        chunks.for_each(|(i, (rays, answers))| answer(i * CHUNK, rays, answers));
    }
    #[cfg(not(feature = "parallel"))]
    for (i, (rays, answers)) in rays.chunks(CHUNK).zip(answers.chunks_mut(CHUNK)).enumerate() {
        answer(i * CHUNK, rays, answers);
    }
}

/// What counts how often rays cross its surfaces: BVHs over triangles, and instances of them.
///
/// A ray through an edge or a vertex hits all triangles around it. Of these, those are crossings that the ray would hit if it were moved by
/// an infinitesimal step that depends on its direction alone. So a ray that starts and ends outside a closed mesh crosses it an
/// even number of times, half of them inward, and equal copies of a surface count as many times.
///
/// Hits are those of the watertight test.
pub trait Crossings: Intersect {
    /// Appends every crossing with `t_min <= t <= t_max`, once, in the order of [`Crossings::crossings`].
    fn crossings_scaled(&self, ray: &ScaledRay, stack: &mut [u64], crossings: &mut Vec<Hit>);

    /// Every crossing of a surface with `t_min <= t <= t_max`, once: least `t` first. Replaces the content of `crossings`.
    ///
    /// Of equal `t`, crossings inward and outward take turns, so that a ray that only touches an edge enters before it leaves; else the
    /// lowest (instance, primitive) comes first.
    ///
    /// The crossings are the hits of [`Intersect::all_hits`] except for those exactly on an edge or a vertex. These are reported as the
    /// lowest primitives that are hit there from the same side. Where a ray touches a silhouette without crossing, nothing is reported. The
    /// border of an open surface belongs to it or not, such that of two adjacent surfaces one is crossed. Triangles share a vertex if its
    /// coordinates are equal; its index does not matter.
    fn crossings(&self, ray: &Ray, crossings: &mut Vec<Hit>) {
        crossings.clear();
        if let Some(ray) = ScaledRay::new(ray) {
            with_stack(self.stack_len(), |stack| self.crossings_scaled(&ray, stack, crossings));
        }
    }

    /// Every crossing of each ray, as [`Crossings::crossings`] returns them, in one array. Replaces the content of `lists`.
    fn crossings_listed(&self, rays: &[Ray], lists: &mut HitLists) {
        lists.clear(rays.len());
        with_stack(self.stack_len(), |stack| {
            for ray in rays {
                lists.add_ray(|crossings| {
                    if let Some(ray) = ScaledRay::new(ray) {
                        self.crossings_scaled(&ray, stack, crossings);
                    }
                });
            }
        });
    }
}

/// Reorders crossings of equal `t` so that ways in and ways out take turns, after the crossing before them; `crossings` are those of one ray,
/// in the order of hits.
///
/// A ray that leaves more often than it enters starts inside, so its first crossing is a way out.
pub fn alternate_sides(crossings: &mut [Hit]) {
    if !crossings.windows(2).any(|pair| pair[0].t == pair[1].t && pair[0].side != pair[1].side) {
        return;
    }
    let n_in = crossings.iter().filter(|hit| hit.side == Side::Front).count();
    let mut is_inside = 2 * n_in < crossings.len();
    for group in crossings.chunk_by_mut(|a, b| a.t == b.t) {
        let (mut ways_in, mut ways_out): (Vec<Hit>, Vec<Hit>) =
            group.iter().rev().partition(|hit| hit.side == Side::Front);
        for place in group {
            let (next, other) = if is_inside { (&mut ways_out, &mut ways_in) } else { (&mut ways_in, &mut ways_out) };
            if let Some(hit) = next.pop().or_else(|| other.pop()) {
                *place = hit;
                is_inside = hit.side == Side::Front;
            }
        }
    }
}

/// Triangles that a hit can be looked up in.
pub trait Triangles: Intersect {
    /// The vertices of a triangle, in the order of the caller.
    ///
    /// # Panics
    /// If there is no such triangle.
    fn triangle(&self, id: PrimId) -> [[f32; 3]; 3];

    /// The point of a hit of [`Intersect::closest_hit`]: its position, its normal, and rays that continue from it.
    fn surface_point(&self, hit: &Hit) -> SurfacePoint {
        SurfacePoint::new(hit, self.triangle(hit.primitive), self.bounds().aabb().reach())
    }
}

/// a pointer forwards every query.
impl<B: Intersect + ?Sized, P: core::ops::Deref<Target = B> + Send + Sync> Intersect for P
where
    P: Pointer,
{
    fn bounds(&self) -> Obb {
        (**self).bounds()
    }

    fn support(&self, direction: [f64; 3]) -> Option<f64> {
        (**self).support(direction)
    }

    fn hit_error(&self) -> f32 {
        (**self).hit_error()
    }

    fn has_local_error(&self) -> bool {
        (**self).has_local_error()
    }

    fn is_empty(&self) -> bool {
        (**self).is_empty()
    }

    fn stack_len(&self) -> usize {
        (**self).stack_len()
    }

    #[inline]
    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> Option<Hit> {
        (**self).closest_hit_scaled(ray, query, stack)
    }

    #[inline]
    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        (**self).occluded_scaled(ray, query, stack)
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        (**self).all_hits_scaled(ray, query, stack, hits);
    }

    #[inline]
    fn closest_hit_placed(
        &self,
        ray: &PlacedRay,
        instance: InstanceId,
        query: &mut dyn Query,
        stack: &mut [u64],
    ) -> Option<(f64, Hit)> {
        (**self).closest_hit_placed(ray, instance, query, stack)
    }

    #[inline]
    fn occluded_placed(&self, ray: &PlacedRay, instance: InstanceId, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        (**self).occluded_placed(ray, instance, query, stack)
    }

    fn answer(&self, rays: &[Ray], first: usize, accept: Option<&AcceptAt>, answers: Answers) {
        (**self).answer(rays, first, accept, answers);
    }
}

impl<B: Crossings + ?Sized, P: core::ops::Deref<Target = B> + Send + Sync> Crossings for P
where
    P: Pointer,
{
    fn crossings_scaled(&self, ray: &ScaledRay, stack: &mut [u64], crossings: &mut Vec<Hit>) {
        (**self).crossings_scaled(ray, stack, crossings);
    }

    fn crossings_listed(&self, rays: &[Ray], lists: &mut HitLists) {
        (**self).crossings_listed(rays, lists);
    }
}

impl<B: Triangles + ?Sized, P: core::ops::Deref<Target = B> + Send + Sync> Triangles for P
where
    P: Pointer,
{
    fn triangle(&self, id: PrimId) -> [[f32; 3]; 3] {
        (**self).triangle(id)
    }

    fn surface_point(&self, hit: &Hit) -> SurfacePoint {
        (**self).surface_point(hit)
    }
}

/// `&B`, `Box<B>` and `Arc<B>`, which answer as what they point to.
#[doc(hidden)]
pub trait Pointer {}

impl<B: ?Sized> Pointer for &B {}
impl<B: ?Sized> Pointer for Box<B> {}
impl<B: ?Sized> Pointer for Arc<B> {}
