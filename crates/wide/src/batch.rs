//! Queries, ray by ray or slice by slice.

use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay};

use crate::bvh::WideBvh;
use crate::leaf::LeafPrimitive;
use crate::par;
use crate::simd::{Simd, Task};
use crate::sink::{AllHits, BestHit, FilterQuery};
use crate::trace::trace;
use crate::traverse::Stack;

/// Rays of one job: few enough to balance threads, enough that choosing the instructions costs nothing.
const CHUNK: usize = 1024;

/// Traces rays through a BVH with the instructions of `S`, on one stack.
pub(crate) struct Tracer<'a, S: Simd, P: LeafPrimitive> {
    pub(crate) simd: S,
    pub(crate) bvh: &'a WideBvh<P>,
    pub(crate) stack: Stack,
}

impl<'a, S: Simd, P: LeafPrimitive> Tracer<'a, S, P> {
    #[inline(always)]
    pub(crate) fn new(simd: S, bvh: &'a WideBvh<P>) -> Self {
        Self { simd, bvh, stack: Stack::new(bvh.nodes.depth) }
    }

    /// The closest hit that the query accepts where `ORDERED`, otherwise any.
    #[inline(always)]
    fn best_hit<Q: Query, const ORDERED: bool>(
        &mut self,
        ray: &Ray,
        instance: InstanceId,
        query: &mut Q,
    ) -> Option<Hit> {
        let ray = ScaledRay::new(ray)?;
        let mut best = BestHit::<Q, ORDERED>::new(query, instance);
        trace(self.simd, self.bvh, &ray, &mut self.stack, &mut best);
        best.hit(&ray)
    }

    /// Every hit that the query accepts.
    #[inline(always)]
    fn all_hits<Q: Query>(&mut self, ray: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        hits.clear();
        let Some(ray) = ScaledRay::new(ray) else { return };
        let mut all = AllHits { query, instance, hits };
        trace(self.simd, self.bvh, &ray, &mut self.stack, &mut all);
        all.finish(&ray);
    }
}

/// One ray with a query that may count: the closest hit where `ORDERED`, otherwise any.
pub(crate) struct One<'a, P: LeafPrimitive, Q, const ORDERED: bool> {
    pub(crate) bvh: &'a WideBvh<P>,
    pub(crate) ray: &'a Ray,
    pub(crate) instance: InstanceId,
    pub(crate) query: &'a mut Q,
}

impl<P: LeafPrimitive, Q: Query, const ORDERED: bool> Task for One<'_, P, Q, ORDERED> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Option<Hit> {
        Tracer::new(simd, self.bvh).best_hit::<Q, ORDERED>(self.ray, self.instance, self.query)
    }
}

/// All hits of one ray with a query that may count.
pub(crate) struct AllOfOne<'a, P: LeafPrimitive, Q> {
    pub(crate) bvh: &'a WideBvh<P>,
    pub(crate) ray: &'a Ray,
    pub(crate) instance: InstanceId,
    pub(crate) query: &'a mut Q,
    pub(crate) hits: &'a mut Vec<Hit>,
}

impl<P: LeafPrimitive, Q: Query> Task for AllOfOne<'_, P, Q> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        Tracer::new(simd, self.bvh).all_hits(self.ray, self.instance, self.query, self.hits);
    }
}

/// A query about each ray of a slice.
pub(crate) trait BatchQuery<P: LeafPrimitive>: Sync {
    /// The answer for one ray.
    type Answer: Send;

    /// Overwrites `answer` with that of the ray of this index.
    fn run<S: Simd>(&self, tracer: &mut Tracer<S, P>, index: usize, ray: &Ray, answer: &mut Self::Answer);
}

/// The closest hit that a function accepts.
pub(crate) struct Closest<F>(pub(crate) F);

impl<P: LeafPrimitive, F: Fn(usize, &Ray, &Hit) -> bool + Sync> BatchQuery<P> for Closest<F> {
    type Answer = Option<Hit>;

    #[inline(always)]
    fn run<S: Simd>(&self, tracer: &mut Tracer<S, P>, index: usize, ray: &Ray, hit: &mut Option<Hit>) {
        let query = &mut FilterQuery { accepts: &self.0, index, ray };
        *hit = tracer.best_hit::<_, true>(ray, InstanceId(0), query);
    }
}

/// Whether there is a hit that a function accepts.
pub(crate) struct Occluded<F>(pub(crate) F);

impl<P: LeafPrimitive, F: Fn(usize, &Ray, &Hit) -> bool + Sync> BatchQuery<P> for Occluded<F> {
    type Answer = bool;

    #[inline(always)]
    fn run<S: Simd>(&self, tracer: &mut Tracer<S, P>, index: usize, ray: &Ray, occluded: &mut bool) {
        let query = &mut FilterQuery { accepts: &self.0, index, ray };
        *occluded = tracer.best_hit::<_, false>(ray, InstanceId(0), query).is_some();
    }
}

/// Every hit that a function accepts.
pub(crate) struct Every<F>(pub(crate) F);

impl<P: LeafPrimitive, F: Fn(usize, &Ray, &Hit) -> bool + Sync> BatchQuery<P> for Every<F> {
    type Answer = Vec<Hit>;

    #[inline(always)]
    fn run<S: Simd>(&self, tracer: &mut Tracer<S, P>, index: usize, ray: &Ray, hits: &mut Vec<Hit>) {
        tracer.all_hits(ray, InstanceId(0), &mut FilterQuery { accepts: &self.0, index, ray }, hits);
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
        let mut tracer = Tracer::new(simd, self.bvh);
        for (i, (ray, answer)) in self.rays.iter().zip(self.answers).enumerate() {
            self.query.run(&mut tracer, self.first + i, ray, answer);
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
