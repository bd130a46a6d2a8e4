//! Numbers of nodes and leaves that rays visit; [`Costs`](crate::Costs) are fitted to them.

use canted_trace::{Hit, InstanceId, Ray, ScaledRay};

use crate::bvh::WideBvh;
use crate::layout::NodeKind;
use crate::leaf::{HitSink, LeafPrimitive};
use crate::simd::{Simd, Task};
use crate::sink::BestHit;
use crate::trace::{prepare, trace};
use crate::traverse::Stack;

/// Visits by rays that search for their closest hit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalCounts {
    /// Nodes of each kind, in the order of [`NodeKind::ALL`].
    pub nodes: [u64; 2],
    /// Leaves.
    pub leaves: u64,
    /// Blocks of up to eight primitives.
    pub blocks: u64,
}

impl<P: LeafPrimitive> WideBvh<P> {
    /// Counts what [`WideBvh::closest_hits`] visits for these rays.
    #[must_use]
    pub fn traversal_counts(&self, rays: &[Ray]) -> TraversalCounts {
        self.path.run(Counting { bvh: self, rays })
    }
}

struct Counting<'a, P: LeafPrimitive> {
    bvh: &'a WideBvh<P>,
    rays: &'a [Ray],
}

impl<P: LeafPrimitive> Task for Counting<'_, P> {
    type Output = TraversalCounts;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> TraversalCounts {
        let mut counts = TraversalCounts::default();
        let mut stack = Stack::new();
        for ray in self.rays {
            let Some(scaled) = ScaledRay::new(ray) else { continue };
            let ray = prepare(self.bvh, scaled);
            let mut accept_all = ();
            let best = BestHit::new(&mut accept_all, InstanceId(0));
            trace(simd, self.bvh, &ray, &mut stack, &mut Counted { best, counts: &mut counts });
        }
        counts
    }
}

/// The closest hit, and what was visited to find it.
struct Counted<'a, 'q> {
    best: BestHit<'q, ()>,
    counts: &'a mut TraversalCounts,
}

impl<M: ?Sized> HitSink<M> for Counted<'_, '_> {
    const ORDERED: bool = true;

    #[inline(always)]
    fn take(&mut self, ray: &ScaledRay, hit: Hit, shape: &M, t_max: f32) -> f32 {
        self.best.take(ray, hit, shape, t_max)
    }

    #[inline(always)]
    fn primitives(&mut self, n: u32) {
        self.counts.leaves += 1;
        self.counts.blocks += u64::from(n.div_ceil(8));
    }

    #[inline(always)]
    fn node(&mut self, kind: NodeKind) {
        self.counts.nodes[kind as usize] += 1;
    }
}
