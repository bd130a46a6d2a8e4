//! Segments and boxes: Silva (1.4.3) finds the separating-axis test of a segment steadier than the slab test of a ray. Both, in single precision
//! as in textbooks and as we have them, are compared with exact fractions.

use std::hint::black_box;

use anyhow::Result;
use canted_obb::Aabb;
use canted_tests::{exact::BoxEntry, extremes::slab};
use canted_trace::{Ray, ray_aabb, segment_overlaps_aabb};

use super::{Test, run};
use crate::report::model::{Cell, Table};

/// The ray from the start of a segment to its end, of which `t` is 0 to 1, and a box.
type Pair = (Ray, Aabb);

/// Whether they overlap.
type Overlaps = fn(&Pair) -> bool;

const ROUTINES: [(&str, Overlaps); 4] = [
    ("segment, textbook in f32", separating_axes),
    ("ray, textbook in f32", slabs),
    ("segment, ours", |(ray, aabb)| segment_overlaps_aabb(ray.origin, ray.at(1.0).map(|x| x as f32), aabb)),
    ("ray, ours", |(ray, aabb)| ray_aabb(ray, aabb).is_some()),
];

/// Ericson 2005, 5.3.3, with his epsilon.
fn separating_axes((ray, aabb): &Pair) -> bool {
    let half: [f32; 3] = std::array::from_fn(|k| 0.5 * (aabb.max[k] - aabb.min[k]));
    let along: [f32; 3] = ray.direction.map(|x| 0.5 * x);
    let center: [f32; 3] = std::array::from_fn(|k| (ray.origin[k] + along[k]) - 0.5 * (aabb.min[k] + aabb.max[k]));
    if (0..3).any(|k| center[k].abs() > half[k] + along[k].abs()) {
        return false;
    }
    let length = along.map(|x| x.abs() + 1e-6);
    (0..3).all(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        (center[i] * along[j] - center[j] * along[i]).abs() <= half[i] * length[j] + half[j] * length[i]
    })
}

/// Kay and Kajiya 1986: three slabs by the reciprocals of the direction, without a pad.
fn slabs((ray, aabb): &Pair) -> bool {
    let (mut first, mut last) = (0.0f32, 1.0f32);
    for k in 0..3 {
        let by = 1.0 / ray.direction[k];
        let [a, b] = [aabb.min[k], aabb.max[k]].map(|x| (x - ray.origin[k]) * by);
        (first, last) = (first.max(a.min(b)), last.min(a.max(b)));
    }
    first <= last
}

/// Pairs of a case whose rays end where they are aimed, if single precision holds both ends and their difference.
fn pairs(of: &[slab::Pair]) -> Vec<Pair> {
    let segment = |(ray, obb): &slab::Pair| {
        let end: [f32; 3] = std::array::from_fn(|k| ray.origin[k] + ray.direction[k]);
        let exact = |k: usize| f64::from(end[k]) - f64::from(ray.origin[k]);
        let direction: [f32; 3] = std::array::from_fn(|k| exact(k) as f32);
        let is_exact = (0..3).all(|k| f64::from(direction[k]) == exact(k)) && direction != [0.0; 3];
        is_exact.then(|| (Ray::new(ray.origin, direction).between(0.0, 1.0), obb.aabb()))
    };
    of.iter().filter_map(segment).collect()
}

/// Wrong answers and times, and a sentence.
pub(super) fn measure(effort: usize, rounds: usize) -> Result<(Table, String)> {
    let head = ["case", "test", "overlap, missed", "do not overlap, hit", "time"];
    let title = "Segments and boxes, compared with exact fractions (Silva: the test of a segment is steadier than that of a ray)";
    let mut table = Table::new(title, &head);
    let mut sums = [[0usize; 2]; ROUTINES.len()];
    let mut n_all = 0;
    for slab::Case { name, pairs: of } in slab::cases(effort) {
        let pairs = pairs(&of);
        if pairs.is_empty() {
            continue;
        }
        let truths: Vec<bool> = pairs.iter().map(|(ray, aabb)| BoxEntry::of_aabb(ray, aabb).is_some()).collect();
        let n_hit = truths.iter().filter(|&&truth| truth).count();
        n_all += pairs.len();
        let pairs = &pairs;
        let test = |(name, overlaps): (&str, Overlaps)| Test {
            name: name.to_owned(),
            answers: pairs.iter().map(overlaps).collect(),
            work: Box::new(move || {
                for pair in pairs {
                    black_box(overlaps(pair));
                }
            }),
            n_tests: pairs.len(),
        };
        for (i, tested) in run(ROUTINES.into_iter().map(test).collect(), rounds).into_iter().enumerate() {
            let wrong = |is: bool| truths.iter().zip(&tested.answers).filter(|&(&t, &a)| t == is && a != is).count();
            let [missed, hit] = [wrong(true), wrong(false)];
            sums[i][0] += missed;
            sums[i][1] += hit;
            table.rows.push(vec![
                Cell::text(name),
                Cell::text(&tested.name),
                Cell::text(format!("{missed} of {n_hit}")),
                Cell::text(format!("{hit} of {}", pairs.len() - n_hit)),
                Cell::measured(tested.ns, "ns"),
            ]);
        }
    }
    let each = ROUTINES.iter().zip(sums).map(|((name, _), [missed, hit])| format!("'{name}' {missed} and {hit}"));
    table.says = format!(
        "Of {n_all} segments towards boxes, most of which touch or miss them by a rounding, tests miss an overlap and hit without one: {}.",
        each.collect::<Vec<_>>().join(", ")
    );
    let says = table.says.clone();
    Ok((table, says))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_tests_agree_far_from_faces() {
        let aabb = Aabb { min: [1.0; 3], max: [2.0; 3] };
        let pair = |end: [f32; 3]| (Ray::new([0.0; 3], end).between(0.0, 1.0), aabb);
        for (end, overlaps) in
            [([1.5, 1.6, 1.7], true), ([0.5; 3], false), ([4.0, 0.5, 4.0], false), ([3.0, 2.9, 3.1], true)]
        {
            assert_eq!(ROUTINES.map(|(_, test)| test(&pair(end))), [overlaps; 4], "{end:?}");
        }
    }

    #[test]
    fn segments_are_exact() {
        let all: Vec<slab::Pair> = slab::cases(1).into_iter().flat_map(|case| case.pairs).collect();
        let kept = pairs(&all);
        assert!(kept.len() > 400, "{}", kept.len());
        for (ray, _) in kept {
            let end = ray.at(1.0).map(|x| f64::from(x as f32));
            assert!((0..3).all(|k| end[k] == f64::from(ray.origin[k]) + f64::from(ray.direction[k])), "{ray:?}");
        }
    }
}
