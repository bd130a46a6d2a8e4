use crate::{par, reference::Reference};

/// References from which chunks are parted side by side, and how long these are.
const LARGE: usize = 1 << 15;
const CHUNK: usize = 1 << 13;

/// Copies the references that are left to the front of `out`, the others behind them; returns how many are left.
///
/// Holds: the same order for any number of threads.
pub(crate) fn partition(
    references: &[Reference],
    out: &mut [Reference],
    is_left: impl Fn(&Reference) -> bool + Sync + Send,
) -> usize {
    if references.len() < LARGE { part(references, out, is_left) } else { part_chunks(references, out, is_left) }
}

/// The right ones come in reverse: no branch has to guess the side.
fn part(references: &[Reference], out: &mut [Reference], is_left: impl Fn(&Reference) -> bool) -> usize {
    let (mut front, mut back) = (0, out.len());
    for reference in references {
        let left = is_left(reference);
        // Written on both sides; what is on the wrong one is overwritten by the next that belongs there.
        out[front] = *reference;
        out[back - 1] = *reference;
        front += usize::from(left);
        back -= usize::from(!left);
    }
    front
}

/// Counts each chunk, then lets each write to its places.
fn part_chunks(
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

/// Puts the half of lower middles on an axis to the front; equal ones by number.
pub(crate) fn halve(references: &mut [Reference], axis: usize) -> usize {
    let half = references.len().div_ceil(2);
    if half < references.len() {
        references.select_nth_unstable_by_key(half, |r| (r.key(axis), r.primitive()));
    }
    half
}
