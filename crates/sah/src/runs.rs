//! Runs: consecutive primitives that a builder keeps together.
//!
//! Meshes list neighbors one after the other: the triangles of a quad, of a strip, of a row of a grid. A run whose box is
//! small is one reference, so that there are fewer references to sort into bins and to move.

use canted_obb::Aabb;

use crate::{
    par,
    reference::{Bounds, Reference},
};

/// Primitives of one job. Runs end where jobs end, whatever the number of threads.
const CHUNK: usize = 1 << 13;

/// One reference for each run of at most `max_run` primitives, with boxes in units of `1 / scale`.
///
/// Neighboring runs are joined, pairs first, then pairs of pairs, where the area of their common box is not more than the sum
/// of their own areas: a leaf that holds both then costs rays no more than two leaves.
pub(crate) fn runs(boxes: &[Aabb], scale: f32, max_run: u32) -> Vec<Reference> {
    let of = |first: usize, boxes: &[Aabb]| -> Vec<Reference> {
        let single = |(i, aabb): (usize, &Aabb)| Reference::new(index(first + i), aabb, scale);
        let mut runs: Vec<Reference> = boxes.iter().enumerate().map(single).collect();
        let mut limit = 2;
        while limit <= max_run {
            join_neighbors(&mut runs, limit);
            limit *= 2;
        }
        runs
    };
    let parts = par::map_chunks(boxes, CHUNK, of);
    let n = parts.iter().map(Vec::len).sum();
    let Some(&first) = parts.first().and_then(|part| part.first()) else { return vec![] };
    let mut all = par::filled(n, first);
    let mut jobs = Vec::with_capacity(parts.len());
    let mut rest = &mut all[..];
    for part in &parts {
        let (own, after) = std::mem::take(&mut rest).split_at_mut(part.len());
        jobs.push((part, own));
        rest = after;
    }
    par::for_jobs(jobs, |(part, own)| own.copy_from_slice(part));
    all
}

/// Joins each run with the next where both are small and have at most `limit` primitives, from left to right.
fn join_neighbors(runs: &mut Vec<Reference>, limit: u32) {
    let (mut read, mut written) = (0, 0);
    while read < runs.len() {
        let run = runs[read];
        read += 1;
        runs[written] = run;
        if let Some(next) = runs.get(read)
            && run.n() + next.n() <= limit
            && pays(run.bounds(), next.bounds())
        {
            runs[written] = run.joined(next);
            read += 1;
        }
        written += 1;
    }
    runs.truncate(written);
}

/// Whether a common box has no more area than both; boxes without area never have one.
fn pays(a: &Bounds, b: &Bounds) -> bool {
    let sum = a.half_area() + b.half_area();
    sum > 0.0 && a.union(b).half_area() <= sum
}

#[expect(clippy::cast_possible_truncation, reason = "at most 2^30 primitives")]
fn index(i: usize) -> u32 {
    i as u32
}
