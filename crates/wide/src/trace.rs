//! One ray through one BVH, whatever its leaves hold and whatever the query.

use canted_obb::PrimId;
use canted_trace::{Query, ScaledRay};

use crate::bvh::WideBvh;
use crate::layout::NodeKind;
use crate::leaf::{HitSink, LeafPrimitive, LeafRange};
use crate::simd::{Simd, Task};
use crate::traverse::{Pads, RayLanes, RayNumbers, Stack, TracedRay, Visitor, walk};

/// A ray ready for [`trace`], with the pads of the BVH's primitives.
#[inline(always)]
pub(crate) fn prepare<P: LeafPrimitive>(bvh: &WideBvh<P>, scaled: ScaledRay) -> TracedRay {
    prepare_padded(bvh, const { Pads::of(P::ERROR) }, scaled)
}

/// As [`prepare`], with pads of the caller's choice, relative to the origin.
#[inline(always)]
pub(crate) fn prepare_padded<P: LeafPrimitive>(bvh: &WideBvh<P>, pads: Pads, scaled: ScaledRay) -> TracedRay {
    let moved = bvh.frame.reference.moved_ray(&scaled);
    let numbers = RayNumbers::new(&moved, &bvh.frame, &pads.along(&moved));
    TracedRay { scaled, numbers }
}

/// Passes all hits of `ray` to `sink`. Must be inlined where the path's instructions are enabled, like all callers of [`Simd`].
#[inline(always)]
pub(crate) fn trace<S: Simd, P: LeafPrimitive, T: HitSink<P::Shape>>(
    simd: S,
    bvh: &WideBvh<P>,
    ray: &TracedRay,
    stack: &mut Stack,
    sink: &mut T,
) {
    // Two values instead of one in memory: the kernels index the direction, and what is indexed stays in memory.
    let TracedRay { scaled, numbers } = *ray;
    let (scaled, numbers) = (&scaled, &numbers);
    let leaves = P::view(&bvh.leaves);
    let mut visitor =
        IntersectLeaves::<S, P, T> { simd, leaves, prepared: P::prepare(simd, scaled), ray: scaled, sink };
    let lanes = RayLanes::new(simd, numbers);
    if T::ORDERED {
        walk::<S, true>(simd, &bvh.nodes, &lanes, scaled.t_max, stack, &mut visitor);
    } else {
        walk::<S, false>(simd, &bvh.nodes, &lanes, scaled.t_max, stack, &mut visitor);
    }
}

/// Intersects the primitives of each leaf that a ray enters.
struct IntersectLeaves<'a, S: Simd, P: LeafPrimitive + 'a, T> {
    simd: S,
    leaves: P::View<'a>,
    prepared: P::Prepared<S>,
    ray: &'a ScaledRay,
    sink: &'a mut T,
}

impl<'a, S: Simd, P: LeafPrimitive + 'a, T: HitSink<P::Shape>> Visitor for IntersectLeaves<'a, S, P, T> {
    #[inline(always)]
    fn leaf(&mut self, leaf: LeafRange) -> f32 {
        self.sink.primitives(leaf.n);
        P::intersect_leaf(self.leaves, self.simd, &self.prepared, self.ray, leaf, self.sink)
    }

    #[inline(always)]
    fn node(&mut self, kind: NodeKind) {
        self.sink.node(kind);
    }
}

/// Traversal that calls a function for each primitive of an entered leaf, without testing it.
impl<P: LeafPrimitive> WideBvh<P> {
    /// Calls `visit` with each primitive of each leaf that `ray` enters at or before `t_max`, nearer subtrees first.
    ///
    /// This is the building block for a level above other structures: `WideBvh<Aabb>` has one box per leaf, so it reports the
    /// boxes that a ray enters. `visit` gets the scaled `t_max` and returns the new one; a negative value ends the
    /// traversal. A leaf is entered no later than any hit that lies within `error` of one of its primitives in each
    /// coordinate, in units of the space, and while that is `<= t_max`: so ties do not depend on the BVH.
    ///
    /// ```
    /// use canted_obb::Aabb;
    /// use canted_trace::{Ray, ScaledRay};
    /// use canted_wide::{Config, WideBvh};
    ///
    /// let boxes = [9.0, 0.0, 6.0, 3.0].map(|x| Aabb { min: [x, 0.0, 0.0], max: [x + 1.0, 1.0, 1.0] });
    /// let bvh = WideBvh::<Aabb>::build(boxes.to_vec(), &Config::default())?;
    /// let ray = ScaledRay::new(&Ray::new([2.0, 0.5, 0.5], [1.0, 0.0, 0.0])).expect("a valid ray");
    /// let mut entered = vec![];
    /// bvh.traverse_ordered(&ray, 0.0, &mut (), |id, t_max, _| {
    ///     entered.push(id.0);
    ///     // A hit at 4.5, inside the second box, hides the last one.
    ///     if id.0 == 2 { 4.5 } else { t_max }
    /// });
    /// assert_eq!(entered, [3, 2]);
    /// # Ok::<(), canted_wide::PrimitiveError>(())
    /// ```
    pub fn traverse_ordered<Q: Query>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        visit: impl FnMut(PrimId, f32, &mut Q) -> f32,
    ) {
        self.traverse_with::<_, true>(ray, error, query, &mut Stack::new(), visit);
    }

    /// As [`WideBvh::traverse_ordered`], in any order: for queries that end at the first hit.
    pub fn traverse_any<Q: Query>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        visit: impl FnMut(PrimId, f32, &mut Q) -> f32,
    ) {
        self.traverse_with::<_, false>(ray, error, query, &mut Stack::new(), visit);
    }

    /// As [`WideBvh::traverse_ordered`] where `ORDERED`, else as [`WideBvh::traverse_any`], with memory for nodes that wait.
    #[doc(hidden)]
    #[inline]
    pub fn traverse_with<Q: Query, const ORDERED: bool>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        stack: &mut Stack,
        visit: impl FnMut(PrimId, f32, &mut Q) -> f32,
    ) {
        self.path.run(VisitLeaves::<_, _, _, ORDERED> { bvh: self, ray, error, query, stack: Some(stack), visit });
    }
}

/// Calls a function for each primitive of each leaf that a ray enters.
struct VisitLeaves<'a, P: LeafPrimitive, Q, F, const ORDERED: bool> {
    bvh: &'a WideBvh<P>,
    ray: &'a ScaledRay,
    error: f64,
    query: &'a mut Q,
    /// Taken by the traversal.
    stack: Option<&'a mut Stack>,
    visit: F,
}

impl<P, Q, F, const ORDERED: bool> Task for VisitLeaves<'_, P, Q, F, ORDERED>
where
    P: LeafPrimitive,
    Q: Query,
    F: FnMut(PrimId, f32, &mut Q) -> f32,
{
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(mut self, simd: S) {
        let Self { bvh, ray, error, .. } = self;
        let moved = bvh.frame.reference.moved_ray(ray);
        let lanes = RayLanes::new(simd, &RayNumbers::new(&moved, &bvh.frame, &Pads::within(error, &moved)));
        let Some(stack) = self.stack.take() else { return };
        walk::<S, ORDERED>(simd, &bvh.nodes, &lanes, ray.t_max, stack, &mut self);
    }
}

impl<P, Q, F, const ORDERED: bool> Visitor for VisitLeaves<'_, P, Q, F, ORDERED>
where
    P: LeafPrimitive,
    Q: Query,
    F: FnMut(PrimId, f32, &mut Q) -> f32,
{
    #[inline(always)]
    fn leaf(&mut self, leaf: LeafRange) -> f32 {
        let mut t_max = leaf.t_max;
        for id in P::ids(&self.bvh.leaves, leaf) {
            t_max = (self.visit)(id, t_max, self.query);
            if t_max < 0.0 {
                break;
            }
        }
        t_max
    }

    #[inline(always)]
    fn node(&mut self, _: NodeKind) {
        self.query.boxes(8);
    }
}

#[cfg(test)]
mod tests;
