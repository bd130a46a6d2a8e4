//! Parallel work in a fixed order, serial without the feature `parallel`.

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
