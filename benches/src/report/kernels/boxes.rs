//! Rays and boxes: lost hits, false hits of the padding, errors of entries, and the cost of a test.

use anyhow::Result;
use canted_obb::Aabb;
use canted_tests::{exact::BoxEntry, extremes::slab};
use canted_trace::{Ray, ray_aabb, ray_obb};
use obvhs::{aabb::Aabb as TheirAabb, ray::Ray as TheirRay};

use super::lanes;
use crate::report::{
    kernels::{self, Device, LEAST_ULPS, Test, Tested},
    model::{Axis, Cell, Plot, Point, Series, Table},
    samples::{Samples, number},
};

/// Where a ray enters a box; `None` for a miss, NaN if the test does not report it.
type Enters = fn(&slab::Pair) -> Option<f32>;

/// A test, and whether it tests the axis-aligned box around the oriented one.
struct Routine {
    name: &'static str,
    is_aligned: bool,
    enters: Enters,
}

/// An oriented box is tested itself and by its axis-aligned box; peers only have the latter.
static ROUTINES: [Routine; 3] = [
    Routine { name: "oriented box", is_aligned: false, enters: |(ray, obb)| Some(ray_obb(ray, obb)?.0) },
    Routine {
        name: "its axis-aligned box",
        is_aligned: true,
        enters: |(ray, obb)| Some(ray_aabb(ray, &obb.aabb())?.0),
    },
    Routine {
        name: "its axis-aligned box, obvhs",
        is_aligned: true,
        enters: |(ray, obb)| {
            let aabb = obb.aabb();
            let near = TheirAabb::new(aabb.min.into(), aabb.max.into()).intersect_ray(&theirs(ray));
            // For a ray that begins inside, `obvhs` returns where its line entered.
            near.is_finite().then_some(near)
        },
    },
];

fn theirs(ray: &Ray) -> TheirRay {
    TheirRay::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
}

/// The results of one test on one case.
struct Accuracy {
    n_hit: usize,
    n_lost: usize,
    n_missed: usize,
    n_entered: usize,
    /// Error of `t` at each entry of a ray that begins outside.
    ulps: Samples,
}

impl Accuracy {
    /// Compares the answers with the truths of the tested boxes.
    fn of(pairs: &[slab::Pair], truths: &[Option<BoxEntry>], answers: &[Option<f32>]) -> Self {
        let count = |is: fn(&Option<BoxEntry>, &Option<f32>) -> bool| {
            truths.iter().zip(answers).filter(|(truth, answer)| is(truth, answer)).count()
        };
        let error = |((ray, _), (truth, answer)): (&slab::Pair, (&Option<BoxEntry>, &Option<f32>))| {
            let truth = truth.as_ref().filter(|truth| truth.is_behind_start(ray))?;
            let reported = answer.filter(|t| !t.is_nan())?;
            // A true entry beyond f32 has no unit in the last place.
            Some(truth.error_ulps(reported)).filter(|ulps| !ulps.is_nan())
        };
        Self {
            n_hit: count(|truth, _| truth.is_some()),
            n_lost: count(|truth, answer| truth.is_some() && answer.is_none()),
            n_missed: count(|truth, _| truth.is_none()),
            n_entered: count(|truth, answer| truth.is_none() && answer.is_some()),
            ulps: pairs.iter().zip(truths.iter().zip(answers)).filter_map(error).collect::<Vec<_>>().into(),
        }
    }

    /// Percentage of misses that enter.
    fn false_percent(&self) -> Option<f64> {
        (self.n_missed > 0).then(|| percent(self.n_entered, self.n_missed))
    }

    fn cells(&self) -> [String; 3] {
        let of = |n: usize, all: usize| {
            if all == 0 { "none".to_owned() } else { format!("{n} of {all} ({}%)", number(percent(n, all))) }
        };
        let ulps = match self.ulps.values() {
            [] => "–".to_owned(),
            _ => format!("{}, {}", number(self.ulps.median()), number(self.ulps.range()[1])),
        };
        [of(self.n_lost, self.n_hit), of(self.n_entered, self.n_missed), ulps]
    }
}

fn percent(n: usize, all: usize) -> f64 {
    100.0 * n as f64 / all as f64
}

/// The results of rays and boxes.
pub(super) struct Found {
    pub(super) table: Table,
    pub(super) plots: [Plot; 2],
    /// How many rays that pass an oriented box enter it, and the time of eight boxes at a time.
    pub(super) says: [String; 2],
}

/// Every case with every routine, with nodes on every path and on the device.
pub(super) fn measure(effort: usize, rounds: usize, device: Option<&Device>) -> Result<Found> {
    let title = "Rays and boxes, compared with exact fractions; times of single boxes include their preparation";
    let head = ["case", "test", "hits its box, lost", "misses its box, enters", "entry, ulps: median, worst", "time"];
    let mut table = Table::new(Device::titled(title, device), &head);
    let (mut entered, mut errors): (Vec<Series>, Vec<Series>) = (vec![], vec![]);
    let (mut passed, mut ns_of_each): (Vec<String>, Vec<Vec<f64>>) = (vec![], vec![]);
    let mut cases: Vec<(&str, Vec<slab::Pair>)> =
        slab::cases(effort).into_iter().map(|slab::Case { name, pairs }| (name, pairs)).collect();
    let n_aimed = cases.len();
    cases.extend(lanes::SHARES.map(|(share, name)| (name, lanes::pairs(share, 400 * effort))));
    for (place, (case, pairs)) in cases.iter().enumerate() {
        let truths = [false, true].map(|is_aligned| truths(pairs, is_aligned));
        for (i, Tested { name, answers, ns, .. }) in tested(pairs, rounds, device)?.into_iter().enumerate() {
            let is_aligned = ROUTINES.get(i).is_none_or(|routine| routine.is_aligned);
            let found = Accuracy::of(pairs, &truths[usize::from(is_aligned)], &answers);
            let mut row = vec![Cell::text(*case), Cell::text(&name)];
            row.extend(found.cells().map(Cell::text));
            row.push(Cell::measured(ns.clone(), "ns"));
            table.rows.push(row);
            if entered.len() <= i {
                entered.push(Series::dots(name.clone(), vec![]));
                errors.push(Series::dots(name, vec![]));
                ns_of_each.push(vec![]);
            }
            ns_of_each[i].push(ns.median());
            let point = |y: Samples| Point::new(*case, ns.clone(), y);
            entered[i].points.extend(found.false_percent().map(|percent| point(percent.into())));
            if !found.ulps.values().is_empty() {
                let shown = found.ulps.values().iter().map(|x| x.max(LEAST_ULPS)).collect::<Vec<_>>();
                errors[i].points.push(point(shown.into()));
            }
            if i == 0 && place >= n_aimed {
                passed.push(format!("{} of {}", found.n_entered, found.n_missed));
            }
        }
    }
    let time = |(series, ns): (&Series, Vec<f64>)| {
        format!("'{}' takes {} ns per box", series.name, number(Samples::from(ns).median()))
    };
    let times: Vec<String> = entered.iter().zip(ns_of_each).map(time).collect();
    let says = [
        format!(
            "Of rays that pass an oriented box at 1e-6, 1e-3 and 1 times its size, {} enter it because of its padding.",
            passed.join(", ")
        ),
        format!("Box tests: {} (medians of cases).", times.join(", ")),
    ];
    // A test that reports no entry has no entry error.
    errors.retain(|series| !series.points.is_empty());
    let plots = [
        ("Rays that miss a box and enter it, over time, by case", Axis::linear("percentage of misses"), entered),
        ("Error of entries into boxes over time, by case", Axis::log("units in the last place"), errors),
    ];
    let plots =
        plots.map(|(title, y, series)| Plot { title: title.to_owned(), x: Axis::log("ns per test"), y, series });
    Ok(Found { table, plots, says })
}

/// All tests of a case: single tests, then nodes on every path, in turn; then the device by its own clock.
fn tested(pairs: &[slab::Pair], rounds: usize, device: Option<&Device>) -> Result<Vec<Tested<Option<f32>>>> {
    let single = |Routine { name, enters, .. }: &'static Routine| Test {
        name: (*name).to_owned(),
        answers: pairs.iter().map(enters).collect(),
        work: Box::new(move || {
            for pair in pairs {
                std::hint::black_box(enters(pair));
            }
        }),
        n_tests: pairs.len(),
    };
    let mut tests: Vec<Test<'_, Option<f32>>> = ROUTINES.iter().map(single).collect();
    tests.extend(lanes::node_tests(pairs)?);
    let mut tested = kernels::run(tests, rounds);
    if let Some(device) = device {
        let (rays, boxes): (Vec<Ray>, Vec<Aabb>) = pairs.iter().map(|(ray, obb)| (*ray, obb.aabb())).unzip();
        tested.push(device.boxes(&lanes::of_equal(&boxes)?, &rays, rounds)?);
    }
    Ok(tested)
}

/// Where each ray enters the tested box.
fn truths(pairs: &[slab::Pair], is_aligned: bool) -> Vec<Option<BoxEntry>> {
    let truth = |(ray, obb): &slab::Pair| {
        if is_aligned { BoxEntry::of_aabb(ray, &obb.aabb()) } else { BoxEntry::of(ray, obb) }
    };
    pairs.iter().map(truth).collect()
}

#[cfg(test)]
mod tests {
    use canted_obb::Obb;

    use super::*;

    #[test]
    fn lost_and_false_hits_are_distinguished() {
        let obb = Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [1.0; 3] };
        let pair = |x: f32, z: f32| (Ray::new([x, 0.0, z], [0.0, 0.0, 1.0]), obb);
        let pairs = [pair(0.0, -3.0), pair(0.5, -3.0), pair(2.0, -3.0), pair(3.0, -3.0), pair(0.0, 0.0)];
        // The axis-aligned box around an oriented one is larger by a rounding.
        for (is_aligned, low) in [(false, -1.0), (true, obb.aabb().min[2])] {
            let answers = [Some((low + 3.0f32).next_up()), None, Some(2.0), None, Some(0.0)];
            let found = Accuracy::of(&pairs, &truths(&pairs, is_aligned), &answers);
            assert_eq!([found.n_hit, found.n_lost, found.n_missed, found.n_entered], [3, 1, 2, 1]);
            // A ray that begins inside has no entry.
            assert_eq!((found.ulps.values(), found.false_percent()), (&[1.0][..], Some(50.0)));
            let untold = answers.map(|answer| answer.map(|_| f32::NAN));
            let found = Accuracy::of(&pairs, &truths(&pairs, is_aligned), &untold);
            assert_eq!((found.n_lost, found.n_entered, found.ulps.values()), (1, 1, &[][..]));
        }
    }
}
