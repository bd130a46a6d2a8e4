//! What queries do with hits: keep the closest, any, or all.

use std::cmp::Ordering;

use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay};

use crate::layout::NodeKind;
use crate::leaf::HitSink;

/// Keeps the first of the hits that a query accepts.
pub(crate) struct BestHit<'a, Q> {
    query: &'a mut Q,
    instance: InstanceId,
    /// `t` scaled.
    best: Option<Hit>,
}

impl<'a, Q> BestHit<'a, Q> {
    #[inline(always)]
    pub(crate) fn new(query: &'a mut Q, instance: InstanceId) -> Self {
        Self { query, instance, best: None }
    }

    /// The hit, with `t` in units of the caller's direction.
    #[inline(always)]
    pub(crate) fn hit(self, ray: &ScaledRay) -> Option<Hit> {
        self.best.map(|hit| Hit { t: ray.caller_t(hit.t), instance: self.instance, ..hit })
    }
}

impl<M: ?Sized, Q: Query> HitSink<M> for BestHit<'_, Q> {
    const ORDERED: bool = true;

    #[inline(always)]
    fn take(&mut self, ray: &ScaledRay, hit: Hit, _: &M, t_max: f32) -> f32 {
        let is_first = self.best.is_none_or(|best| hit.before(&best));
        if is_first && self.query.accepts(&Hit { t: ray.caller_t(hit.t), instance: self.instance, ..hit }) {
            self.best = Some(hit);
            return hit.t;
        }
        t_max
    }

    #[inline(always)]
    fn primitives(&mut self, n: u32) {
        self.query.triangles(n);
    }

    #[inline(always)]
    fn node(&mut self, _: NodeKind) {
        self.query.boxes(8);
    }
}

/// Whether a query accepts any hit.
pub(crate) struct AnyHit<'a, Q> {
    query: &'a mut Q,
    instance: InstanceId,
    pub(crate) found: bool,
}

impl<'a, Q> AnyHit<'a, Q> {
    #[inline(always)]
    pub(crate) fn new(query: &'a mut Q, instance: InstanceId) -> Self {
        Self { query, instance, found: false }
    }
}

impl<M: ?Sized, Q: Query> HitSink<M> for AnyHit<'_, Q> {
    const ORDERED: bool = false;
    const ANY: bool = !Q::MAY_REJECT;

    #[inline(always)]
    fn take_any(&mut self) -> f32 {
        self.found = true;
        -1.0
    }

    #[inline(always)]
    fn take(&mut self, ray: &ScaledRay, hit: Hit, _: &M, t_max: f32) -> f32 {
        self.found = self.query.accepts(&Hit { t: ray.caller_t(hit.t), instance: self.instance, ..hit });
        if self.found { -1.0 } else { t_max }
    }

    #[inline(always)]
    fn primitives(&mut self, n: u32) {
        self.query.triangles(n);
    }

    #[inline(always)]
    fn node(&mut self, _: NodeKind) {
        self.query.boxes(8);
    }
}

/// Keeps all hits that a query accepts, in traversal order, `t` scaled.
pub(crate) struct AllHits<'a, Q> {
    pub(crate) query: &'a mut Q,
    pub(crate) instance: InstanceId,
    pub(crate) hits: &'a mut Vec<Hit>,
}

impl<Q> AllHits<'_, Q> {
    /// Sorts the hits, removes duplicates, and converts `t` to units of the caller's direction.
    pub(crate) fn finish(self, ray: &ScaledRay) {
        self.hits.sort_unstable_by(by_t);
        // Where a primitive has two references, both give the same bits.
        self.hits.dedup_by_key(|hit| (hit.t.to_bits(), hit.primitive));
        for hit in self.hits {
            hit.t = ray.caller_t(hit.t);
        }
    }
}

impl<M: ?Sized, Q: Query> HitSink<M> for AllHits<'_, Q> {
    const ORDERED: bool = false;

    #[inline(always)]
    fn take(&mut self, ray: &ScaledRay, hit: Hit, _: &M, t_max: f32) -> f32 {
        let hit = Hit { instance: self.instance, ..hit };
        if self.query.accepts(&Hit { t: ray.caller_t(hit.t), ..hit }) {
            self.hits.push(hit);
        }
        t_max
    }

    #[inline(always)]
    fn primitives(&mut self, n: u32) {
        self.query.triangles(n);
    }

    #[inline(always)]
    fn node(&mut self, _: NodeKind) {
        self.query.boxes(8);
    }
}

/// Order of hits along a ray: `t`, then primitive. Hits hold no NaN.
pub(crate) fn by_t(a: &Hit, b: &Hit) -> Ordering {
    // Adding zero makes -0.0 positive, so that both zeros compare equal.
    (a.t + 0.0).total_cmp(&(b.t + 0.0)).then(a.primitive.cmp(&b.primitive))
}

/// Accepts the hits that a function accepts.
pub(crate) struct FilterQuery<'a, F> {
    pub(crate) accepts: &'a F,
    pub(crate) index: usize,
    pub(crate) ray: &'a Ray,
}

impl<F: Fn(usize, &Ray, &Hit) -> bool> Query for FilterQuery<'_, F> {
    #[inline(always)]
    fn accepts(&mut self, hit: &Hit) -> bool {
        (self.accepts)(self.index, self.ray, hit)
    }
}
