//! Build times: every engine in turn, round by round.

use anyhow::{Context, Result};

use super::samples::Samples;
use crate::clock::{self, Seconds};
use crate::wide::engine::Entry;

/// Seconds of each engine's builds on a number of threads, a sample per round.
///
/// Processor time covers all threads of this process, because Embree builds on its own threads.
pub(super) fn builds(entries: &[&Entry<'_>], n_threads: usize, rounds: usize) -> Result<Vec<Vec<Seconds>>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build()?;
    let mut seconds = vec![Vec::with_capacity(rounds); entries.len()];
    for _ in 0..rounds {
        for (entry, seconds) in entries.iter().zip(&mut seconds) {
            let (built, took) = pool.install(|| clock::time_all(|| (entry.build)(n_threads).map(drop)));
            built.with_context(|| format!("cannot build {}", entry.name))?;
            seconds.push(took);
        }
    }
    Ok(seconds)
}

/// Processor seconds of each engine's builds on one thread, unaffected by other processes.
pub(super) fn on_one_thread(entries: &[&Entry<'_>], rounds: usize) -> Result<Vec<Samples>> {
    let of_one = |rounds: &Vec<Seconds>| rounds.iter().map(|seconds| seconds.cpu).collect::<Vec<_>>().into();
    Ok(builds(entries, 1, rounds)?.iter().map(of_one).collect())
}

#[cfg(test)]
mod tests {
    use std::{sync::Mutex, thread, time::Instant};

    use canted_trace::{Hit, Ray};

    use super::*;
    use crate::wide::engine::{Engine, Owner, Promise};

    struct Nothing;

    impl Engine for Nothing {
        fn closest(&self, _: &[Ray], _: &mut [Option<Hit>]) {}

        fn occluded(&self, _: &[Ray], _: &mut [bool]) {}
    }

    #[test]
    #[cfg(unix)]
    fn work_on_another_thread_is_counted() {
        let spent = Mutex::new(vec![]);
        let busy = || {
            let start = Instant::now();
            while start.elapsed().as_millis() < 30 {}
        };
        let entry = Entry {
            name: "one that uses another thread".to_owned(),
            owner: Owner::Peer,
            promise: Promise::Fast,
            is_placed: false,
            is_parallel: false,
            build: Box::new(|_| {
                let ((), took) = thread::scope(|scope| scope.spawn(|| clock::time(busy)).join().unwrap());
                spent.lock().unwrap().push(took.cpu);
                Ok(Box::new(Nothing))
            }),
        };
        let seconds = on_one_thread(&[&entry], 2).unwrap().remove(0);
        let spent = spent.lock().unwrap();
        assert_eq!(seconds.values().len(), spent.len());
        // Other tests of this process may add time.
        assert!(seconds.values().iter().zip(&*spent).all(|(counted, spent)| counted >= spent && *spent > 0.0));
    }
}
