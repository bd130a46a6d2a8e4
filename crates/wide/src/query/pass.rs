//! The hits of a ray through triangles, passed to a sink: the traversal with a visitor that tests the triangles of each leaf, eight at a time.

use canted_trace::{ScaledRay, TriangleTest};

use super::sink::HitSink;
use crate::bvh::TriangleBvh;
use crate::leaf::hit;
use crate::node::{HalfBlock, NodeKind};
use crate::simd::Simd;
use crate::traverse::{
    Blocks, LeafRange, Pads, RayNumbers, RayTriangles, ThroughNodes, ThroughTriangles, TracedRay, Visitor,
    prefetch_block, walk,
};

/// Pads for the default triangle test.
pub(super) const PADS: Pads = Pads::of(TriangleTest::Watertight.hit_error());

/// Passes all hits of `ray` to `sink`. Must be inlined where the path's instructions are enabled, like all callers of [`Simd`].
#[inline(always)]
pub(super) fn pass_hits<S: Simd, T: HitSink, const WATERTIGHT: bool>(
    simd: S,
    bvh: &TriangleBvh,
    ray: &TracedRay,
    stack: &mut [u64],
    sink: &mut T,
) {
    // Two values instead of one in memory: the kernels index the direction, and what is indexed stays in memory.
    let TracedRay { scaled, numbers } = *ray;
    pass_prepared::<S, T, _, _, WATERTIGHT>(simd, bvh, &scaled, (&numbers, &scaled), stack, sink);
}

/// [`pass_hits`] of a ray that is prepared here, with the default triangle test.
#[inline(always)]
pub(super) fn pass_plain<S: Simd, T: HitSink>(
    simd: S,
    bvh: &TriangleBvh,
    ray: &ScaledRay,
    stack: &mut [u64],
    sink: &mut T,
) {
    let numbers = RayNumbers::relative(simd, ray, &bvh.frame, PADS);
    pass_prepared::<S, T, _, _, true>(simd, bvh, ray, (&numbers, ray), stack, sink);
}

/// [`pass_hits`] of a ray that is prepared for nodes from `numbers`, and for triangles in its first leaf from `ray`.
#[inline(always)]
pub(super) fn pass_prepared<S: Simd, T: HitSink, N: ThroughNodes, R: ThroughTriangles, const WATERTIGHT: bool>(
    simd: S,
    bvh: &TriangleBvh,
    scaled: &ScaledRay,
    (numbers, ray): (N, R),
    stack: &mut [u64],
    sink: &mut T,
) {
    let (halves, prepared) = (&bvh.leaves.halves[..], &mut None);
    let mut leaves = TriangleLeaves::<S, T, R, WATERTIGHT> { simd, halves, scaled, ray, prepared, sink };
    if T::ORDERED {
        walk::<S, _, _, true>(simd, &bvh.nodes, numbers, scaled.t_max, stack, &mut leaves);
    } else {
        walk::<S, _, _, false>(simd, &bvh.nodes, numbers, scaled.t_max, stack, &mut leaves);
    }
}

/// Tests the triangles of each leaf that a ray enters, eight at a time.
pub(super) struct TriangleLeaves<'a, S: Simd, T, R, const WATERTIGHT: bool> {
    pub(super) simd: S,
    pub(super) halves: &'a [HalfBlock],
    pub(super) scaled: &'a ScaledRay,
    pub(super) ray: R,
    /// The ray, from its first leaf on.
    pub(super) prepared: &'a mut Option<RayTriangles<S>>,
    pub(super) sink: &'a mut T,
}

impl<S: Simd, T: HitSink, R: ThroughTriangles, const WATERTIGHT: bool> Visitor
    for TriangleLeaves<'_, S, T, R, WATERTIGHT>
{
    const ALL: bool = T::ALL;

    #[inline(always)]
    fn leaf(&mut self, leaf: LeafRange) -> f32 {
        let &mut Self { simd, halves, scaled, ray, ref mut prepared, ref mut sink } = self;
        // Not with a closure, which might not be compiled for the instructions of the path.
        if prepared.is_none() {
            **prepared = Some(ray.prepare(simd));
        }
        let Some(prepared) = &**prepared else { unreachable!("it has just been set") };
        let LeafRange { first, n, mut t_max } = leaf;
        if let Some(visits) = sink.visits() {
            visits.leaf(n);
        }
        for (block, filled) in Blocks::new(halves, first, n) {
            let candidates = match (T::ANY, T::SPLITS) {
                (true, _) => block.candidates::<S, WATERTIGHT, true, false>(simd, prepared, t_max),
                (false, true) => block.candidates::<S, WATERTIGHT, false, true>(simd, prepared, t_max),
                (false, false) => block.candidates::<S, WATERTIGHT, false, false>(simd, prepared, t_max),
            };
            let mut mask = candidates.mask & filled;
            if T::ANY && candidates.sure & filled != 0 {
                return sink.take_any();
            }
            if let Some(visits) = sink.visits() {
                visits.exact(mask.count_ones());
            }
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let vertices = block.vertices(lane);
                let found = candidates.hit::<WATERTIGHT>(simd, prepared, scaled, (lane, &vertices), t_max);
                let Some(found) = found else { continue };
                let found = hit(found.t, [found.u, found.v], found.side, block.primitive(lane));
                t_max = if T::SPLITS && candidates.inside >> lane & 1 == 1 {
                    sink.take_inside(found, t_max)
                } else {
                    sink.take(scaled, found, &vertices, t_max)
                };
                if t_max < 0.0 {
                    return t_max;
                }
            }
        }
        t_max
    }

    #[inline(always)]
    fn prefetch(&self, first: u32) {
        prefetch_block(self.simd, self.halves, first);
    }

    #[inline(always)]
    fn node(&mut self, kind: NodeKind) {
        if let Some(visits) = self.sink.visits() {
            visits.node(kind);
        }
    }
}
