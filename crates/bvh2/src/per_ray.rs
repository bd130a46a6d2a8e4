//! One result for each ray of a slice, on one thread or on all.

use canted_trace::Ray;

/// Rays that a thread takes at a time.
#[cfg(feature = "parallel")]
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
pub fn parallel<'r, T: Send>(rays: &'r [Ray], results: &mut [T], trace: impl Fn(usize, &'r Ray, &mut T) + Sync) {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        assert_eq!(rays.len(), results.len(), "one result for each ray");
        let chunks = rays.par_chunks(CHUNK).zip(results.par_chunks_mut(CHUNK)).enumerate();
        chunks.for_each(|(i, (rays, results))| {
            serial(rays, results, |index, ray, result| trace(i * CHUNK + index, ray, result));
        });
    }
    #[cfg(not(feature = "parallel"))]
    serial(rays, results, trace);
}
