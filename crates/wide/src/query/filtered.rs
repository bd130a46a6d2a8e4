//! Rays through the leaves of a BVH over primitives of the caller. Where these have hulls, leaves test eight hulls at once, and then the
//! primitives that the ray may reach, in this order.

use std::ops::Range;

use canted_obb::PrimId;
use canted_trace::ScaledRay;

use super::boxes::Order;
use super::sink::{HitSink, Visits};
use crate::bvh::WideBvh;
use crate::leaf::{Primitive, PrimitiveHit, Shapes, hit, is_filtered};
use crate::node::NodeKind;
use crate::simd::{Simd, Task};
use crate::traverse::{LeafRange, RayLine, Reached, TracedRay, VisitLane, Visitor, numbers, numbers_of_ball, walk};

impl<P: Primitive> WideBvh<P> {
    /// Calls `visit` with the primitives of each leaf that a ray enters, of a large leaf with those whose hulls it may reach; the work.
    pub(super) fn visit(
        &self,
        ray: &TracedRay,
        order: Order,
        stack: &mut [u64],
        visit: &mut dyn FnMut(&P, PrimId, f32) -> f32,
    ) -> Visits {
        let mut visits = Visits::default();
        let counted = &mut visits;
        match order {
            Order::Nearest => {
                self.path.run(Filtered { bvh: self, ray, stack, test: Called::<P, true> { visit, visits: counted } })
            }
            Order::Any => {
                self.path.run(Filtered { bvh: self, ray, stack, test: Called::<P, false> { visit, visits: counted } })
            }
        }
        visits
    }

    /// Passes the hits of a ray to a sink, tested with the instructions of the path inside of the traversal.
    pub(super) fn search(&self, ray: &TracedRay, stack: &mut [u64], sink: &mut impl HitSink) {
        self.path.run(Filtered { bvh: self, ray, stack, test: Tested { ray: &ray.scaled, sink } });
    }
}

/// What is done with a primitive that the ray may hit.
trait Test<P> {
    /// Whether nearer subtrees are visited first.
    const ORDERED: bool;

    /// Whether hits that are certain go to [`Test::take_any`].
    #[inline(always)]
    fn takes_any(&self) -> bool {
        false
    }

    /// Takes a hit that is certain. Returns a negative number.
    #[inline(always)]
    fn take_any(&mut self) -> f32 {
        unreachable!("the test needs hits")
    }

    /// Where the work is counted, if it is.
    fn visits(&mut self) -> Option<&mut Visits>;

    /// Returns the new `t_max`; a negative number ends the traversal.
    fn test<S: Simd>(&mut self, simd: S, primitive: &P, id: PrimId, t_max: f32) -> f32;
}

/// Calls a function.
struct Called<'a, P, const ORDERED: bool> {
    visit: &'a mut dyn FnMut(&P, PrimId, f32) -> f32,
    visits: &'a mut Visits,
}

impl<P, const ORDERED: bool> Test<P> for Called<'_, P, ORDERED> {
    const ORDERED: bool = ORDERED;

    #[inline(always)]
    fn visits(&mut self) -> Option<&mut Visits> {
        Some(self.visits)
    }

    #[inline(always)]
    fn test<S: Simd>(&mut self, _: S, primitive: &P, id: PrimId, t_max: f32) -> f32 {
        (self.visit)(primitive, id, t_max)
    }
}

/// Tests the primitive itself.
struct Tested<'a, K> {
    ray: &'a ScaledRay,
    sink: &'a mut K,
}

impl<P: Primitive, K: HitSink> Test<P> for Tested<'_, K> {
    const ORDERED: bool = K::ORDERED;

    #[inline(always)]
    fn takes_any(&self) -> bool {
        P::IS_HULL && self.sink.takes_any()
    }

    #[inline(always)]
    fn take_any(&mut self) -> f32 {
        self.sink.take_any()
    }

    #[inline(always)]
    fn visits(&mut self) -> Option<&mut Visits> {
        self.sink.visits()
    }

    #[inline(always)]
    fn test<S: Simd>(&mut self, simd: S, primitive: &P, id: PrimId, t_max: f32) -> f32 {
        let of = Intersect { primitive, ray: self.ray, t_max };
        // A test that is a large part of the code is compiled once for each path.
        let found = if const { P::BALL.is_some() } { of.on(simd) } else { simd.run(of) };
        let Some(found) = found else { return t_max };
        // A primitive that breaks its contract must not keep the traversal from ending.
        if !(self.ray.t_min <= found.t && found.t <= t_max && found.t.is_finite()) {
            return t_max;
        }
        let t_max = self.sink.take(self.ray, hit(found.t, [found.u, found.v], found.side, id), &NO_VERTICES, t_max);
        let t_min = found.t.next_up();
        if t_min > t_max { t_max } else { self.rest(primitive, id, t_min, t_max) }
    }
}

/// The test of one primitive, with the instructions of the path, which change no bit.
struct Intersect<'a, P> {
    primitive: &'a P,
    ray: &'a ScaledRay,
    t_max: f32,
}

impl<P: Primitive> Task for Intersect<'_, P> {
    type Output = Option<PrimitiveHit>;

    #[inline(always)]
    fn on<S: Simd>(self, _: S) -> Option<PrimitiveHit> {
        self.primitive.intersect(self.ray, self.t_max)
    }
}

/// Hits on primitives have no vertices.
const NO_VERTICES: [[f32; 3]; 3] = [[0.0; 3]; 3];

impl<K: HitSink> Tested<'_, K> {
    /// Passes on the hits from `t_min` on: the first was rejected.
    #[cold]
    fn rest<P: Primitive>(&mut self, primitive: &P, id: PrimId, t_min: f32, mut t_max: f32) -> f32 {
        let mut ray = *self.ray;
        ray.t_min = t_min;
        while let Some(found) = primitive.intersect(&ray, t_max) {
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
    stack: &'a mut [u64],
    test: T,
}

impl<P: Primitive, T: Test<P>> Task for Filtered<'_, P, T> {
    type Output = ();

    // The work is counted in place: a copy would wait for what was just written number by number.
    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let Self { bvh, ray, stack, test } = self;
        // `const`: the branch that a type never takes is not compiled.
        let line = if const { P::BALL.is_some() } {
            RayLine::to_balls(simd, &ray.scaled)
        } else {
            RayLine::to_segments(simd, &ray.scaled)
        };
        let mut leaves = Leaves { simd, shapes: &bvh.leaves, line, test };
        let t_max = ray.scaled.t_max;
        if T::ORDERED {
            walk::<S, _, _, true>(simd, &bvh.nodes, &ray.numbers, t_max, stack, &mut leaves);
        } else {
            walk::<S, _, _, false>(simd, &bvh.nodes, &ray.numbers, t_max, stack, &mut leaves);
        }
    }
}

/// Up to so many primitives of a leaf are cheaper to test than their hulls; balls never.
const FEW: u32 = 1;

/// Tests the hulls of leaves, eight at a time.
struct Leaves<'a, S: Simd, P, T> {
    simd: S,
    shapes: &'a Shapes<P>,
    line: RayLine<S>,
    test: T,
}

impl<S: Simd, P: Primitive, T: Test<P>> Leaves<'_, S, P, T> {
    /// Which of up to eight primitives, from a place on, the ray may reach.
    #[inline(always)]
    fn reached(&self, first: usize, n: usize, t_max: f32) -> Reached<S> {
        let Self { simd, shapes, line, .. } = self;
        let of = (1 << n) - 1;
        let copies;
        // Always eight, where there are as many, of the next leaf if this one has fewer: a loop of unknown length takes longer.
        let [low, high] = match shapes.eight(first) {
            Some(eight) => halves(*simd, eight),
            None => {
                copies = repeated(shapes, first, n);
                halves(*simd, &copies)
            }
        };
        let ([ax, ay, az, bx], [by, bz, r0, r1]) = (simd.transpose_half(low), simd.transpose_half(high));
        if const { P::BALL.is_some() } {
            return line.near_balls(*simd, [ax, ay, az, bx], of, t_max, T::ORDERED);
        }
        line.near_segments(*simd, [ax, ay, az, bx, by, bz, r0, r1], of, t_max, T::ORDERED)
    }

    /// Tests the primitives of a leaf whose hulls the ray may reach.
    #[inline(always)]
    fn leaf_by_eights(&mut self, places: Range<usize>, mut t_max: f32) -> f32 {
        for first in places.clone().step_by(8) {
            let reached = self.reached(first, (places.end - first).min(8), t_max);
            if reached.certain != 0 && self.test.takes_any() {
                return self.test.take_any();
            }
            let mut test = TestLane { simd: self.simd, first, shapes: self.shapes, test: &mut self.test };
            t_max = reached.each(self.simd, t_max, &mut test);
            if t_max < 0.0 {
                break;
            }
        }
        t_max
    }
}

/// Up to eight primitives of a leaf that are not one after another in memory, or at its end; the first again where there are fewer.
#[cold]
#[inline(never)]
fn repeated<P>(shapes: &Shapes<P>, first: usize, n: usize) -> [&P; 8] {
    std::array::from_fn(|k| shapes.at(first + if k < n { k } else { 0 }))
}

/// The numbers of the balls or the segments around primitives, in rows of four: those of balls, or of the first parts of segments; those
/// of the second parts.
#[inline(always)]
fn halves<S: Simd, P: Primitive>(simd: S, primitives: &[P; 8]) -> [[S::F; 8]; 2] {
    let (mut low, mut high) = ([simd.splat(0.0); 8], [simd.splat(0.0); 8]);
    for k in 0..8 {
        if let Some(ball) = P::BALL {
            low[k] = simd.load_half(&numbers_of_ball(&ball(&primitives[k])));
        } else if let Some(hull) = P::HULL {
            let [a, b, c, d, e, f, g, h] = numbers(&hull(&primitives[k]));
            (low[k], high[k]) = (simd.load_half(&[a, b, c, d]), simd.load_half(&[e, f, g, h]));
        }
    }
    [low, high]
}

impl<S: Simd, P: Primitive, T: Test<P>> Visitor for Leaves<'_, S, P, T> {
    /// Programs compile the loop for each of their primitives, query and path.
    const TWO_LOOPS: bool = P::IS_HULL;

    #[inline(always)]
    fn leaf(&mut self, LeafRange { first, n, mut t_max }: LeafRange) -> f32 {
        if let Some(visits) = self.test.visits() {
            visits.leaf(n);
        }
        let (first, end) = (first as usize, (first + n) as usize);
        if const { is_filtered::<P>() } && (const { P::BALL.is_some() } || n > FEW) {
            return self.leaf_by_eights(first..end, t_max);
        }
        for (place, &id) in (first..end).zip(&self.shapes.order[first..end]) {
            t_max = self.test.test(self.simd, self.shapes.at(place), id, t_max);
            if t_max < 0.0 {
                break;
            }
        }
        t_max
    }

    #[inline(always)]
    fn node(&mut self, kind: NodeKind) {
        if let Some(visits) = self.test.visits() {
            visits.node(kind);
        }
    }
}

/// Tests the primitive of a lane.
struct TestLane<'a, S, P, T> {
    simd: S,
    /// The place of the first lane.
    first: usize,
    shapes: &'a Shapes<P>,
    test: &'a mut T,
}

impl<S: Simd, P: Primitive, T: Test<P>> VisitLane for TestLane<'_, S, P, T> {
    #[inline(always)]
    fn lane(&mut self, lane: usize, t_max: f32) -> f32 {
        let place = self.first + lane;
        self.test.test(self.simd, self.shapes.at(place), self.shapes.order[place], t_max)
    }
}
