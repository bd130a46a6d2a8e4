//! Rays through a BVH over triangles.
//!
//! From [`Intersect::closest_hit`] to the triangle test: `closest_hit_scaled` below runs [`PlainClosest`] with the instructions of the SIMD
//! path, [`pass_hits`] prepares the ray for eight boxes and triangles at a time, `walk` visits the leaves, and `TriangleLeaves` tests the
//! triangles of one. Queries that filter or count, and other triangle tests, run [`PassHits`] instead, after one match.

use canted_obb::Obb;
use canted_trace::{
    Accept, AcceptAt, Answer, Answers, Hit, InstanceId, Intersect, PlacedRay, Query, Ray, ScaledRay, TriangleTest,
    with_stack,
};

use super::pass::{pass_hits, pass_plain};
use super::sink::{AllHits, AnyHit, BestHit, HitSink, TraversalCounts, Visits};
use super::slices::{AllOfSlice, Slice, stack_len_of_slice};
use crate::bvh::TriangleBvh;
use crate::simd::{Simd, Task};
use crate::traverse::{Pads, TracedRay, for_each_of_eight};

impl Intersect for TriangleBvh {
    fn bounds(&self) -> Obb {
        Self::bounds(self)
    }

    fn is_empty(&self) -> bool {
        self.n_primitives == 0
    }

    fn support(&self, direction: [f64; 3]) -> Option<f64> {
        Some(self.farthest_along(direction))
    }

    fn hit_error(&self) -> f32 {
        self.leaves.test.hit_error()
    }

    fn has_local_error(&self) -> bool {
        true
    }

    fn stack_len(&self) -> usize {
        self.nodes.stack_len()
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> Option<Hit> {
        if self.is_plain(query) {
            return self.path.run(PlainClosest { bvh: self, ray, stack });
        }
        self.closest(&self.prepare(ray), query, stack).0
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        if self.is_plain(query) {
            return self.path.run(PlainOccluded { bvh: self, ray, stack });
        }
        self.occluded_by(&self.prepare(ray), query, stack)
    }

    fn closest_hit_placed(
        &self,
        ray: &PlacedRay,
        instance: InstanceId,
        query: &mut dyn Query,
        stack: &mut [u64],
    ) -> Option<(f64, Hit)> {
        if self.is_plain(query) {
            return self.path.run(PlacedClosest { bvh: self, ray, instance, stack });
        }
        ray.object()?.closest_hit(query, instance, |ray, query| self.closest_hit_scaled(ray, query, stack))
    }

    fn occluded_placed(&self, ray: &PlacedRay, instance: InstanceId, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        if self.is_plain(query) {
            return self.path.run(PlacedOccluded { bvh: self, ray, stack });
        }
        ray.object().is_some_and(|object| {
            object.occluded(query, instance, |ray, query| self.occluded_scaled(ray, query, stack))
        })
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        self.every(&self.prepare(ray), query, stack, hits);
    }

    fn answer(&self, rays: &[Ray], first: usize, accept: Option<&AcceptAt>, mut answers: Answers) {
        with_stack(stack_len_of_slice(self, rays.len()), |stack| {
            let (bvh, is_plain) = (self, accept.is_none());
            if self.leaves.test == TriangleTest::Watertight {
                return match answers {
                    Answers::Closest(answers) if is_plain => {
                        self.path.run(Slice::<true, _> { bvh, rays, first, accept, answers, stack });
                    }
                    Answers::Occluded(answers) if is_plain => {
                        self.path.run(Slice::<true, _> { bvh, rays, first, accept, answers, stack });
                    }
                    Answers::Closest(answers) => {
                        self.path.run(Slice::<false, _> { bvh, rays, first, accept, answers, stack });
                    }
                    Answers::Occluded(answers) => {
                        self.path.run(Slice::<false, _> { bvh, rays, first, accept, answers, stack });
                    }
                    answers => self.path.run(AllOfSlice { bvh, rays, first, accept, answers, stack }),
                };
            }
            for_each_of_eight(self.path, rays, &self.frame, self.pads(), &mut |i, traced| {
                answers.fill(i, |answer| {
                    let Some(ray) = traced else { return };
                    let mut filter;
                    let query: &mut dyn Query = match accept {
                        None => &mut (),
                        Some(accept) => {
                            filter = Accept(|hit: &Hit| accept(first + i, &rays[i], hit));
                            &mut filter
                        }
                    };
                    match answer {
                        Answer::Closest(hit) => *hit = self.closest(ray, query, stack).0,
                        Answer::Occluded(occluded) => *occluded = self.occluded_by(ray, query, stack),
                        Answer::All(hits) => self.every(ray, query, stack, hits),
                    }
                });
            });
        });
    }
}

impl TriangleBvh {
    /// The triangle test that rays are traced with.
    #[must_use]
    pub fn test(&self) -> TriangleTest {
        self.leaves.test
    }

    /// Counts what the search for the closest hit of each ray visits.
    #[must_use]
    pub fn traversal_counts(&self, rays: &[Ray]) -> TraversalCounts {
        let mut counts = TraversalCounts::default();
        with_stack(self.stack_len(), |stack| {
            for ray in rays.iter().filter_map(ScaledRay::new) {
                let (_, visits) = self.closest(&self.prepare(&ray), &mut (), stack);
                counts.add(&visits.counts);
            }
        });
        counts
    }

    /// Whether the query is one that has a traversal of its own: it accepts every hit, counts nothing, and the triangle test is the
    /// default.
    #[inline]
    fn is_plain(&self, query: &dyn Query) -> bool {
        self.leaves.test == TriangleTest::Watertight && query.is_plain()
    }

    /// Relative pads of box tests.
    #[inline(always)]
    pub(crate) fn pads(&self) -> Pads {
        Pads::of(self.leaves.test.hit_error())
    }

    #[inline(always)]
    pub(crate) fn prepare(&self, ray: &ScaledRay) -> TracedRay {
        TracedRay::new(ray, &self.frame, self.pads())
    }

    pub(super) fn closest(&self, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64]) -> (Option<Hit>, Visits) {
        let mut best = BestHit::<false>::new(query);
        self.pass_hits(ray, &mut best, stack);
        let visits = best.visits;
        (best.hit(&ray.scaled), visits)
    }

    fn occluded_by(&self, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        self.any(ray, query, stack).0
    }

    /// Whether there is a hit, and the work.
    pub(super) fn any(&self, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64]) -> (bool, Visits) {
        let mut any = AnyHit::<false>::new(query);
        self.pass_hits(ray, &mut any, stack);
        let visits = any.visits;
        (any.found(), visits)
    }

    fn every(&self, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        let mut all = AllHits::new(query, hits);
        self.pass_hits(ray, &mut all, stack);
        all.finish(&ray.scaled);
    }

    /// Passes all hits of a ray to `sink`.
    fn pass_hits<T: HitSink>(&self, ray: &TracedRay, sink: &mut T, stack: &mut [u64]) {
        match self.leaves.test {
            TriangleTest::Watertight => self.path.run(PassHits::<T, true> { bvh: self, ray, sink, stack }),
            TriangleTest::MollerTrumbore | TriangleTest::BaldwinWeber => {
                self.path.run(PassHits::<T, false> { bvh: self, ray, sink, stack });
            }
        }
    }
}

/// The closest hit of one ray under a query that is plain.
struct PlainClosest<'a> {
    bvh: &'a TriangleBvh,
    ray: &'a ScaledRay,
    stack: &'a mut [u64],
}

impl Task for PlainClosest<'_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Option<Hit> {
        let mut query = ();
        let mut best = BestHit::<true>::new(&mut query);
        pass_plain(simd, self.bvh, self.ray, self.stack, &mut best);
        best.hit(self.ray)
    }
}

/// The closest hit of an instance under a query that is plain.
struct PlacedClosest<'a> {
    bvh: &'a TriangleBvh,
    ray: &'a PlacedRay<'a>,
    instance: InstanceId,
    stack: &'a mut [u64],
}

impl Task for PlacedClosest<'_> {
    type Output = Option<(f64, Hit)>;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Option<(f64, Hit)> {
        let object = self.ray.object_by(simd.four())?;
        let mut query = ();
        let mut best = BestHit::<true>::new(&mut query);
        pass_plain(simd, self.bvh, &object.ray, self.stack, &mut best);
        let hit = best.best?;
        Some((object.world_t(hit.t), Hit { instance: self.instance, ..hit }))
    }
}

/// Whether an instance is hit under a query that is plain.
struct PlacedOccluded<'a> {
    bvh: &'a TriangleBvh,
    ray: &'a PlacedRay<'a>,
    stack: &'a mut [u64],
}

impl Task for PlacedOccluded<'_> {
    type Output = bool;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> bool {
        let Some(object) = self.ray.object_by(simd.four()) else { return false };
        let mut query = ();
        let mut any = AnyHit::<true>::new(&mut query);
        pass_plain(simd, self.bvh, &object.ray, self.stack, &mut any);
        any.found()
    }
}

/// Whether one ray is occluded under a query that is plain.
struct PlainOccluded<'a> {
    bvh: &'a TriangleBvh,
    ray: &'a ScaledRay,
    stack: &'a mut [u64],
}

impl Task for PlainOccluded<'_> {
    type Output = bool;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> bool {
        let mut query = ();
        let mut any = AnyHit::<true>::new(&mut query);
        pass_plain(simd, self.bvh, self.ray, self.stack, &mut any);
        any.found()
    }
}

/// Passes all hits of a ray to a sink; the triangle test is the default where `WATERTIGHT`.
struct PassHits<'a, T, const WATERTIGHT: bool> {
    bvh: &'a TriangleBvh,
    ray: &'a TracedRay,
    sink: &'a mut T,
    stack: &'a mut [u64],
}

impl<T: HitSink, const WATERTIGHT: bool> Task for PassHits<'_, T, WATERTIGHT> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        pass_hits::<S, T, WATERTIGHT>(simd, self.bvh, self.ray, self.stack, self.sink);
    }
}
