use std::ops::Range;

use canted_lbvh::{Bits, Domain, Sorted, morton_codes_of_boxes, sort_by_code};
use canted_obb::{Aabb, PrimId};

/// Longer runs of equal codes are sorted along a curve of their own; for shorter ones any order is good enough.
const LONG: usize = 32;

/// Sorts boxes by the Morton codes of their centers, so that the two triangles of a rectangle are adjacent.
///
/// Reads: finite boxes, their bounds. Writes: codes and primitives in sorted order. Holds: the same for any number of
/// threads; long runs of equal codes do *not* keep input order.
///
/// A single distant primitive makes the cells so large that all others share one and stay in input order, which gives poor
/// trees. So a long run of equal codes is sorted again by codes in the bounds of its own centers, recursively, until runs
/// are short or centers equal.
///
/// The codes stay those in the bounds of all boxes: the second result is whether they are too coarse for a radix tree, because
/// a run of equal ones was split.
pub(crate) fn along_curve(boxes: &[Aabb], bounds: &Aabb) -> (Sorted, bool) {
    let mut sorted = sort_by_code(&morton_codes_of_boxes(&Domain::new(bounds, 2, Bits::B63), boxes), Bits::B63);
    let mut is_coarse = false;
    let mut open = long_runs(&sorted.codes, 0);
    while let Some(run) = open.pop() {
        let n = run.len();
        let codes = refine(&mut sorted.leaves[run.clone()], boxes);
        is_coarse |= codes.first() != codes.last();
        // A run that is not split has equal centers, up to the resolution of the codes.
        open.extend(long_runs(&codes, run.start).into_iter().filter(|run| run.len() < n));
    }
    (sorted, is_coarse)
}

/// Sorts primitives by codes in the bounds of their own centers; returns the codes in that order.
fn refine(leaves: &mut [PrimId], boxes: &[Aabb]) -> Vec<u64> {
    let own: Vec<Aabb> = leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
    let center = |aabb: &Aabb| std::array::from_fn(|k| 0.5 * aabb.min[k] + 0.5 * aabb.max[k]);
    let centers = Aabb::from_points(own.iter().map(center));
    let sorted = sort_by_code(&morton_codes_of_boxes(&Domain::new(&centers, 2, Bits::B63), &own), Bits::B63);
    let before = leaves.to_vec();
    for (leaf, index) in leaves.iter_mut().zip(&sorted.leaves) {
        *leaf = before[index.index()];
    }
    sorted.codes
}

/// Ranges of long runs of equal codes, offset by `first`.
fn long_runs(codes: &[u64], first: usize) -> Vec<Range<usize>> {
    let mut start = first;
    let mut runs = vec![];
    for run in codes.chunk_by(|a, b| a == b) {
        if run.len() > LONG {
            runs.push(start..start + run.len());
        }
        start += run.len();
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Small boxes in the unit cube, in random order.
    fn scattered(n: usize) -> Vec<Aabb> {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / 16_777_216.0
        };
        (0..n)
            .map(|_| {
                let min = [next(), next(), next()];
                Aabb { min, max: min.map(|x| x + 0.01) }
            })
            .collect()
    }

    fn around(boxes: &[Aabb]) -> Aabb {
        boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb))
    }

    /// Sum of the distances between consecutive boxes, which a good curve keeps short.
    fn path_length(boxes: &[Aabb], leaves: &[PrimId]) -> f64 {
        let step = |pair: &[PrimId]| -> f64 {
            let [a, b] = [pair[0], pair[1]].map(|leaf| boxes[leaf.index()].min.map(f64::from));
            (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
        };
        leaves.windows(2).map(step).sum()
    }

    #[test]
    fn a_distant_primitive_does_not_change_the_order_much() {
        let near = scattered(2000);
        let without = path_length(&near, &along_curve(&near, &around(&near)).0.leaves);
        for far in [1e4, 1e8, 1e15, 1e18] {
            let mut boxes = near.clone();
            boxes.push(Aabb { min: [far; 3], max: [far; 3] });
            let bounds = around(&boxes);
            let kept = |leaves: &[PrimId]| -> Vec<PrimId> {
                leaves.iter().copied().filter(|leaf| leaf.index() < near.len()).collect()
            };
            let (sorted, is_coarse) = along_curve(&boxes, &bounds);
            assert_eq!(is_coarse, far >= 1e8, "{far}");
            assert!(sorted.codes.is_sorted());
            let found = path_length(&near, &kept(&sorted.leaves));
            assert!(found < 1.5 * without, "{found} for {without} at {far}");
            if far >= 1e8 {
                // The check can fail: a single set of codes leaves all others in input order.
                let plain =
                    sort_by_code(&morton_codes_of_boxes(&Domain::new(&bounds, 2, Bits::B63), &boxes), Bits::B63);
                assert!(path_length(&near, &kept(&plain.leaves)) > 3.0 * without);
            }
        }
    }

    #[test]
    fn equal_boxes_keep_their_order_and_terminate() {
        let boxes = vec![Aabb { min: [1.0; 3], max: [2.0; 3] }; 1000];
        let (sorted, is_coarse) = along_curve(&boxes, &boxes[0]);
        assert!(!is_coarse);
        assert!(sorted.leaves.iter().zip(0..).all(|(leaf, i)| leaf.0 == i));
        // Nested scales: each needs codes of its own.
        let nested: Vec<_> =
            (0..100).flat_map(|i| [2f32.powi(-i); 4]).map(|x| Aabb { min: [x; 3], max: [x; 3] }).collect();
        let (sorted, _) = along_curve(&nested, &around(&nested));
        let coordinates: Vec<f32> = sorted.leaves.iter().map(|leaf| nested[leaf.index()].min[0]).collect();
        assert!(coordinates.is_sorted(), "{coordinates:?}");
    }
}
