//! Parallel work over disjoint pieces, serial without the feature `parallel`: threads never change a result.

/// Items of one job.
const CHUNK: usize = 256;

/// Calls `write` with each item and the piece of `out` that it owns: from its own place to the next item's.
///
/// Places rise with the items.
pub(crate) fn for_pieces<I: Sync, T: Send>(
    items: &[I],
    mut out: &mut [T],
    place: impl Fn(&I) -> usize + Sync,
    write: impl Fn(&I, &mut [T]) + Sync,
) {
    let n = out.len();
    let mut jobs = Vec::with_capacity(items.len().div_ceil(CHUNK));
    for (i, chunk) in items.chunks(CHUNK).enumerate() {
        let start = place(&chunk[0]);
        let end = items.get((i + 1) * CHUNK).map_or(n, &place);
        let (own, rest) = std::mem::take(&mut out).split_at_mut(end - start);
        jobs.push((chunk, own, end));
        out = rest;
    }
    for_jobs(jobs, |(chunk, mut own, end)| {
        for (i, item) in chunk.iter().enumerate() {
            let len = chunk.get(i + 1).map_or(end, &place) - place(item);
            let (piece, rest) = std::mem::take(&mut own).split_at_mut(len);
            write(item, piece);
            own = rest;
        }
    });
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

/// `f` of every item, in order.
pub(crate) fn map<I: Sync, T: Copy + Send>(
    items: &[I],
    chunk: usize,
    unset: T,
    f: impl Fn(&I) -> T + Sync + Send,
) -> Vec<T> {
    let mut out = vec![unset; items.len()];
    let jobs = items.chunks(chunk).zip(out.chunks_mut(chunk)).collect();
    for_jobs(jobs, |(items, out): (&[I], &mut [T])| {
        for (item, out) in items.iter().zip(out) {
            *out = f(item);
        }
    });
    out
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
