//! Parallel loops over disjoint work, shared by the builders; serial without the feature `parallel`. Not part of the
//! stable interface.
//!
//! Each job writes its own slice and results keep their order, so the number of threads never changes a result.
//!
//! Jobs reach rayon through trait objects: its loops are compiled once instead of once for each closure, which were a third of the code
//! of the builders. A job is large enough not to notice.

use std::ops::Range;
#[cfg(feature = "parallel")]
use std::sync::{Mutex, PoisonError};

#[cfg(feature = "parallel")]
use crate::stages;

/// Items of one job in [`for_pieces`].
const CHUNK: usize = 256;

/// Fewest items of one job in [`filled`].
const FILLED: usize = 1 << 12;

/// Calls `work` for every job. Each job owns what it writes.
pub fn for_jobs<J: Send>(jobs: Vec<J>, work: impl Fn(J) + Sync + Send) {
    #[cfg(feature = "parallel")]
    {
        let places: Vec<Mutex<Option<J>>> = jobs.into_iter().map(|job| Mutex::new(Some(job))).collect();
        each_index(places.len(), &|i| {
            if let Some(job) = take(&places[i]) {
                work(job);
            }
        });
    }
    #[cfg(not(feature = "parallel"))]
    jobs.into_iter().for_each(work);
}

/// Results of `work` for every job, in order. Each job owns what it writes.
pub fn map_jobs<J: Send, R: Send>(jobs: Vec<J>, work: impl Fn(J) -> R + Sync + Send) -> Vec<R> {
    #[cfg(feature = "parallel")]
    {
        let mut results: Vec<Option<R>> = jobs.iter().map(|_| None).collect();
        for_jobs(jobs.into_iter().zip(&mut results).collect(), |(job, result)| *result = Some(work(job)));
        results.into_iter().map(|result| result.expect("every job has run")).collect()
    }
    #[cfg(not(feature = "parallel"))]
    jobs.into_iter().map(work).collect()
}

/// What is in a place, once.
#[cfg(feature = "parallel")]
fn take<T>(place: &Mutex<Option<T>>) -> Option<T> {
    place.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// Calls `work` with every number below `n`, on all threads.
#[cfg(feature = "parallel")]
fn each_index(n: usize, work: &(dyn Fn(usize) + Sync)) {
    use rayon::prelude::*;
    stages::parallel(n > 1, || (0..n).into_par_iter().for_each(work));
}

/// Calls `work` for consecutive chunks of `out`, with the index of the first element of each.
pub fn for_chunks<T: Send>(out: &mut [T], chunk: usize, work: impl Fn(usize, &mut [T]) + Sync + Send) {
    for_jobs(out.chunks_mut(chunk).enumerate().collect(), |(i, slice)| work(i * chunk, slice));
}

/// Results of `work` for consecutive chunks of `items`, in order, with the index of the first item of each.
pub fn map_chunks<T: Sync, R: Send>(
    items: &[T],
    chunk: usize,
    work: impl Fn(usize, &[T]) -> R + Sync + Send,
) -> Vec<R> {
    map_jobs(items.chunks(chunk).enumerate().collect(), |(i, slice)| work(i * chunk, slice))
}

/// Results of `work` for consecutive ranges of `0..n`, in order.
pub fn map_ranges<R: Send>(n: usize, chunk: usize, work: impl Fn(Range<usize>) -> R + Sync + Send) -> Vec<R> {
    map_jobs((0..n.div_ceil(chunk)).collect(), |i| work(i * chunk..n.min((i + 1) * chunk)))
}

/// `f` of every item, in order; jobs of at least `chunk` items. Memory is written once, by the thread that first touches it.
pub fn map<I: Sync, T: Send>(items: &[I], chunk: usize, f: impl Fn(&I) -> T + Sync + Send) -> Vec<T> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        stages::parallel(items.len() > chunk, || items.par_iter().with_min_len(chunk).map(f).collect())
    }
    #[cfg(not(feature = "parallel"))]
    {
        let _ = chunk;
        items.iter().map(f).collect()
    }
}

/// `f` of every number below `n`, in order, as [`map`].
pub fn from_fn<T: Send>(n: usize, chunk: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        stages::parallel(n > chunk, || (0..n).into_par_iter().with_min_len(chunk).map(f).collect())
    }
    #[cfg(not(feature = "parallel"))]
    {
        let _ = chunk;
        (0..n).map(f).collect()
    }
}

/// `n` copies of `value`, written by all threads: where memory is fresh, the system clears its pages in parallel.
pub fn filled<T: Copy + Send + Sync>(n: usize, value: T) -> Vec<T> {
    from_fn(n, FILLED, |_| value)
}

/// Calls `write` with each item and its piece of `out`, from `start(item)` to the start of the next item.
///
/// Starts must not decrease from item to item.
pub fn for_pieces<I: Sync, T: Send>(
    items: &[I],
    out: &mut [T],
    start: impl Fn(&I) -> usize + Sync,
    write: impl Fn(&I, &mut [T]) + Sync,
) {
    map_pieces(items, out, start, write);
}

/// As [`for_pieces`], with the result of each item, in order.
pub fn map_pieces<I: Sync, T: Send, R: Send>(
    items: &[I],
    mut out: &mut [T],
    start: impl Fn(&I) -> usize + Sync,
    write: impl Fn(&I, &mut [T]) -> R + Sync,
) -> Vec<R> {
    let n = out.len();
    let mut jobs = Vec::with_capacity(items.len().div_ceil(CHUNK));
    for (i, chunk) in items.chunks(CHUNK).enumerate() {
        let end = items.get((i + 1) * CHUNK).map_or(n, &start);
        let (own, rest) = std::mem::take(&mut out).split_at_mut(end - start(&chunk[0]));
        jobs.push((chunk, own, end));
        out = rest;
    }
    let results = map_jobs(jobs, |(chunk, mut own, end)| {
        let of_item = |(i, item): (usize, &I)| {
            let len = chunk.get(i + 1).map_or(end, &start) - start(item);
            let (piece, rest) = std::mem::take(&mut own).split_at_mut(len);
            own = rest;
            write(item, piece)
        };
        chunk.iter().enumerate().map(of_item).collect::<Vec<R>>()
    });
    results.into_iter().flatten().collect()
}

/// Results of both, computed in parallel where a thread is free.
pub fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    #[cfg(feature = "parallel")]
    {
        let (mut a, mut b) = (Some(a), Some(b));
        let (mut of_a, mut of_b) = (None, None);
        join_both(&mut || of_a = a.take().map(|a| a()), &mut || of_b = b.take().map(|b| b()));
        of_a.zip(of_b).expect("both have run")
    }
    #[cfg(not(feature = "parallel"))]
    {
        (a(), b())
    }
}

/// As [`join`], of two works that have stages of their own: one after the other where the build is recorded.
pub fn join_stages<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    if crate::stages::is_recording() { (a(), b()) } else { join(a, b) }
}

/// Calls both, on two threads where one is free.
#[cfg(feature = "parallel")]
fn join_both(a: &mut (dyn FnMut() + Send), b: &mut (dyn FnMut() + Send)) {
    stages::parallel(true, || rayon::join(a, b));
}

/// Threads of the current rayon pool; 1 without the feature.
#[must_use]
pub fn n_threads() -> usize {
    #[cfg(feature = "parallel")]
    {
        rayon::current_num_threads()
    }
    #[cfg(not(feature = "parallel"))]
    {
        1
    }
}
