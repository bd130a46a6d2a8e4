//! Parallel work in a fixed order, serial without the feature `parallel`.

use std::ops::Range;

/// Results of `work` for chunks of `items`, in order.
pub(crate) fn map_chunks<T: Sync, R: Send>(
    items: &[T],
    chunk: usize,
    work: impl Fn(&[T]) -> R + Sync + Send,
) -> Vec<R> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        items.par_chunks(chunk).map(work).collect()
    }
    #[cfg(not(feature = "parallel"))]
    {
        items.chunks(chunk).map(work).collect()
    }
}

/// Calls `work` on every job; jobs own what they write.
pub(crate) fn for_jobs<J: Send>(jobs: Vec<J>, work: impl Fn(J) + Sync + Send) {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        jobs.into_par_iter().for_each(work);
    }
    #[cfg(not(feature = "parallel"))]
    jobs.into_iter().for_each(work);
}

/// Results of `work` for consecutive ranges of `0..n`, in order.
pub(crate) fn map_ranges<R: Send>(n: usize, chunk: usize, work: impl Fn(Range<usize>) -> R + Sync + Send) -> Vec<R> {
    let range = |i: usize| i * chunk..n.min((i + 1) * chunk);
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        (0..n.div_ceil(chunk)).into_par_iter().map(|i| work(range(i))).collect()
    }
    #[cfg(not(feature = "parallel"))]
    {
        (0..n.div_ceil(chunk)).map(|i| work(range(i))).collect()
    }
}

/// Results of both, side by side where there are threads for it.
pub(crate) fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    #[cfg(feature = "parallel")]
    {
        rayon::join(a, b)
    }
    #[cfg(not(feature = "parallel"))]
    {
        (a(), b())
    }
}
