//! Slices of rays: eight are prepared for the top level at once.
//!
//! Answers are those of single rays. Only a wide top level of one class of instances prepares rays together, and only rays whose interval is exact
//! after scaling: the others are traced one by one.

use canted_trace::{Answers, Hit, Intersect, Ray, ScaledRay, WorldRay, answer_one_by_one, with_stack};
use canted_wide::{Prepared, PreparedRays};

use crate::Tlas;
use crate::top::{PreparedRay, SingleClass};

/// Rays that are prepared at once.
const EIGHT: usize = 8;

impl<B: Intersect> Tlas<B> {
    /// The closest hit of each ray.
    pub(crate) fn closest_of_slice(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        let Some(top) = self.top.single_class() else {
            return answer_one_by_one(self, rays, 0, None, Answers::Closest(hits));
        };
        let alone = |ray: &ScaledRay, stack: &mut [u64]| self.closest_hit_scaled(ray, &mut (), stack);
        self.each_of_slice(&top, rays, hits, alone, |prepared, top_stack, bottom| {
            let ray = WorldRay::new(prepared.ray);
            self.closest(&ray, &mut (), (top_stack, bottom), (&top, prepared))
        });
    }

    /// Whether each ray hits anything.
    pub(crate) fn occluded_of_slice(&self, rays: &[Ray], occluded: &mut [bool]) {
        let Some(top) = self.top.single_class() else {
            return answer_one_by_one(self, rays, 0, None, Answers::Occluded(occluded));
        };
        let alone = |ray: &ScaledRay, stack: &mut [u64]| self.occluded_scaled(ray, &mut (), stack);
        self.each_of_slice(&top, rays, occluded, alone, |prepared, top_stack, bottom| {
            let ray = WorldRay::new(prepared.ray);
            self.any(&ray, &mut (), (top_stack, bottom), (&top, prepared))
        });
    }

    /// Answers each ray by `together` if it is prepared with others, else by `alone`. `together` gets the memory of the top level and that of the levels
    /// below, `alone` all of it.
    #[inline(always)]
    fn each_of_slice<A: Default>(
        &self,
        top: &SingleClass<'_>,
        rays: &[Ray],
        answers: &mut [A],
        alone: impl Fn(&ScaledRay, &mut [u64]) -> A,
        together: impl Fn(&PreparedRay<'_>, &mut [u64], &mut [u64]) -> A,
    ) {
        let mut eight = PreparedRays::default();
        with_stack(self.stack_len(), |stack| {
            for (rays, answers) in rays.chunks(EIGHT).zip(answers.chunks_mut(EIGHT)) {
                let is_prepared = top.prepare(rays, &mut eight);
                for (i, (given, answer)) in rays.iter().zip(answers).enumerate() {
                    // Not an answer of all three, which would be in memory first: what is written in parts is read as a whole only once it
                    // has arrived.
                    match if is_prepared { eight.ray(i) } else { Prepared::Alone } {
                        Prepared::Misses => *answer = A::default(),
                        Prepared::Alone => {
                            *answer = ScaledRay::new(given).map_or_else(A::default, |ray| alone(&ray, stack));
                        }
                        Prepared::Together => {
                            let (ray, t_max) = eight.parts(i, given);
                            let (top_stack, bottom) = stack.split_at_mut(top.stack_len());
                            *answer = together(&PreparedRay { ray: &ray, of: &eight, i, t_max }, top_stack, bottom);
                        }
                    }
                }
            }
        });
    }
}
