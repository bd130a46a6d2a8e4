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

/// A query about each ray of a slice.
pub(crate) trait BatchQuery<P: LeafPrimitive>: Sync {
    /// The answer for one ray.
    type Answer: Send;

    /// Overwrites `answer` with that of the ray of this index.
    fn run<S: Simd>(
        &self,
        simd: S,
        bvh: &WideBvh<P>,
        index: usize,
        ray: &Ray,
        stack: &mut Stack,
        answer: &mut Self::Answer,
    );
}

/// Which hits count.
pub(crate) trait Filter: Sync {
    /// The filter for one ray.
    type Query<'a>: Query
    where
        Self: 'a;

    /// The filter for the ray of this index.
    fn query<'a>(&'a self, index: usize, ray: &'a Ray) -> Self::Query<'a>;
}

/// Every hit counts.
pub(crate) struct AcceptAll;

impl Filter for AcceptAll {
    type Query<'a> = ();

    #[inline(always)]
    fn query(&self, _: usize, _: &Ray) {}
}

/// The hits count that a function accepts.
pub(crate) struct Where<F>(pub(crate) F);

impl<F: Fn(usize, &Ray, &Hit) -> bool + Sync> Filter for Where<F> {
    type Query<'a>
        = FilterQuery<'a, F>
    where
        F: 'a;

    #[inline(always)]
    fn query<'a>(&'a self, index: usize, ray: &'a Ray) -> FilterQuery<'a, F> {
        FilterQuery { accepts: &self.0, index, ray }
    }
}

/// The closest hit.
pub(crate) struct Closest<F>(pub(crate) F);

impl<P: LeafPrimitive, F: Filter> BatchQuery<P> for Closest<F> {
    type Answer = Option<Hit>;

    #[inline(always)]
    fn run<S: Simd>(
        &self,
        simd: S,
        bvh: &WideBvh<P>,
        index: usize,
        ray: &Ray,
        stack: &mut Stack,
        hit: &mut Option<Hit>,
    ) {
        *hit = best_hit::<S, P, _, true>(simd, bvh, ray, InstanceId(0), &mut self.0.query(index, ray), stack);
    }
}

/// Whether anything is hit.
pub(crate) struct Occluded<F>(pub(crate) F);

impl<P: LeafPrimitive, F: Filter> BatchQuery<P> for Occluded<F> {
    type Answer = bool;

    #[inline(always)]
    fn run<S: Simd>(&self, simd: S, bvh: &WideBvh<P>, index: usize, ray: &Ray, stack: &mut Stack, occluded: &mut bool) {
        let query = &mut self.0.query(index, ray);
        *occluded = best_hit::<S, P, _, false>(simd, bvh, ray, InstanceId(0), query, stack).is_some();
    }
}

/// Every hit.
pub(crate) struct Every<F>(pub(crate) F);

impl<P: LeafPrimitive, F: Filter> BatchQuery<P> for Every<F> {
    type Answer = Vec<Hit>;

    #[inline(always)]
    fn run<S: Simd>(&self, simd: S, bvh: &WideBvh<P>, index: usize, ray: &Ray, stack: &mut Stack, hits: &mut Vec<Hit>) {
        all_hits(simd, bvh, ray, InstanceId(0), &mut self.0.query(index, ray), stack, hits);
    }
}

#[inline(always)]
fn best_hit<S: Simd, P: LeafPrimitive, Q: Query, const ORDERED: bool>(
    simd: S,
    bvh: &WideBvh<P>,
    ray: &Ray,
    instance: InstanceId,
    query: &mut Q,
    stack: &mut Stack,
) -> Option<Hit> {
    let ray = ScaledRay::new(ray)?;
    let mut best = BestHit::<Q, ORDERED>::new(query, instance);
    trace(simd, bvh, &ray, stack, &mut best);
    best.hit(&ray)
}

#[inline(always)]
fn all_hits<S: Simd, P: LeafPrimitive, Q: Query>(
    simd: S,
    bvh: &WideBvh<P>,
    ray: &Ray,
    instance: InstanceId,
    query: &mut Q,
    stack: &mut Stack,
    hits: &mut Vec<Hit>,
) {
    hits.clear();
    let Some(ray) = ScaledRay::new(ray) else { return };
    let mut all = AllHits { query, instance, hits };
    trace(simd, bvh, &ray, stack, &mut all);
    all.finish(&ray);
}

/// One ray with a query that may count: the closest hit where `ORDERED`, else any.
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
        let mut stack = Stack::new(self.bvh.nodes.depth);
        best_hit::<S, P, Q, ORDERED>(simd, self.bvh, self.ray, self.instance, self.query, &mut stack)
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
        let mut stack = Stack::new(self.bvh.nodes.depth);
        all_hits(simd, self.bvh, self.ray, self.instance, self.query, &mut stack, self.hits);
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
        let mut stack = Stack::new(self.bvh.nodes.depth);
        for (i, (ray, answer)) in self.rays.iter().zip(self.answers).enumerate() {
            self.query.run(simd, self.bvh, self.first + i, ray, &mut stack, answer);
        }
    }
}

/// Runs a query for every ray, one after another.
///
/// # Panics
/// If the slices differ in length.
pub(crate) fn serial<P: LeafPrimitive, B: BatchQuery<P>>(
    bvh: &WideBvh<P>,
    query: &B,
    rays: &[Ray],
    answers: &mut [B::Answer],
) {
    assert_eq!(rays.len(), answers.len(), "rays and answers differ in number");
    bvh.path.run(Slice { bvh, query, first: 0, rays, answers });
}

/// The same on all threads.
///
/// # Panics
/// If the slices differ in length.
pub(crate) fn parallel<P: LeafPrimitive, B: BatchQuery<P>>(
    bvh: &WideBvh<P>,
    query: &B,
    rays: &[Ray],
    answers: &mut [B::Answer],
) {
    assert_eq!(rays.len(), answers.len(), "rays and answers differ in number");
    let chunks = rays.chunks(CHUNK).zip(answers.chunks_mut(CHUNK)).enumerate().collect();
    par::for_jobs(chunks, |(i, (rays, answers))| {
        bvh.path.run(Slice { bvh, query, first: i * CHUNK, rays, answers });
    });
}
