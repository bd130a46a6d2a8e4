//! Thread pools, one for each number of threads.

use std::sync::{Arc, Mutex, PoisonError};
use std::thread::available_parallelism;

use pyo3::prelude::*;
use rayon::ThreadPool;

use crate::error::invalid;

/// Most threads of a call, as in the program.
const MAX_THREADS: i64 = 1024;

/// Pools that are kept for later calls.
const MAX_POOLS: usize = 4;

/// The threads of one call.
#[derive(Clone)]
pub(crate) struct Threads {
    n: usize,
    pool: Arc<ThreadPool>,
}

/// A pool and the process that started it: threads do not survive a fork.
struct Kept {
    process: u32,
    threads: Threads,
}

static POOLS: Mutex<Vec<Kept>> = Mutex::new(Vec::new());

impl Threads {
    /// The pool with `n` threads; `None` for all processors.
    pub(crate) fn new(n: Option<i64>) -> PyResult<Self> {
        let n = match n {
            None => available_parallelism().map_or(1, usize::from),
            Some(n @ 1..=MAX_THREADS) => usize::try_from(n).unwrap_or(1),
            Some(n) => return Err(invalid(format!("{n} is not a number of threads from 1 to {MAX_THREADS}"))),
        };
        let process = std::process::id();
        let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
        if pools.iter().any(|kept| kept.process != process) {
            // After a fork: to drop a pool would wake threads that do not exist.
            std::mem::forget(std::mem::take(&mut *pools));
        }
        if let Some(kept) = pools.iter().find(|kept| kept.threads.n == n) {
            return Ok(kept.threads.clone());
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).thread_name(|i| format!("canted {i}")).build();
        let pool = pool.map_err(|error| invalid(format!("cannot start {n} threads: {error}")))?;
        let threads = Self { n, pool: Arc::new(pool) };
        if pools.len() == MAX_POOLS {
            pools.remove(0);
        }
        pools.push(Kept { process, threads: threads.clone() });
        Ok(threads)
    }

    /// Runs `task` inside of the pool, so that parallel parts of it use its threads.
    pub(crate) fn run<T: Send>(&self, task: impl FnOnce() -> T + Send) -> T {
        self.pool.install(task)
    }

    /// Number of threads.
    pub(crate) fn n(&self) -> usize {
        self.n
    }

    /// Runs `task` on every thread of the pool and `meanwhile` on this one; returns when all have ended.
    pub(crate) fn on_each<R>(&self, task: impl Fn() + Send + Sync, meanwhile: impl FnOnce() -> R) -> R {
        self.pool.in_place_scope(|scope| {
            scope.spawn_broadcast(|_, _| task());
            meanwhile()
        })
    }
}
