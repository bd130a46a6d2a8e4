//! Rays through a BVH over primitives of the caller.

use canted_obb::Obb;
use canted_trace::{Accept, AcceptAt, Answer, Answers, Hit, Intersect, Query, Ray, ScaledRay, with_stack};

use super::sink::{AllHits, AnyHit, BestHit};
use crate::bvh::WideBvh;
use crate::leaf::Primitive;
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
        self.search(ray, stack, &mut best);
        best.hit(&ray.scaled)
    }

    fn occluded_by(&self, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        let mut any = AnyHit::<false>::new(query);
        self.search(ray, stack, &mut any);
        any.found()
    }

    fn every(&self, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        let mut all = AllHits::new(query, hits);
        self.search(ray, stack, &mut all);
        all.finish(&ray.scaled);
    }
}
