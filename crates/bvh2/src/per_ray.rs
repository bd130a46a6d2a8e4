//! One result for each ray of a slice, on one thread or on all.

use canted_lbvh::par;
use canted_trace::Ray;

/// Rays that a thread takes at a time.
const CHUNK: usize = 1024;

/// Calls `trace` with the index of each ray, the ray and its result.
///
/// # Panics
/// If the slices differ in length.
pub fn serial<'r, T>(rays: &'r [Ray], results: &mut [T], mut trace: impl FnMut(usize, &'r Ray, &mut T)) {
    assert_eq!(rays.len(), results.len(), "one result for each ray");
    for (index, (ray, result)) in rays.iter().zip(results).enumerate() {
        trace(index, ray, result);
    }
}

/// As [`serial`], on all threads of the current rayon pool. Without the feature `parallel`, on one thread.
///
/// # Panics
/// If the slices differ in length.
pub fn parallel<'r, T: Send>(rays: &'r [Ray], results: &mut [T], trace: impl Fn(usize, &'r Ray, &mut T) + Sync + Send) {
    parallel_with(rays, results, || (), |(), index, ray, result| trace(index, ray, result));
}

/// As [`parallel`], with memory that several rays use in turn.
///
/// # Panics
/// If the slices differ in length.
pub fn parallel_with<'r, T: Send, M>(
    rays: &'r [Ray],
    results: &mut [T],
    memory: impl Fn() -> M + Sync + Send,
    trace: impl Fn(&mut M, usize, &'r Ray, &mut T) + Sync + Send,
) {
    assert_eq!(rays.len(), results.len(), "one result for each ray");
    let chunks = rays.chunks(CHUNK).zip(results.chunks_mut(CHUNK)).enumerate().collect();
    par::for_jobs(chunks, |(i, (rays, results))| {
        let mut memory = memory();
        serial(rays, results, |index, ray, result| trace(&mut memory, i * CHUNK + index, ray, result));
    });
}
