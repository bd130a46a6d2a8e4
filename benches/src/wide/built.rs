//! Building every engine, and what that takes.

use anyhow::{Context, Result};

use super::engine::{Engine, Entry};
use crate::{clock, interleave::median};

/// Builds of each engine on each number of threads: the median counts.
const REPEATS: usize = 3;
/// What takes longer than this many seconds is built once on one thread and not on two.
const PATIENCE_SECONDS: f64 = 2.5;

/// An engine's facts beside its speed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Built {
    /// Wall seconds on one thread.
    pub(crate) one_thread: f64,
    /// Wall seconds on two threads.
    pub(crate) two_threads: Option<f64>,
    pub(crate) n_bytes: usize,
}

/// Builds all entries for tracing, and again for the clock where `is_thorough`; the caller's pool has one thread.
pub(crate) fn build(entries: &[Entry<'_>], is_thorough: bool) -> Result<(Vec<Box<dyn Engine>>, Vec<Built>)> {
    let two = rayon::ThreadPoolBuilder::new().num_threads(2).build()?;
    let mut engines = vec![];
    let mut one_thread = vec![];
    for entry in entries {
        let (engine, took) = clock::time(|| (entry.build)(1));
        engines.push(engine.with_context(|| format!("cannot build {}", entry.name))?);
        one_thread.push(vec![took.wall]);
    }
    let mut two_threads = vec![vec![]; entries.len()];
    for repeat in 0..REPEATS * usize::from(is_thorough) {
        for (i, entry) in entries.iter().enumerate() {
            if one_thread[i][0] > PATIENCE_SECONDS {
                continue;
            }
            if repeat > 0 {
                let (engine, took) = clock::time(|| (entry.build)(1));
                drop(engine?);
                one_thread[i].push(took.wall);
            }
            if entry.is_parallel {
                let build = || clock::time(|| (entry.build)(2).map(drop));
                let (built, took) = two.install(build);
                built?;
                two_threads[i].push(took.wall);
            }
        }
    }
    let built = |((engine, one), two): ((&Box<dyn Engine>, &Vec<f64>), &Vec<f64>)| Built {
        one_thread: median(one),
        two_threads: (!two.is_empty()).then(|| median(two)),
        n_bytes: engine.n_bytes(),
    };
    let built = engines.iter().zip(&one_thread).zip(&two_threads).map(built).collect();
    Ok((engines, built))
}
