//! Several engines over the same rays, in turn every few milliseconds, so that drift of the machine affects all.
//!
//! Reads: built engines, rays. Writes: seconds of each engine and round; the answers of the first round, unmeasured.
//! Holds: within a round every engine traces every ray once; the order changes from chunk to chunk.

use canted_trace::{Hit, Ray};

use super::engine::Engine;
use crate::clock::{self, Seconds};

/// Rays between two changes of engine. Chunks of 65,536 give the same ratios with four times the spread.
const CHUNK: usize = 8192;

/// Nearest hits of all engines.
pub(crate) fn closest(
    engines: &[Box<dyn Engine>],
    rays: &[Ray],
    rounds: usize,
) -> (Vec<Vec<Seconds>>, Vec<Vec<Option<Hit>>>) {
    alternate(engines, rays, rounds, |engine, rays, hits| engine.closest(rays, hits))
}

/// Occlusion of all engines.
pub(crate) fn occluded(
    engines: &[Box<dyn Engine>],
    rays: &[Ray],
    rounds: usize,
) -> (Vec<Vec<Seconds>>, Vec<Vec<bool>>) {
    alternate(engines, rays, rounds, |engine, rays, occluded| engine.occluded(rays, occluded))
}

/// Seconds by engine and round, and the answers by engine.
fn alternate<A: Copy + Default>(
    engines: &[Box<dyn Engine>],
    rays: &[Ray],
    rounds: usize,
    ask: impl Fn(&dyn Engine, &[Ray], &mut [A]),
) -> (Vec<Vec<Seconds>>, Vec<Vec<A>>) {
    let n = engines.len();
    let mut answers = vec![vec![A::default(); rays.len()]; n];
    let mut scratch = vec![A::default(); CHUNK.min(rays.len())];
    let mut seconds = vec![vec![Seconds::default(); rounds]; n];
    // Round 0 warms the caches and yields the answers.
    for round in 0..=rounds {
        for (chunk, rays) in rays.chunks(CHUNK).enumerate() {
            for place in 0..n {
                let engine = (place + chunk + round) % n;
                let out = match round {
                    0 => &mut answers[engine][chunk * CHUNK..][..rays.len()],
                    _ => &mut scratch[..rays.len()],
                };
                let ((), took) = clock::time(|| ask(&*engines[engine], rays, out));
                if let Some(round) = round.checked_sub(1) {
                    let sum = &mut seconds[engine][round];
                    *sum = Seconds { wall: sum.wall + took.wall, cpu: sum.cpu + took.cpu };
                }
            }
        }
    }
    (seconds, answers)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use canted_obb::PrimId;
    use canted_trace::{InstanceId, Side};

    use super::*;

    /// Hits each ray at its own `t_max`, and counts rays.
    struct Echo<'a>(&'a Cell<usize>);

    impl Engine for Echo<'_> {
        fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
            self.0.set(self.0.get() + rays.len());
            for (ray, hit) in rays.iter().zip(hits) {
                let (primitive, instance) = (PrimId(0), InstanceId(0));
                *hit = Some(Hit { t: ray.t_max, u: 0.0, v: 0.0, primitive, instance, side: Side::Front });
            }
        }

        fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
            for (ray, occluded) in rays.iter().zip(occluded) {
                *occluded = ray.t_max > 5.0;
            }
        }
    }

    #[test]
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    fn every_engine_answers_every_ray_each_round() {
        let rays: Vec<Ray> =
            (0..20_000).map(|i| Ray { t_max: i as f32, ..Ray::new([0.0; 3], [1.0, 0.0, 0.0]) }).collect();
        let counts: &'static [Cell<usize>; 2] = Box::leak(Box::default());
        let engines: Vec<Box<dyn Engine>> = vec![Box::new(Echo(&counts[0])), Box::new(Echo(&counts[1]))];
        let (seconds, hits) = closest(&engines, &rays, 3);
        assert!(counts.iter().all(|count| count.get() == 4 * rays.len()));
        assert!(seconds.iter().all(|rounds| rounds.len() == 3));
        for hits in hits {
            assert!(hits.iter().zip(&rays).all(|(hit, ray)| hit.is_some_and(|hit| hit.t == ray.t_max)));
        }
        let (_, occluded) = occluded(&engines, &rays, 1);
        assert!(occluded.iter().all(|answers| answers.iter().filter(|&&is| !is).count() == 6));
    }
}
