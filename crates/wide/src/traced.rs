//! One ray through one tree, whatever the leaves hold and whatever is asked.

use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay};

use crate::emit::Records;
use crate::layout::NodeKind;
use crate::simd::Simd;
use crate::traverse::{MeshFrame, Pads, RayLanes, Stack, Visit, walk};

/// A tree as rays see it.
pub(crate) trait Traced: Sync {
    /// What its leaves' tests need of a ray.
    type Prepared<S: Simd>;
    /// What a hit is on.
    type Met;

    /// Nodes and leaves.
    fn records(&self) -> &Records;

    /// The frame that box nodes stand in.
    fn frame(&self) -> &MeshFrame;

    /// Greatest coordinate of anything in the tree.
    fn reach(&self) -> f32;

    /// By how much rays are thickened, relative to their and its coordinates.
    fn pads(&self) -> Pads;

    /// Prepares `ray` for leaves.
    fn prepare<S: Simd>(simd: S, ray: &ScaledRay) -> Self::Prepared<S>;

    /// Hands all hits of a leaf with `t <= t_max` to `take`, and returns what it last returned, at first `t_max`.
    fn leaf<S: Simd, T: HitSink<Self::Met>>(
        &self,
        simd: S,
        prepared: &Self::Prepared<S>,
        ray: &ScaledRay,
        leaf: Leaf,
        take: &mut T,
    ) -> f32;
}

/// Primitives of a leaf, and how far the ray still goes.
#[derive(Clone, Copy)]
pub(crate) struct Leaf {
    pub(crate) first: u32,
    pub(crate) n: u32,
    pub(crate) t_max: f32,
}

/// What becomes of hits on `M`.
pub(crate) trait HitSink<M: ?Sized> {
    /// Subtrees are visited nearest first.
    const ORDERED: bool;

    /// Takes a hit with `t_min <= t <= t_max`, all three scaled. Returns the new `t_max`; below zero ends the walk.
    fn take(&mut self, ray: &ScaledRay, hit: Hit, met: &M, t_max: f32) -> f32;

    /// `n` primitives are tested.
    fn primitives(&mut self, n: u32);

    /// A node of this kind is tested.
    fn node(&mut self, kind: NodeKind);
}

/// Walks `tree`. Must be inlined where the path's instructions are enabled, like all of [`Simd`]'s callers.
#[inline(always)]
pub(crate) fn trace<S: Simd, W: Traced, T: HitSink<W::Met>>(
    simd: S,
    tree: &W,
    ray: &ScaledRay,
    stack: &mut Stack,
    take: &mut T,
) {
    let pads = tree.pads().along(ray, tree.reach());
    let lanes = RayLanes::new(simd, ray, tree.frame(), &pads);
    let mut leaves = Leaves { simd, tree, prepared: None, ray, take };
    let records = tree.records();
    if T::ORDERED {
        walk::<S, true>(simd, &records.lines, records.root, &lanes, ray.t_max, stack, &mut leaves);
    } else {
        walk::<S, false>(simd, &records.lines, records.root, &lanes, ray.t_max, stack, &mut leaves);
    }
}

/// Leaves of a tree, met by one ray.
struct Leaves<'a, S: Simd, W: Traced, T> {
    simd: S,
    tree: &'a W,
    /// Made at the first leaf: many rays meet none.
    prepared: Option<W::Prepared<S>>,
    ray: &'a ScaledRay,
    take: &'a mut T,
}

impl<S: Simd, W: Traced, T: HitSink<W::Met>> Visit for Leaves<'_, S, W, T> {
    #[inline(always)]
    fn leaf(&mut self, first: u32, n: u32, t_max: f32) -> f32 {
        self.take.primitives(n);
        let prepared = match &self.prepared {
            Some(prepared) => prepared,
            None => self.prepared.insert(W::prepare(self.simd, self.ray)),
        };
        self.tree.leaf(self.simd, prepared, self.ray, Leaf { first, n, t_max }, self.take)
    }

    #[inline(always)]
    fn node(&mut self, kind: NodeKind) {
        self.take.node(kind);
    }
}

/// Keeps the first of the hits that a query accepts, or, where not `ORDERED`, any.
pub(crate) struct Best<'a, Q, const ORDERED: bool> {
    query: &'a mut Q,
    instance: InstanceId,
    /// `t` scaled.
    best: Option<Hit>,
}

impl<'a, Q, const ORDERED: bool> Best<'a, Q, ORDERED> {
    #[inline(always)]
    pub(crate) fn new(query: &'a mut Q, instance: InstanceId) -> Self {
        Self { query, instance, best: None }
    }

    /// The hit, its `t` the caller's.
    #[inline(always)]
    pub(crate) fn hit(self, ray: &ScaledRay) -> Option<Hit> {
        self.best.map(|hit| Hit { t: ray.caller_t(hit.t), instance: self.instance, ..hit })
    }
}

impl<M: ?Sized, Q: Query, const ORDERED: bool> HitSink<M> for Best<'_, Q, ORDERED> {
    const ORDERED: bool = ORDERED;

    #[inline(always)]
    fn take(&mut self, ray: &ScaledRay, hit: Hit, _: &M, t_max: f32) -> f32 {
        let is_first = self.best.is_none_or(|best| hit.before(&best));
        if is_first && self.query.accepts(&Hit { t: ray.caller_t(hit.t), instance: self.instance, ..hit }) {
            self.best = Some(hit);
            return if ORDERED { hit.t } else { -1.0 };
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

/// Keeps all hits that a query accepts, in the order of the tree, `t` scaled.
pub(crate) struct All<'a, Q> {
    pub(crate) query: &'a mut Q,
    pub(crate) instance: InstanceId,
    pub(crate) hits: &'a mut Vec<Hit>,
}

impl<Q> All<'_, Q> {
    /// Puts the hits in order, each once, their `t` the caller's.
    pub(crate) fn finish(self, ray: &ScaledRay) {
        self.hits.sort_unstable_by(by_t);
        // Where a primitive has two references, both give the same bits.
        self.hits.dedup_by_key(|hit| (hit.t.to_bits(), hit.primitive));
        for hit in self.hits {
            hit.t = ray.caller_t(hit.t);
        }
    }
}

impl<M: ?Sized, Q: Query> HitSink<M> for All<'_, Q> {
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
pub(crate) fn by_t(a: &Hit, b: &Hit) -> std::cmp::Ordering {
    // Adding zero makes -0.0 positive: a zero is a zero.
    (a.t + 0.0).total_cmp(&(b.t + 0.0)).then(a.primitive.cmp(&b.primitive))
}

/// Asks a function of the caller's.
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

/// A hit of a tree without instances.
#[inline(always)]
pub(crate) fn hit(t: f32, [u, v]: [f32; 2], side: canted_trace::Side, primitive: PrimId) -> Hit {
    Hit { t, u, v, primitive, instance: InstanceId(0), side }
}

#[cfg(test)]
mod tests;
