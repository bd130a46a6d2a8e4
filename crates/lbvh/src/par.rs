//! The two shapes of parallel work the stations need, serial without the feature `parallel`.
//!
//! Both write disjoint slices, so the number of threads can never change a result.

/// Calls `work` with consecutive chunks of `out` and the index of each chunk's first element.
pub(crate) fn for_chunks<T: Send>(out: &mut [T], chunk: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        out.par_chunks_mut(chunk).enumerate().for_each(|(i, slice)| work(i * chunk, slice));
    }
    #[cfg(not(feature = "parallel"))]
    for (i, slice) in out.chunks_mut(chunk).enumerate() {
        work(i * chunk, slice);
    }
}

/// Calls `work` on every job; jobs own what they write.
pub(crate) fn for_jobs<J: Send>(jobs: Vec<J>, work: impl Fn(J) + Sync) {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        jobs.into_par_iter().for_each(&work);
    }
    #[cfg(not(feature = "parallel"))]
    jobs.into_iter().for_each(work);
}

/// Results of `work` for the chunks of `items`, in order.
pub(crate) fn map_chunks<T: Sync, R: Send>(
    items: &[T],
    chunk: usize,
    work: impl Fn(usize, &[T]) -> R + Sync,
) -> Vec<R> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        items.par_chunks(chunk).enumerate().map(|(i, slice)| work(i * chunk, slice)).collect()
    }
    #[cfg(not(feature = "parallel"))]
    {
        items.chunks(chunk).enumerate().map(|(i, slice)| work(i * chunk, slice)).collect()
    }
}

/// Number of threads that would work, 1 without the feature.
pub(crate) fn n_threads() -> usize {
    #[cfg(feature = "parallel")]
    {
        rayon::current_num_threads()
    }
    #[cfg(not(feature = "parallel"))]
    {
        1
    }
}
