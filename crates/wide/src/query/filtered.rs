//! Rays through a BVH over primitives with hulls: leaves test eight hulls at once, and then the primitives that the ray may reach, in
//! this order.

use canted_obb::PrimId;
use canted_trace::ScaledRay;

use super::boxes::Order;
use super::sink::{HitSink, Visits};
use crate::bvh::WideBvh;
use crate::leaf::{Primitive, Shapes, hit};
use crate::node::NodeKind;
use crate::simd::{Simd, Task};
use crate::traverse::{LeafRange, RayLine, Reached, TracedRay, VisitLane, Visitor, numbers, numbers_of_ball, walk};

impl<P: Primitive> WideBvh<P> {
    /// Calls `visit` with the primitives of each leaf that a ray enters, of a large leaf with those whose hulls it may reach.
    pub(super) fn visit_filtered(
        &self,
        ray: &TracedRay,
        order: Order,
        stack: &mut [u64],
        visit: &mut dyn FnMut(PrimId, f32) -> f32,
    ) -> Visits {
        self.path.run(Filtered { bvh: self, ray, order, stack, test: Called(visit) })
    }

    /// Passes the hits of a ray to a sink, tested with the instructions of the path inside of the traversal; the work.
    pub(super) fn search(&self, ray: &TracedRay, stack: &mut [u64], sink: &mut impl HitSink) -> Visits {
        let order = if sink.is_ordered() { Order::Nearest } else { Order::Any };
        let test = Tested { primitives: &self.leaves.primitives, ray: &ray.scaled, sink };
        self.path.run(Filtered { bvh: self, ray, order, stack, test })
    }
}

/// What is done with a primitive that the ray may hit.
trait Test {
    /// Returns the new `t_max`; a negative number ends the traversal.
    fn test(&mut self, id: PrimId, t_max: f32) -> f32;
}

/// Calls a function.
struct Called<'a>(&'a mut dyn FnMut(PrimId, f32) -> f32);

impl Test for Called<'_> {
    #[inline(always)]
    fn test(&mut self, id: PrimId, t_max: f32) -> f32 {
        (self.0)(id, t_max)
    }
}

/// Tests the primitive itself.
struct Tested<'a, P, K> {
    primitives: &'a [P],
    ray: &'a ScaledRay,
    sink: &'a mut K,
}

impl<P: Primitive, K: HitSink> Test for Tested<'_, P, K> {
    #[inline(always)]
    fn test(&mut self, id: PrimId, t_max: f32) -> f32 {
        let Some(found) = self.primitives[id.index()].intersect(self.ray, t_max) else { return t_max };
        // A primitive that breaks its contract must not keep the traversal from ending.
        if !(self.ray.t_min <= found.t && found.t <= t_max && found.t.is_finite()) {
            return t_max;
        }
        let t_max = self.sink.take(self.ray, hit(found.t, [found.u, found.v], found.side, id), &NO_VERTICES, t_max);
        let t_min = found.t.next_up();
        if t_min > t_max { t_max } else { self.rest(id, t_min, t_max) }
    }
}

/// Hits on primitives have no vertices.
const NO_VERTICES: [[f32; 3]; 3] = [[0.0; 3]; 3];

impl<P: Primitive, K: HitSink> Tested<'_, P, K> {
    /// Passes on the hits from `t_min` on: the first was rejected.
    #[cold]
    fn rest(&mut self, id: PrimId, t_min: f32, mut t_max: f32) -> f32 {
        let mut ray = *self.ray;
        ray.t_min = t_min;
        while let Some(found) = self.primitives[id.index()].intersect(&ray, t_max) {
            if !(ray.t_min <= found.t && found.t <= t_max && found.t.is_finite()) {
                break;
            }
            let found_hit = hit(found.t, [found.u, found.v], found.side, id);
            t_max = self.sink.take(&ray, found_hit, &NO_VERTICES, t_max);
            ray.t_min = found.t.next_up();
            if ray.t_min > t_max {
                break;
            }
        }
        t_max
    }
}

struct Filtered<'a, P: Primitive, T> {
    bvh: &'a WideBvh<P>,
    ray: &'a TracedRay,
    order: Order,
    stack: &'a mut [u64],
    test: T,
}

impl<P: Primitive, T: Test> Task for Filtered<'_, P, T> {
    type Output = Visits;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Visits {
        let Self { bvh, ray, order, stack, test } = self;
        let Shapes { order: ids, primitives } = &bvh.leaves;
        let line = match P::BALL {
            Some(_) => RayLine::to_balls(simd, &ray.scaled),
            None => RayLine::to_segments(simd, &ray.scaled),
        };
        let mut leaves = Leaves { simd, ids, primitives, line, test, visits: Visits::default() };
        let t_max = ray.scaled.t_max;
        match order {
            Order::Nearest => walk::<S, true>(simd, &bvh.nodes, &ray.numbers, t_max, stack, &mut leaves),
            Order::Any => walk::<S, false>(simd, &bvh.nodes, &ray.numbers, t_max, stack, &mut leaves),
        }
        leaves.visits
    }
}

/// Up to so many primitives of a leaf are cheaper to test than their hulls; balls never.
const FEW: usize = 1;

/// Tests the hulls of leaves, eight at a time.
struct Leaves<'a, S: Simd, P, T> {
    simd: S,
    ids: &'a [PrimId],
    primitives: &'a [P],
    line: RayLine<S>,
    test: T,
    visits: Visits,
}

impl<S: Simd, P: Primitive, T: Test> Leaves<'_, S, P, T> {
    /// Which of up to eight primitives the ray may reach.
    #[inline(always)]
    fn reached(&self, ids: &[PrimId], t_max: f32) -> Reached<S> {
        let simd = self.simd;
        let mut rows = [simd.splat(0.0); 8];
        let mut reached = match P::BALL {
            Some(ball) => {
                // Always eight: a loop of unknown length takes longer, but for the wider rows of segments.
                let last = ids.len() - 1;
                for (k, row) in rows.iter_mut().enumerate() {
                    let primitive = &self.primitives[ids[last.min(k)].index()];
                    *row = simd.load_half(&numbers_of_ball(&ball(primitive)));
                }
                let [x, y, z, radius, ..] = simd.transpose(rows);
                self.line.near_balls(simd, [x, y, z, radius], t_max)
            }
            None => {
                let hull = P::HULL.expect("filtered primitives have a ball or a segment around them");
                for (row, id) in rows.iter_mut().zip(ids) {
                    *row = simd.load(&numbers(&hull(&self.primitives[id.index()])));
                }
                self.line.near_segments(simd, simd.transpose(rows), t_max)
            }
        };
        reached.lanes &= (1 << ids.len()) - 1;
        reached
    }
}

impl<S: Simd, P: Primitive, T: Test> Visitor for Leaves<'_, S, P, T> {
    #[inline(always)]
    fn leaf(&mut self, LeafRange { first, n, mut t_max }: LeafRange) -> f32 {
        self.visits.leaf(n);
        let ids = &self.ids[first as usize..(first + n) as usize];
        if P::BALL.is_none() && ids.len() <= FEW {
            for &id in ids {
                t_max = self.test.test(id, t_max);
                if t_max < 0.0 {
                    break;
                }
            }
            return t_max;
        }
        for ids in ids.chunks(8) {
            let reached = self.reached(ids, t_max);
            t_max = reached.each(self.simd, t_max, &mut TestLane { ids, test: &mut self.test });
            if t_max < 0.0 {
                break;
            }
        }
        t_max
    }

    #[inline(always)]
    fn node(&mut self, kind: NodeKind) {
        self.visits.node(kind);
    }
}

/// Tests the primitive of a lane.
struct TestLane<'a, T> {
    ids: &'a [PrimId],
    test: &'a mut T,
}

impl<T: Test> VisitLane for TestLane<'_, T> {
    #[inline(always)]
    fn lane(&mut self, lane: usize, t_max: f32) -> f32 {
        self.test.test(self.ids[lane], t_max)
    }
}
