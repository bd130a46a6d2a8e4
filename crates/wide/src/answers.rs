//! What is asked of a tree, ray by ray or slice by slice.

use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay};

use crate::par;
use crate::simd::{Simd, SimdPath, Task};
use crate::traced::{All, Best, FilterQuery, Traced, trace};
use crate::traverse::Stack;

/// Rays of one job: few enough to share work out evenly, enough that choosing the path costs nothing.
const CHUNK: usize = 1024;

/// A question to a tree `W` about each ray of a slice.
pub(crate) trait BatchQuery<W: Traced>: Sync {
    /// What it is answered with.
    type Answer: Send;

    /// The answer for the ray of number `index`, written over an old one.
    fn ask<S: Simd>(&self, simd: S, tree: &W, index: usize, ray: &Ray, stack: &mut Stack, answer: &mut Self::Answer);
}

/// Which hits count.
pub(crate) trait Filter: Sync {
    /// Its form for one ray.
    type Query<'a>: Query
    where
        Self: 'a;

    /// Its form for the ray of number `index`.
    fn query<'a>(&'a self, index: usize, ray: &'a Ray) -> Self::Query<'a>;
}

/// Every hit counts.
pub(crate) struct Any;

impl Filter for Any {
    type Query<'a> = ();

    #[inline(always)]
    fn query(&self, _: usize, _: &Ray) {}
}

/// Those hits count that a function accepts.
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

impl<W: Traced, F: Filter> BatchQuery<W> for Closest<F> {
    type Answer = Option<Hit>;

    #[inline(always)]
    fn ask<S: Simd>(&self, simd: S, tree: &W, index: usize, ray: &Ray, stack: &mut Stack, hit: &mut Option<Hit>) {
        *hit = best::<S, W, _, true>(simd, tree, ray, InstanceId(0), &mut self.0.query(index, ray), stack);
    }
}

/// Whether anything is hit.
pub(crate) struct Occluded<F>(pub(crate) F);

impl<W: Traced, F: Filter> BatchQuery<W> for Occluded<F> {
    type Answer = bool;

    #[inline(always)]
    fn ask<S: Simd>(&self, simd: S, tree: &W, index: usize, ray: &Ray, stack: &mut Stack, occluded: &mut bool) {
        let query = &mut self.0.query(index, ray);
        *occluded = best::<S, W, _, false>(simd, tree, ray, InstanceId(0), query, stack).is_some();
    }
}

/// Every hit.
pub(crate) struct Every<F>(pub(crate) F);

impl<W: Traced, F: Filter> BatchQuery<W> for Every<F> {
    type Answer = Vec<Hit>;

    #[inline(always)]
    fn ask<S: Simd>(&self, simd: S, tree: &W, index: usize, ray: &Ray, stack: &mut Stack, hits: &mut Vec<Hit>) {
        all(simd, tree, ray, InstanceId(0), &mut self.0.query(index, ray), stack, hits);
    }
}

#[inline(always)]
fn best<S: Simd, W: Traced, Q: Query, const ORDERED: bool>(
    simd: S,
    tree: &W,
    ray: &Ray,
    instance: InstanceId,
    query: &mut Q,
    stack: &mut Stack,
) -> Option<Hit> {
    let ray = ScaledRay::new(ray)?;
    let mut best = Best::<Q, ORDERED>::new(query, instance);
    trace(simd, tree, &ray, stack, &mut best);
    best.hit(&ray)
}

#[inline(always)]
fn all<S: Simd, W: Traced, Q: Query>(
    simd: S,
    tree: &W,
    ray: &Ray,
    instance: InstanceId,
    query: &mut Q,
    stack: &mut Stack,
    hits: &mut Vec<Hit>,
) {
    hits.clear();
    let Some(ray) = ScaledRay::new(ray) else { return };
    let mut all = All { query, instance, hits };
    trace(simd, tree, &ray, stack, &mut all);
    all.finish(&ray);
}

/// One ray, with a query that may count: the closest hit where `ORDERED`, else any.
pub(crate) struct One<'a, W, Q, const ORDERED: bool> {
    pub(crate) tree: &'a W,
    pub(crate) ray: &'a Ray,
    pub(crate) instance: InstanceId,
    pub(crate) query: &'a mut Q,
}

impl<W: Traced, Q: Query, const ORDERED: bool> Task for One<'_, W, Q, ORDERED> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Option<Hit> {
        let mut stack = Stack::new(self.tree.records().depth);
        best::<S, W, Q, ORDERED>(simd, self.tree, self.ray, self.instance, self.query, &mut stack)
    }
}

/// All hits of one ray, with a query that may count.
pub(crate) struct AllOfOne<'a, W, Q> {
    pub(crate) tree: &'a W,
    pub(crate) ray: &'a Ray,
    pub(crate) instance: InstanceId,
    pub(crate) query: &'a mut Q,
    pub(crate) hits: &'a mut Vec<Hit>,
}

impl<W: Traced, Q: Query> Task for AllOfOne<'_, W, Q> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let mut stack = Stack::new(self.tree.records().depth);
        all(simd, self.tree, self.ray, self.instance, self.query, &mut stack, self.hits);
    }
}

/// A slice of rays and its answers.
struct Slice<'a, W: Traced, A: BatchQuery<W>> {
    tree: &'a W,
    question: &'a A,
    /// Number of the first ray.
    first: usize,
    rays: &'a [Ray],
    answers: &'a mut [A::Answer],
}

impl<W: Traced, A: BatchQuery<W>> Task for Slice<'_, W, A> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let mut stack = Stack::new(self.tree.records().depth);
        for (i, (ray, answer)) in self.rays.iter().zip(self.answers).enumerate() {
            self.question.ask(simd, self.tree, self.first + i, ray, &mut stack, answer);
        }
    }
}

/// Answers a question about every ray, one after another.
///
/// # Panics
/// Where the slices differ in length.
pub(crate) fn serial<W: Traced, A: BatchQuery<W>>(
    path: SimdPath,
    tree: &W,
    question: &A,
    rays: &[Ray],
    answers: &mut [A::Answer],
) {
    assert_eq!(rays.len(), answers.len(), "an answer for each ray");
    path.run(Slice { tree, question, first: 0, rays, answers });
}

/// The same on all threads.
///
/// # Panics
/// Where the slices differ in length.
pub(crate) fn parallel<W: Traced, A: BatchQuery<W>>(
    path: SimdPath,
    tree: &W,
    question: &A,
    rays: &[Ray],
    answers: &mut [A::Answer],
) {
    assert_eq!(rays.len(), answers.len(), "an answer for each ray");
    let chunks = rays.chunks(CHUNK).zip(answers.chunks_mut(CHUNK)).enumerate().collect();
    par::for_jobs(chunks, |(i, (rays, answers))| {
        path.run(Slice { tree, question, first: i * CHUNK, rays, answers });
    });
}
