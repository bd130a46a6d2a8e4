//! Rays and boxes: what is lost, what enters for the pad, how far entries are off, and what a test costs.

use anyhow::Result;
use canted_obb::Aabb;
use canted_tests::{extremes::slab, fractions::BoxEntry};
use canted_trace::{Ray, ray_aabb, ray_obb};
use obvhs::{aabb::Aabb as TheirAabb, ray::Ray as TheirRay};

use super::super::model::{Axis, Cell, Plot, Point, Series, Table};
use super::super::samples::{Samples, number};
use super::contest::{self, Test, Tested};
use super::device::Device;
use super::{LEAST_ULPS, nodes, passing};

/// Where a ray enters a box; `None` for a miss, no number where that is not told.
type Enters = fn(&slab::Pair) -> Option<f32>;

/// A test, and whether it is asked about the straight box around a leaning one.
struct Routine {
    name: &'static str,
    is_straight: bool,
    enters: Enters,
}

/// A leaning box is tested as it is and by the straight box around it; of a peer only the latter exists.
static ROUTINES: [Routine; 3] = [
    Routine { name: "leaning box", is_straight: false, enters: |(ray, obb)| Some(ray_obb(ray, obb)?.0) },
    Routine { name: "its straight box", is_straight: true, enters: |(ray, obb)| Some(ray_aabb(ray, &obb.aabb())?.0) },
    Routine {
        name: "its straight box, obvhs",
        is_straight: true,
        enters: |(ray, obb)| {
            let aabb = obb.aabb();
            let near = TheirAabb::new(aabb.min.into(), aabb.max.into()).intersect_ray(&theirs(ray));
            // Of a ray that begins inside they tell where its line entered.
            near.is_finite().then_some(near)
        },
    },
];

fn theirs(ray: &Ray) -> TheirRay {
    TheirRay::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
}

/// What all answers of one test to one case come to.
struct Judgement {
    n_met: usize,
    n_lost: usize,
    n_missed: usize,
    n_entered: usize,
    /// Error of `t` of each entry of a ray that begins outside.
    ulps: Samples,
}

impl Judgement {
    /// Of answers to pairs; the truths are those of the boxes that were tested.
    fn of(pairs: &[slab::Pair], truths: &[Option<BoxEntry>], answers: &[Option<f32>]) -> Self {
        let count = |is: fn(&Option<BoxEntry>, &Option<f32>) -> bool| {
            truths.iter().zip(answers).filter(|(truth, answer)| is(truth, answer)).count()
        };
        let error = |((ray, _), (truth, answer)): (&slab::Pair, (&Option<BoxEntry>, &Option<f32>))| {
            let truth = truth.as_ref().filter(|truth| truth.is_behind_start(ray))?;
            let told = answer.filter(|t| !t.is_nan())?;
            // Where the true entry is beyond f32 there is no unit to count in.
            Some(truth.error_ulps(told)).filter(|ulps| !ulps.is_nan())
        };
        Self {
            n_met: count(|truth, _| truth.is_some()),
            n_lost: count(|truth, answer| truth.is_some() && answer.is_none()),
            n_missed: count(|truth, _| truth.is_none()),
            n_entered: count(|truth, answer| truth.is_none() && answer.is_some()),
            ulps: pairs.iter().zip(truths.iter().zip(answers)).filter_map(error).collect::<Vec<_>>().into(),
        }
    }

    /// Per cent of misses that enter.
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
        [of(self.n_lost, self.n_met), of(self.n_entered, self.n_missed), ulps]
    }
}

#[expect(clippy::cast_precision_loss, reason = "small counts")]
fn percent(n: usize, all: usize) -> f64 {
    100.0 * n as f64 / all as f64
}

/// What was found of rays and boxes.
pub(super) struct Found {
    pub(super) table: Table,
    pub(super) plots: [Plot; 2],
    /// How many rays that pass a leaning box enter it, and what eight at a time take.
    pub(super) says: [String; 2],
}

/// Every case by every routine, by nodes on every path and on the device.
pub(super) fn measure(effort: usize, rounds: usize, device: Option<&Device>) -> Result<Found> {
    let title = "Rays and boxes, judged by fractions; times include making the box ready where it is single";
    let head = ["case", "test", "meets its box, lost", "misses its box, enters", "entry, ulps: median, worst", "time"];
    let mut table = Table::new(Device::titled(title, device), &head);
    let (mut entered, mut errors): (Vec<Series>, Vec<Series>) = (vec![], vec![]);
    let (mut passed, mut ns_of_each): (Vec<String>, Vec<Vec<f64>>) = (vec![], vec![]);
    let mut cases: Vec<(&str, Vec<slab::Pair>)> =
        slab::cases(effort).into_iter().map(|slab::Case { name, pairs }| (name, pairs)).collect();
    let n_aimed = cases.len();
    cases.extend(passing::SHARES.map(|(share, name)| (name, passing::pairs(share, 400 * effort))));
    for (place, (case, pairs)) in cases.iter().enumerate() {
        let truths = [false, true].map(|is_straight| truths(pairs, is_straight));
        for (i, Tested { name, answers, ns }) in tested(pairs, rounds, device)?.into_iter().enumerate() {
            let is_straight = ROUTINES.get(i).is_none_or(|routine| routine.is_straight);
            let found = Judgement::of(pairs, &truths[usize::from(is_straight)], &answers);
            let mut row = vec![Cell::text(*case), Cell::text(&name)];
            row.extend(found.cells().map(Cell::text));
            row.push(Cell::measured(ns.clone(), "ns"));
            table.rows.push(row);
            if entered.len() <= i {
                entered.push(Series { name: name.clone(), points: vec![], is_joined: false });
                errors.push(Series { name, points: vec![], is_joined: false });
                ns_of_each.push(vec![]);
            }
            ns_of_each[i].push(ns.median());
            let point = |y: Samples| Point { label: (*case).to_owned(), x: ns.clone(), y };
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
        format!("'{}' takes {} ns a box", series.name, number(Samples::from(ns).median()))
    };
    let times: Vec<String> = entered.iter().zip(ns_of_each).map(time).collect();
    let says = [
        format!(
            "Of rays that pass a leaning box at 1e-6, 1e-3 and once its size {} enter it, for its pad.",
            passed.join(", ")
        ),
        format!("Of boxes {} (medians of cases).", times.join(", ")),
    ];
    // What tells no entry has no error of one.
    errors.retain(|series| !series.points.is_empty());
    let plots = [
        ("Rays that miss a box and enter it, over time, by case", Axis::linear("per cent of misses"), entered),
        ("Error of entries into boxes over time, by case", Axis::log("units in the last place"), errors),
    ];
    let plots = plots.map(|(title, y, series)| Plot { title: title.to_owned(), x: Axis::log("ns a test"), y, series });
    Ok(Found { table, plots, says })
}

/// Everything that tests a case: single tests, then nodes on every path, in turn; then the device by its own clock.
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
    tests.extend(nodes::tests(pairs)?);
    let mut tested = contest::run(tests, rounds);
    if let Some(device) = device {
        let (rays, boxes): (Vec<Ray>, Vec<Aabb>) = pairs.iter().map(|(ray, obb)| (*ray, obb.aabb())).unzip();
        tested.push(device.boxes(&nodes::of_equal(&boxes)?, &rays, rounds)?);
    }
    Ok(tested)
}

/// Where each ray enters the box that is tested.
fn truths(pairs: &[slab::Pair], is_straight: bool) -> Vec<Option<BoxEntry>> {
    let truth = |(ray, obb): &slab::Pair| {
        if is_straight { BoxEntry::of_aabb(ray, &obb.aabb()) } else { BoxEntry::of(ray, obb) }
    };
    pairs.iter().map(truth).collect()
}

#[cfg(test)]
mod tests {
    use canted_obb::Obb;

    use super::*;

    #[test]
    fn what_is_lost_and_what_enters_are_told_apart() {
        let obb = Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [1.0; 3] };
        let pair = |x: f32, z: f32| (Ray::new([x, 0.0, z], [0.0, 0.0, 1.0]), obb);
        let pairs = [pair(0.0, -3.0), pair(0.5, -3.0), pair(2.0, -3.0), pair(3.0, -3.0), pair(0.0, 0.0)];
        // The straight box around a leaning one is a rounding larger.
        for (is_straight, low) in [(false, -1.0), (true, obb.aabb().min[2])] {
            let answers = [Some((low + 3.0f32).next_up()), None, Some(2.0), None, Some(0.0)];
            let found = Judgement::of(&pairs, &truths(&pairs, is_straight), &answers);
            assert_eq!([found.n_met, found.n_lost, found.n_missed, found.n_entered], [3, 1, 2, 1]);
            // That of the ray which begins inside is no entry.
            assert_eq!((found.ulps.values(), found.false_percent()), (&[1.0][..], Some(50.0)));
            let untold = answers.map(|answer| answer.map(|_| f32::NAN));
            let found = Judgement::of(&pairs, &truths(&pairs, is_straight), &untold);
            assert_eq!((found.n_lost, found.n_entered, found.ulps.values()), (1, 1, &[][..]));
        }
    }
}
