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

/// Appends all hits that a query accepts, in traversal order, `t` scaled.
pub(crate) struct AllHits<'a, Q> {
    pub(crate) query: &'a mut Q,
    pub(crate) instance: InstanceId,
    pub(crate) hits: &'a mut Vec<Hit>,
}

/// Sorts the hits from `first` on, which are those of one ray, and removes duplicates.
#[inline(always)]
pub(crate) fn sort_from(hits: &mut Vec<Hit>, first: usize) {
    let own = &mut hits[first..];
    if own.len() < 2 {
        return;
    }
    own.sort_unstable_by_key(key);
    // Where a primitive has two references, both give the same bits.
    let mut kept = 1;
    for i in 1..own.len() {
        if key(&own[i]) != key(&own[kept - 1]) {
            own[kept] = own[i];
            kept += 1;
        }
    }
    hits.truncate(first + kept);
}

/// Converts `t` of the hits from `first` on to units of the caller's direction.
#[inline(always)]
pub(crate) fn to_caller(ray: &ScaledRay, hits: &mut [Hit]) {
    hits.iter_mut().for_each(|hit| hit.t = ray.caller_t(hit.t));
}

/// Order of hits along a ray as an integer: `t`, then primitive. No `t` is negative, and adding zero makes -0.0 positive.
#[inline(always)]
fn key(hit: &Hit) -> u64 {
    u64::from((hit.t + 0.0).to_bits()) << 32 | u64::from(hit.primitive.0)
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

/// Order of hits along a ray: `t`, then primitive.
pub(crate) fn by_t(a: &Hit, b: &Hit) -> Ordering {
    key(a).cmp(&key(b))
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
