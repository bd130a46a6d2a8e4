//! Building every engine, and what that takes.

use anyhow::{Context, Result};

use super::engine::{Engine, Entry};
use crate::{clock, interleave::median};

/// Builds of each engine on each number of threads; the median counts.
const REPEATS: usize = 3;
/// A build that takes longer than this is timed once, on one thread only.
const PATIENCE_SECONDS: f64 = 2.5;

/// An engine's build time and memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Built {
    /// Wall seconds on one thread.
    pub(crate) one_thread: f64,
    /// Wall seconds on two threads.
    pub(crate) two_threads: Option<f64>,
    pub(crate) n_bytes: Option<usize>,
}

/// An engine with the wall seconds of its builds.
struct Ready {
    engine: Box<dyn Engine>,
    one_thread: Vec<f64>,
    two_threads: Vec<f64>,
}

/// Builds all entries for tracing, and again for the clock where `is_thorough`; the caller's pool has one thread.
pub(crate) fn build(entries: &[Entry<'_>], is_thorough: bool) -> Result<Vec<(Box<dyn Engine>, Built)>> {
    let two = rayon::ThreadPoolBuilder::new().num_threads(2).build()?;
    let mut ready = entries.iter().map(first).collect::<Result<Vec<Ready>>>()?;
    for repeat in 0..REPEATS * usize::from(is_thorough) {
        for (entry, ready) in entries.iter().zip(&mut ready) {
            if ready.one_thread[0] > PATIENCE_SECONDS {
                continue;
            }
            if repeat > 0 {
                let (built, took) = clock::time(|| (entry.build)(1));
                drop(built?);
                ready.one_thread.push(took.wall);
            }
            if entry.is_parallel {
                let (built, took) = two.install(|| clock::time(|| (entry.build)(2).map(drop)));
                built?;
                ready.two_threads.push(took.wall);
            }
        }
    }
    Ok(ready.into_iter().map(Ready::finish).collect())
}

fn first(entry: &Entry<'_>) -> Result<Ready> {
    let (engine, took) = clock::time(|| (entry.build)(1));
    let engine = engine.with_context(|| format!("cannot build {}", entry.name))?;
    Ok(Ready { engine, one_thread: vec![took.wall], two_threads: vec![] })
}

impl Ready {
    fn finish(self) -> (Box<dyn Engine>, Built) {
        let built = Built {
            one_thread: median(&self.one_thread),
            two_threads: (!self.two_threads.is_empty()).then(|| median(&self.two_threads)),
            n_bytes: self.engine.n_bytes(),
        };
        (self.engine, built)
    }
}
