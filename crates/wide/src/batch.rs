//! Queries, ray by ray or slice by slice.

use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay};

use crate::bvh::WideBvh;
use crate::leaf::LeafPrimitive;
use crate::par;
use crate::simd::{Simd, Task};
use crate::sink::{AllHits, AnyHit, BestHit, FilterQuery, sort_from, to_caller};
use crate::trace::{prepare, trace};
use crate::traverse::{EightRays, Pads, Stack, TracedRay};

/// Rays of one job: few enough to balance threads, enough that choosing the instructions costs nothing.
const CHUNK: usize = 1024;

/// Traces rays through a BVH with the instructions of `S`, on one stack.
pub(crate) struct Tracer<'a, S: Simd, P: LeafPrimitive> {
    pub(crate) simd: S,
    pub(crate) bvh: &'a WideBvh<P>,
    pub(crate) stack: &'a mut Stack,
}

impl<'a, S: Simd, P: LeafPrimitive> Tracer<'a, S, P> {
    #[inline(always)]
    pub(crate) fn new(simd: S, bvh: &'a WideBvh<P>, stack: &'a mut Stack) -> Self {
        Self { simd, bvh, stack }
    }

    #[inline(always)]
    fn prepare(&self, ray: &ScaledRay) -> TracedRay {
        prepare(self.bvh, *ray)
    }

    /// The closest hit that the query accepts.
    #[inline(always)]
    fn closest_hit<Q: Query>(&mut self, ray: &TracedRay, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        let mut best = BestHit::new(query, instance);
        trace(self.simd, self.bvh, ray, self.stack, &mut best);
        best.hit(&ray.scaled)
    }

    /// Whether the query accepts any hit.
    #[inline(always)]
    fn occluded<Q: Query>(&mut self, ray: &TracedRay, instance: InstanceId, query: &mut Q) -> bool {
        let mut any = AnyHit::new(query, instance);
        trace(self.simd, self.bvh, ray, self.stack, &mut any);
        any.found
    }

    /// Appends every hit that the query accepts.
    #[inline(always)]
    pub(crate) fn all_hits<Q: Query>(
        &mut self,
        ray: &TracedRay,
        instance: InstanceId,
        query: &mut Q,
        hits: &mut Vec<Hit>,
    ) {
        let first = hits.len();
        trace(self.simd, self.bvh, ray, self.stack, &mut AllHits { query, instance, hits: &mut *hits });
        sort_from(hits, first);
        to_caller(&ray.scaled, &mut hits[first..]);
    }
}

/// The closest hit of one ray with a query that may count.
pub(crate) struct ClosestOfOne<'a, P: LeafPrimitive, Q> {
    pub(crate) bvh: &'a WideBvh<P>,
    pub(crate) stack: &'a mut Stack,
    pub(crate) ray: &'a ScaledRay,
    pub(crate) instance: InstanceId,
    pub(crate) query: &'a mut Q,
}

impl<P: LeafPrimitive, Q: Query> Task for ClosestOfOne<'_, P, Q> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Option<Hit> {
        let mut tracer = Tracer::new(simd, self.bvh, self.stack);
        tracer.closest_hit(&tracer.prepare(self.ray), self.instance, self.query)
    }
}

/// Whether one ray is occluded, with a query that may count.
pub(crate) struct OccludedOne<'a, P: LeafPrimitive, Q> {
    pub(crate) bvh: &'a WideBvh<P>,
    pub(crate) stack: &'a mut Stack,
    pub(crate) ray: &'a ScaledRay,
    pub(crate) instance: InstanceId,
    pub(crate) query: &'a mut Q,
}

impl<P: LeafPrimitive, Q: Query> Task for OccludedOne<'_, P, Q> {
    type Output = bool;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> bool {
        let mut tracer = Tracer::new(simd, self.bvh, self.stack);
        tracer.occluded(&tracer.prepare(self.ray), self.instance, self.query)
    }
}

/// All hits of one ray with a query that may count.
pub(crate) struct AllOfOne<'a, P: LeafPrimitive, Q> {
    pub(crate) bvh: &'a WideBvh<P>,
    pub(crate) ray: &'a ScaledRay,
    pub(crate) instance: InstanceId,
    pub(crate) query: &'a mut Q,
    pub(crate) hits: &'a mut Vec<Hit>,
}

impl<P: LeafPrimitive, Q: Query> Task for AllOfOne<'_, P, Q> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let mut stack = Stack::new();
        let mut tracer = Tracer::new(simd, self.bvh, &mut stack);
        tracer.all_hits(&tracer.prepare(self.ray), self.instance, self.query, self.hits);
    }
}

/// A query about each ray of a slice.
pub(crate) trait BatchQuery<P: LeafPrimitive>: Sync {
    /// The answer for one ray.
    type Answer: Send;

    /// Overwrites `answer` with that of a ray that cannot hit.
    fn miss(answer: &mut Self::Answer);

    /// Overwrites `answer` with that of the ray of this index.
    fn run<S: Simd>(
        &self,
        tracer: &mut Tracer<S, P>,
        index: usize,
        ray: &Ray,
        traced: &TracedRay,
        answer: &mut Self::Answer,
    );
}

/// The query with which a function accepts the hits of a ray.
pub(crate) trait Accepts: Sync {
    type Query<'a>: Query
    where
        Self: 'a;

    fn query<'a>(&'a self, index: usize, ray: &'a Ray) -> Self::Query<'a>;
}

/// Accepts every hit.
pub(crate) struct Everything;

impl Accepts for Everything {
    type Query<'a> = ();

    #[inline(always)]
    fn query(&self, _: usize, _: &Ray) {}
}

impl<F: Fn(usize, &Ray, &Hit) -> bool + Sync> Accepts for F {
    type Query<'a>
        = FilterQuery<'a, F>
    where
        F: 'a;

    #[inline(always)]
    fn query<'a>(&'a self, index: usize, ray: &'a Ray) -> FilterQuery<'a, F> {
        FilterQuery { accepts: self, index, ray }
    }
}

/// The closest hit that is accepted.
pub(crate) struct Closest<A>(pub(crate) A);

impl<P: LeafPrimitive, A: Accepts> BatchQuery<P> for Closest<A> {
    type Answer = Option<Hit>;

    fn miss(hit: &mut Option<Hit>) {
        *hit = None;
    }

    #[inline(always)]
    fn run<S: Simd>(
        &self,
        tracer: &mut Tracer<S, P>,
        index: usize,
        ray: &Ray,
        traced: &TracedRay,
        hit: &mut Option<Hit>,
    ) {
        *hit = tracer.closest_hit(traced, InstanceId(0), &mut self.0.query(index, ray));
    }
}

/// Whether there is a hit that is accepted.
pub(crate) struct Occluded<A>(pub(crate) A);

impl<P: LeafPrimitive, A: Accepts> BatchQuery<P> for Occluded<A> {
    type Answer = bool;

    fn miss(occluded: &mut bool) {
        *occluded = false;
    }

    #[inline(always)]
    fn run<S: Simd>(
        &self,
        tracer: &mut Tracer<S, P>,
        index: usize,
        ray: &Ray,
        traced: &TracedRay,
        occluded: &mut bool,
    ) {
        *occluded = tracer.occluded(traced, InstanceId(0), &mut self.0.query(index, ray));
    }
}

/// Every hit that is accepted.
pub(crate) struct Every<A>(pub(crate) A);

impl<P: LeafPrimitive, A: Accepts> BatchQuery<P> for Every<A> {
    type Answer = Vec<Hit>;

    fn miss(hits: &mut Vec<Hit>) {
        hits.clear();
    }

    #[inline(always)]
    fn run<S: Simd>(
        &self,
        tracer: &mut Tracer<S, P>,
        index: usize,
        ray: &Ray,
        traced: &TracedRay,
        hits: &mut Vec<Hit>,
    ) {
        hits.clear();
        tracer.all_hits(traced, InstanceId(0), &mut self.0.query(index, ray), hits);
    }
}

/// A slice of rays and its answers.
struct Slice<'a, P: LeafPrimitive, B: BatchQuery<P>> {
    bvh: &'a WideBvh<P>,
    query: &'a B,
    /// Index of the first ray.
    first: usize,
    rays: &'a [Ray],
    answers: &'a mut [B::Answer],
}

impl<P: LeafPrimitive, B: BatchQuery<P>> Task for Slice<'_, P, B> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let Self { bvh, query, first, rays, answers } = self;
        let mut stack = Stack::new();
        let mut tracer = Tracer::new(simd, bvh, &mut stack);
        let mut eight = EightRays::new();
        for (i, (rays, answers)) in rays.chunks(8).zip(answers.chunks_mut(8)).enumerate() {
            eight.prepare(simd, rays, &bvh.frame, const { Pads::of(P::ERROR) });
            for (lane, (ray, answer)) in rays.iter().zip(answers).enumerate() {
                match eight.ray(lane) {
                    Some(traced) => query.run(&mut tracer, first + 8 * i + lane, ray, &traced, answer),
                    None => B::miss(answer),
                }
            }
        }
    }
}

/// Runs a query for every ray: on all threads where `PARALLEL`, otherwise one after another.
///
/// # Panics
/// If the slices differ in length.
pub(crate) fn run<P: LeafPrimitive, B: BatchQuery<P>, const PARALLEL: bool>(
    bvh: &WideBvh<P>,
    query: &B,
    rays: &[Ray],
    answers: &mut [B::Answer],
) {
    assert_eq!(rays.len(), answers.len(), "rays and answers differ in number");
    if !PARALLEL {
        return bvh.path.run(Slice { bvh, query, first: 0, rays, answers });
    }
    let chunks = rays.chunks(CHUNK).zip(answers.chunks_mut(CHUNK)).enumerate().collect();
    par::for_jobs(chunks, |(i, (rays, answers))| {
        bvh.path.run(Slice { bvh, query, first: i * CHUNK, rays, answers });
    });
}
