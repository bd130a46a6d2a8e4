use crate::{
    par,
    reference::{Bounds, Reference},
};

/// Minimum number of references for parallel partitioning, and the size of its chunks.
const LARGE: usize = 1 << 15;
const CHUNK: usize = 1 << 13;

/// Copies the references on the left to the front of `out`, the others to the back; returns the number on the left.
///
/// Holds: the same order for any number of threads.
pub(crate) fn partition(
    references: &[Reference],
    out: &mut [Reference],
    is_left: impl Fn(&Reference) -> bool + Sync + Send,
) -> usize {
    if references.len() < LARGE {
        partition_serial(references, out, is_left)
    } else {
        partition_chunks(references, out, is_left)
    }
}

/// Branch-free; the references on the right are reversed.
fn partition_serial(references: &[Reference], out: &mut [Reference], is_left: impl Fn(&Reference) -> bool) -> usize {
    let (mut front, mut back) = (0, out.len());
    for reference in references {
        let left = is_left(reference);
        // Written to both ends; the wrong copy is overwritten later.
        out[front] = *reference;
        out[back - 1] = *reference;
        front += usize::from(left);
        back -= usize::from(!left);
    }
    front
}

/// Counts the references of each chunk, then writes all chunks in parallel.
fn partition_chunks(
    references: &[Reference],
    out: &mut [Reference],
    is_left: impl Fn(&Reference) -> bool + Sync + Send,
) -> usize {
    let counts = par::map_chunks(references, CHUNK, |_, chunk| chunk.iter().filter(|r| is_left(r)).count());
    let n_left = counts.iter().sum();
    let (mut lefts, mut rights) = out.split_at_mut(n_left);
    let mut jobs = Vec::with_capacity(counts.len());
    for (chunk, n) in references.chunks(CHUNK).zip(counts) {
        let (left, lefts_after) = std::mem::take(&mut lefts).split_at_mut(n);
        let (right, rights_after) = std::mem::take(&mut rights).split_at_mut(chunk.len() - n);
        (lefts, rights) = (lefts_after, rights_after);
        jobs.push((chunk, left.iter_mut(), right.iter_mut()));
    }
    par::for_jobs(jobs, |(chunk, mut left, mut right)| {
        for reference in chunk {
            let slot = if is_left(reference) { left.next() } else { right.next() };
            if let Some(slot) = slot {
                *slot = *reference;
            }
        }
    });
    n_left
}

/// Moves the half with the lower centers on an axis to the front; ties go by index.
pub(crate) fn halve(references: &mut [Reference], axis: usize) -> usize {
    let half = references.len().div_ceil(2);
    if half < references.len() {
        references.select_nth_unstable_by_key(half, |r| (r.key(axis), r.primitive()));
    }
    half
}

/// Halves the references by count on the axis of least total area, the first of equals.
pub(crate) fn split_at_median(references: &mut [Reference], axes: &[usize]) -> usize {
    let mut best = (f32::INFINITY, axes[0]);
    if let [_, _, ..] = axes {
        for &axis in axes {
            let n_left = halve(references, axis);
            let (left, right) = references.split_at(n_left);
            let cost = half_area(left) + half_area(right);
            if cost < best.0 {
                best = (cost, axis);
            }
        }
    }
    halve(references, best.1)
}

fn half_area(references: &[Reference]) -> f32 {
    references.iter().fold(Bounds::EMPTY, |all, r| all.union(r.bounds())).half_area()
}
