//! Rays through a BVH over primitives of the caller.

use canted_obb::{Obb, PrimId};
use canted_trace::{Accept, AcceptAt, Answer, Answers, Hit, Intersect, Query, Ray, ScaledRay, with_stack};

use super::boxes::Order;
use super::sink::{AllHits, AnyHit, BestHit};
use crate::bvh::WideBvh;
use crate::leaf::{Primitive, PrimitiveHit, hit, is_filtered};
use crate::simd::{Simd, Task};
use crate::traverse::{Pads, TracedRay, for_each_of_eight};

impl<P: Primitive> Intersect for WideBvh<P> {
    fn bounds(&self) -> Obb {
        Self::bounds(self)
    }

    fn is_empty(&self) -> bool {
        self.n_primitives == 0
    }

    fn hit_error(&self) -> f32 {
        P::ERROR
    }

    fn has_local_error(&self) -> bool {
        P::IS_LOCAL
    }

    fn stack_len(&self) -> usize {
        self.nodes.stack_len()
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> Option<Hit> {
        self.closest(&self.prepare(ray), query, stack)
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        self.occluded_by(&self.prepare(ray), query, stack)
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        self.every(&self.prepare(ray), query, stack, hits);
    }

    fn answer(&self, rays: &[Ray], first: usize, accept: Option<&AcceptAt>, mut answers: Answers) {
        with_stack(self.stack_len(), |stack| {
            for_each_of_eight(self.path, rays, &self.frame, Pads::of(P::ERROR), &mut |i, traced| {
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
                        Answer::Closest(hit) => *hit = self.closest(ray, query, stack),
                        Answer::Occluded(occluded) => *occluded = self.occluded_by(ray, query, stack),
                        Answer::All(hits) => self.every(ray, query, stack, hits),
                    }
                });
            });
        });
    }
}

impl<P: Primitive> WideBvh<P> {
    fn prepare(&self, ray: &ScaledRay) -> TracedRay {
        TracedRay::new(ray, &self.frame, Pads::of(P::ERROR))
    }

    fn closest(&self, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64]) -> Option<Hit> {
        let mut best = BestHit::<false>::new(query);
        best.visits = if is_filtered::<P>() {
            self.search(ray, stack, &mut best)
        } else {
            self.visit(ray, Order::Nearest, stack, &mut |id, t_max| {
                self.test(id, &ray.scaled, t_max, |ray, hit, t_max| best.take_hit(ray, hit, t_max))
            })
        };
        best.hit(&ray.scaled)
    }

    fn occluded_by(&self, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        let mut any = AnyHit::<false>::new(query);
        any.visits = if is_filtered::<P>() {
            self.search(ray, stack, &mut any)
        } else {
            self.visit(ray, Order::Any, stack, &mut |id, t_max| {
                self.test(id, &ray.scaled, t_max, |ray, hit, t_max| any.take_hit(ray, hit, t_max))
            })
        };
        any.found()
    }

    fn every(&self, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        let mut all = AllHits::new(query, hits);
        let visits = self.visit(ray, Order::Any, stack, &mut |id, t_max| {
            self.test(id, &ray.scaled, t_max, |ray, hit, t_max| all.take_hit(ray, hit, t_max))
        });
        all.visits = visits;
        all.finish(&ray.scaled);
    }

    /// Passes on the hits on a primitive, one after another: the first may be rejected.
    #[inline]
    fn test(
        &self,
        id: PrimId,
        ray: &ScaledRay,
        mut t_max: f32,
        mut take: impl FnMut(&ScaledRay, Hit, f32) -> f32,
    ) -> f32 {
        let primitive = &self.leaves.primitives[id.index()];
        // With the instructions of the path, which change no bit.
        let intersect = |ray: &ScaledRay, t_max: f32| self.path.run(Test { primitive, ray, t_max });
        let Some(mut found) = intersect(ray, t_max) else { return t_max };
        let mut ray = *ray;
        loop {
            // A primitive that breaks its contract must not keep the traversal from ending.
            if !(ray.t_min <= found.t && found.t <= t_max && found.t.is_finite()) {
                break;
            }
            t_max = take(&ray, hit(found.t, [found.u, found.v], found.side, id), t_max);
            ray.t_min = found.t.next_up();
            if ray.t_min > t_max {
                break;
            }
            match intersect(&ray, t_max) {
                Some(next) => found = next,
                None => break,
            }
        }
        t_max
    }
}

/// The test of one primitive.
struct Test<'a, P> {
    primitive: &'a P,
    ray: &'a ScaledRay,
    t_max: f32,
}

impl<P: Primitive> Task for Test<'_, P> {
    type Output = Option<PrimitiveHit>;

    #[inline(always)]
    fn on<S: Simd>(self, _: S) -> Self::Output {
        self.primitive.intersect(self.ray, self.t_max)
    }
}
