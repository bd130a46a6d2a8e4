//! One result for each item of a slice, on one thread or on all. Not part of the stable interface.

use crate::par;

/// Items that a thread takes at a time.
const CHUNK: usize = 1024;

/// Calls `work` with the index of each item, the item and its result.
///
/// # Panics
/// If the slices differ in length.
pub fn serial<'i, I, T>(items: &'i [I], results: &mut [T], mut work: impl FnMut(usize, &'i I, &mut T)) {
    assert_eq!(items.len(), results.len(), "one result for each item");
    for (index, (item, result)) in items.iter().zip(results).enumerate() {
        work(index, item, result);
    }
}

/// As [`serial`], on all threads of the current rayon pool. Without the feature `parallel`, on one thread.
///
/// # Panics
/// If the slices differ in length.
pub fn parallel<'i, I, T>(items: &'i [I], results: &mut [T], work: impl Fn(usize, &'i I, &mut T) + Sync + Send)
where
    I: Sync,
    T: Send,
{
    assert_eq!(items.len(), results.len(), "one result for each item");
    let chunks = items.chunks(CHUNK).zip(results.chunks_mut(CHUNK)).enumerate().collect();
    par::for_jobs(chunks, |(i, (items, results))| {
        serial(items, results, |index, item, result| work(i * CHUNK + index, item, result));
    });
}
