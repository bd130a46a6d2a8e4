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

/// Area of the common box of a run, relative to the sum of those of its parts, at most. At 1, a leaf that holds both parts costs
/// rays no more than two leaves; less keeps the halves of a slanted quad apart, whose boxes hardly overlap (`benches/TRIED.md`).
const MAX_AREA: f32 = 0.75;

/// One reference for each run of at most `max_run` primitives, with boxes in units of `1 / scale`.
///
/// Neighboring runs are joined, pairs first, then pairs of pairs, where the area of their common box is small enough.
pub(crate) fn runs(boxes: &[Aabb], scale: f32, max_run: u32) -> Vec<Reference> {
    let of = |first: usize, boxes: &[Aabb]| -> Vec<Reference> {
        let single = |(i, aabb): (usize, &Aabb)| Reference::new(index(first + i), aabb, scale);
        let mut runs: Vec<Reference> = boxes.iter().enumerate().map(single).collect();
        let mut limit = 2;
        while limit <= max_run {
            join_neighbors(&mut runs, limit);
            limit *= 2;
        }
        runs.shrink_to_fit();
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

/// Whether the common box is small enough; boxes without area are never joined.
fn pays(a: &Bounds, b: &Bounds) -> bool {
    let sum = a.half_area() + b.half_area();
    sum > 0.0 && a.union(b).half_area() <= MAX_AREA * sum
}

#[expect(clippy::cast_possible_truncation, reason = "at most 2^30 primitives")]
fn index(i: usize) -> u32 {
    i as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(x: f32, y: f32) -> Aabb {
        Aabb { min: [x, y, 0.0], max: [x + 1.0, y + 1.0, 0.5] }
    }

    fn lengths(boxes: &[Aabb], max_run: u32) -> Vec<u32> {
        runs(boxes, 1.0, max_run).iter().map(Reference::n).collect()
    }

    #[test]
    fn equal_neighbors_are_joined_and_distant_ones_are_not() {
        let boxes = [cell(0.0, 0.0), cell(0.0, 0.0), cell(9.0, 0.0), cell(1.0, 0.0), cell(1.0, 0.0), cell(1.0, 0.0)];
        assert_eq!(lengths(&boxes, 1), [1; 6]);
        assert_eq!(lengths(&boxes, 2), [2, 1, 2, 1]);
        assert_eq!(lengths(&boxes, 4), [2, 1, 3]);
        let joined = runs(&boxes, 1.0, 4);
        assert_eq!(joined.iter().map(Reference::primitive).collect::<Vec<_>>(), [0, 2, 3]);
        assert_eq!(joined[2].aabb(), cell(1.0, 0.0));
    }

    /// Every primitive once, in order, in a run around it, also where jobs end.
    #[test]
    fn runs_partition_the_primitives() {
        let mut state = 3u64;
        let boxes: Vec<Aabb> = (0..3 * CHUNK + 5)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let at = |shift: u32| f32::from(u8::try_from(state >> shift & 3).unwrap());
                // Points and segments among them.
                Aabb { min: [at(40), -0.0, at(44)], max: [at(40) + at(48), 0.0, at(44) + at(52)] }
            })
            .collect();
        for max_run in [1, 2, 8] {
            let mut next = 0;
            for run in runs(&boxes, 1.0, max_run) {
                assert!(run.primitive() == next && (1..=max_run).contains(&run.n()));
                next += run.n();
                let members = run.primitive() as usize..next as usize;
                assert_eq!(run.aabb(), around(&boxes[members]), "{max_run}");
            }
            assert_eq!(next as usize, boxes.len());
        }
        let lines: Vec<Aabb> = (0..8u8).map(|i| Aabb { min: [f32::from(i), 0.0, 0.0], max: [9.0, 0.0, 0.0] }).collect();
        assert_eq!(lengths(&lines, 8), [1; 8], "boxes without area");
    }

    fn around(boxes: &[Aabb]) -> Aabb {
        boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb))
    }
}
