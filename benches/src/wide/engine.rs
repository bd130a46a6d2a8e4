//! Engines: what is compared, their builds, and several of them over the same rays, in turn every few milliseconds, so that drift
//! of the machine affects all.
//!
//! Holds: within a round every engine traces every ray once; the order is drawn anew for each chunk.

use anyhow::{Context, Result};
use canted_fixtures::SplitMix64;
use canted_lbvh::stages::{self, Stage};
use canted_trace::{Hit, Intersect, Ray};

use crate::timing::{self, Seconds, median};

/// A built BVH that traces rays in world space, on the calling thread.
pub(crate) trait Engine {
    /// The nearest hit of each ray; `side` is not used.
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]);

    /// Whether each ray hits anything.
    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]);

    /// Bytes of everything that tracing reads; `None` if an engine does not report it.
    fn n_bytes(&self) -> Option<usize> {
        None
    }
}

impl<B: Intersect> Engine for B {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.closest_hits(rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_many(rays, occluded);
    }
}

/// One of our structures that reports its bytes.
pub(crate) struct WithBytes<B>(pub(crate) B, pub(crate) usize);

impl<B: Intersect> Engine for WithBytes<B> {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.0.closest_hits(rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.0.occluded_many(rays, occluded);
    }

    fn n_bytes(&self) -> Option<usize> {
        Some(self.1)
    }
}

/// The origin of an engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    Ours,
    Peer,
}

/// The guarantee of its triangle test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Promise {
    /// Speed: rays may slip between neighbors.
    Fast,
    /// No ray slips between neighbors.
    Watertight,
}

/// An engine to build.
pub(crate) struct Entry<'a> {
    pub(crate) name: String,
    pub(crate) owner: Owner,
    pub(crate) promise: Promise,
    /// Whether it uses instances instead of flattening them.
    pub(crate) is_placed: bool,
    /// Whether it builds on more than one thread.
    pub(crate) is_parallel: bool,
    /// Builds on the given number of threads, inside a pool of that size.
    pub(crate) build: Build<'a>,
}

/// Builds on a number of threads.
pub(crate) type Build<'a> = Box<dyn Fn(usize) -> Result<Box<dyn Engine>> + Send + Sync + 'a>;

/// Builds of each engine on each number of threads; the median counts.
const REPEATS: usize = 3;
/// A build that takes longer than this is timed once, on one thread only.
const PATIENCE_SECONDS: f64 = 2.5;

/// An engine's build time and memory.
#[derive(Clone, Debug)]
pub(crate) struct Built {
    /// Wall seconds on one thread.
    pub(crate) one_thread: f64,
    /// Wall seconds on two threads.
    pub(crate) two_threads: Option<f64>,
    /// Stages of the last build on two threads; none of engines of others.
    pub(crate) stages: Vec<Stage>,
    pub(crate) n_bytes: Option<usize>,
}

impl Built {
    /// The part of a build on two threads in which one works alone.
    pub(crate) fn serial_part(&self) -> Option<f64> {
        let sum = |of: fn(&Stage) -> f64| self.stages.iter().map(of).sum::<f64>();
        (!self.stages.is_empty()).then(|| sum(|stage| stage.serial_seconds) / sum(|stage| stage.seconds))
    }
}

/// An engine with the wall seconds of its builds.
struct Ready {
    engine: Box<dyn Engine>,
    one_thread: Vec<f64>,
    two_threads: Vec<f64>,
    stages: Vec<Stage>,
}

/// Builds all entries for tracing, and again for the clock where `is_thorough`; the caller's pool has one thread.
pub(crate) fn build_all(entries: &[Entry<'_>], is_thorough: bool) -> Result<Vec<(Box<dyn Engine>, Built)>> {
    let two = rayon::ThreadPoolBuilder::new().num_threads(2).build()?;
    let mut ready = entries.iter().map(first).collect::<Result<Vec<Ready>>>()?;
    for repeat in 0..REPEATS * usize::from(is_thorough) {
        for (entry, ready) in entries.iter().zip(&mut ready) {
            if ready.one_thread[0] > PATIENCE_SECONDS {
                continue;
            }
            if repeat > 0 {
                let (built, took) = timing::time(|| (entry.build)(1));
                drop(built?);
                ready.one_thread.push(took.wall);
            }
            if entry.is_parallel {
                let build = || stages::recorded(|| (entry.build)(2).map(drop));
                let ((built, stages), took) = two.install(|| timing::time(build));
                built?;
                ready.two_threads.push(took.wall);
                // A build that names no stage is one of others.
                ready.stages = if stages.len() > 1 { stages } else { vec![] };
            }
        }
    }
    Ok(ready.into_iter().map(Ready::finish).collect())
}

fn first(entry: &Entry<'_>) -> Result<Ready> {
    let (engine, took) = timing::time(|| (entry.build)(1));
    let engine = engine.with_context(|| format!("cannot build {}", entry.name))?;
    Ok(Ready { engine, one_thread: vec![took.wall], two_threads: vec![], stages: vec![] })
}

impl Ready {
    fn finish(self) -> (Box<dyn Engine>, Built) {
        let built = Built {
            one_thread: median(&self.one_thread),
            two_threads: (!self.two_threads.is_empty()).then(|| median(&self.two_threads)),
            stages: self.stages,
            n_bytes: self.engine.n_bytes(),
        };
        (self.engine, built)
    }
}

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

/// Answers of one engine, or the true ones.
#[derive(PartialEq)]
pub(crate) enum Answers {
    Closest(Vec<Option<Hit>>),
    Occluded(Vec<bool>),
}

/// Nearest hits of all engines, or occlusion.
pub(crate) fn answers(
    engines: &[Box<dyn Engine>],
    rays: &[Ray],
    rounds: usize,
    is_occlusion: bool,
) -> (Vec<Vec<Seconds>>, Vec<Answers>) {
    if is_occlusion {
        let (seconds, all) = alternate(engines, rays, rounds, |engine, rays, answers| engine.occluded(rays, answers));
        (seconds, all.into_iter().map(Answers::Occluded).collect())
    } else {
        let (seconds, all) = closest(engines, rays, rounds);
        (seconds, all.into_iter().map(Answers::Closest).collect())
    }
}

/// Seconds of processor time.
pub(crate) fn cpu(seconds: &[Seconds]) -> Vec<f64> {
    seconds.iter().map(|seconds| seconds.cpu).collect()
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
    // An engine that runs after the largest structure finds cold caches: in a fixed order, also a cyclic one, it takes 5 to 10 % longer.
    let (mut order, mut rng): (Vec<usize>, _) = ((0..n).collect(), SplitMix64::new(n as u64));
    // Round 0 warms the caches and yields the answers.
    for round in 0..=rounds {
        for (chunk, rays) in rays.chunks(CHUNK).enumerate() {
            for place in 0..n {
                order.swap(place, place + rng.below(n - place));
                let engine = order[place];
                let out = match round {
                    0 => &mut answers[engine][chunk * CHUNK..][..rays.len()],
                    _ => &mut scratch[..rays.len()],
                };
                let ((), took) = timing::time(|| ask(&*engines[engine], rays, out));
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
        for answers in answers(&engines, &rays, 1, true).1 {
            let Answers::Occluded(occluded) = answers else { panic!("occlusion was asked for") };
            assert_eq!(occluded.iter().filter(|&&is| !is).count(), 6);
        }
    }
}
