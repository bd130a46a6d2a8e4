use std::ops::Range;

use canted_lbvh::{Bits, Domain, Sorted, morton_codes_of_boxes, sort_by_code};
use canted_obb::{Aabb, PrimId};

/// Runs of more equal codes than this are ordered along a curve of their own: fewer, any order serves.
const LONG: usize = 32;

/// Boxes by the codes of their middles: the two halves of a rectangle stand side by side.
///
/// Reads: boxes (finite), the box around all. Writes: codes and primitives in sorted order. Holds: the same for any
/// number of threads; equal codes do *not* keep input order where there are many.
///
/// One primitive far off makes the curve's cells so large that all others share one, in the order of the input. Trees
/// over that order are as bad as trees over chance. So a long run of equal codes is sorted along a curve through the box
/// of its own middles, and so on, until runs are short or middles equal.
pub(crate) fn along_curve(boxes: &[Aabb], bounds: &Aabb) -> Sorted {
    let mut sorted = sort_by_code(&morton_codes_of_boxes(&Domain::new(bounds, 2, Bits::B63), boxes), Bits::B63);
    let mut open = long_runs(&sorted.codes, 0);
    while let Some(run) = open.pop() {
        let n = run.len();
        let codes = refine(&mut sorted.leaves[run.clone()], boxes);
        // A run that stays whole has equal middles, as far as codes can tell.
        open.extend(long_runs(&codes, run.start).into_iter().filter(|run| run.len() < n));
    }
    sorted
}

/// Puts some primitives in the order of a curve through their own middles; returns their codes in that order.
fn refine(leaves: &mut [PrimId], boxes: &[Aabb]) -> Vec<u64> {
    let own: Vec<Aabb> = leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
    let middle = |aabb: &Aabb| std::array::from_fn(|k| 0.5 * aabb.min[k] + 0.5 * aabb.max[k]);
    let middles = Aabb::from_points(own.iter().map(middle));
    let sorted = sort_by_code(&morton_codes_of_boxes(&Domain::new(&middles, 2, Bits::B63), &own), Bits::B63);
    let before = leaves.to_vec();
    for (leaf, place) in leaves.iter_mut().zip(&sorted.leaves) {
        *leaf = before[place.index()];
    }
    sorted.codes
}

/// Places of long runs of equal codes, counted from `first`.
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

    /// Small boxes all over the unit cube, in no order.
    #[expect(clippy::cast_precision_loss, reason = "24 bits")]
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

    /// Sum of distances between neighbours along the order: what a curve keeps short.
    fn way(boxes: &[Aabb], leaves: &[PrimId]) -> f64 {
        let step = |pair: &[PrimId]| -> f64 {
            let [a, b] = [pair[0], pair[1]].map(|leaf| boxes[leaf.index()].min.map(f64::from));
            (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
        };
        leaves.windows(2).map(step).sum()
    }

    #[test]
    fn a_primitive_far_off_does_not_spoil_the_order() {
        let near = scattered(2000);
        let without = way(&near, &along_curve(&near, &around(&near)).leaves);
        for far in [1e4, 1e8, 1e15, 1e18] {
            let mut boxes = near.clone();
            boxes.push(Aabb { min: [far; 3], max: [far; 3] });
            let bounds = around(&boxes);
            let kept = |leaves: &[PrimId]| -> Vec<PrimId> {
                leaves.iter().copied().filter(|leaf| leaf.index() < near.len()).collect()
            };
            let sorted = along_curve(&boxes, &bounds);
            assert!(sorted.codes.is_sorted());
            let found = way(&near, &kept(&sorted.leaves));
            assert!(found < 1.5 * without, "{found} for {without} at {far}");
            if far >= 1e8 {
                // The check can fail: one curve through all of it is no order at all.
                let plain =
                    sort_by_code(&morton_codes_of_boxes(&Domain::new(&bounds, 2, Bits::B63), &boxes), Bits::B63);
                assert!(way(&near, &kept(&plain.leaves)) > 3.0 * without);
            }
        }
    }

    #[test]
    fn equal_boxes_keep_their_order_and_end() {
        let boxes = vec![Aabb { min: [1.0; 3], max: [2.0; 3] }; 1000];
        let sorted = along_curve(&boxes, &boxes[0]);
        assert!(sorted.leaves.iter().zip(0..).all(|(leaf, i)| leaf.0 == i));
        // Each scale hides the next one.
        let nested: Vec<_> =
            (0..100).flat_map(|i| [2f32.powi(-i); 4]).map(|x| Aabb { min: [x; 3], max: [x; 3] }).collect();
        let sorted = along_curve(&nested, &around(&nested));
        let places: Vec<f32> = sorted.leaves.iter().map(|leaf| nested[leaf.index()].min[0]).collect();
        assert!(places.is_sorted(), "{places:?}");
    }
}
