//! Kernels: error of `t`, `u`, `v` and wrong answers against exact fractions, and what a test costs.

mod boxes;
mod judge;
mod lanes;
mod passing;

use anyhow::Result;
use canted_tests::extremes::triangle;
use canted_trace::{BaldwinWeber, Kernel, MollerTrumbore, ScaledRay, Watertight};
use obvhs::{ray::Ray as TheirRay, triangle::Triangle};

use super::effort::Effort;
use super::model::{Axis, Cell, Chapter, Plot, Point, Series, Table};
use super::samples::{Samples, number};
use crate::interleave::{self, Contender};
use judge::{Answer, Judged, Judgement};
use triangle::Pair;

/// Tests all pairs in a row, as a tree would with what it prepared once.
pub(super) type Run = Box<dyn Fn() -> Vec<Answer>>;

/// A kernel with everything prepared that a tree prepares before rays come.
pub(super) struct Routine {
    name: &'static str,
    run: Run,
}

impl Routine {
    fn ours<K: Kernel<Prepared: 'static>>(name: &'static str, pairs: &[Pair]) -> Self {
        let ready = |(ray, corners): &Pair| {
            let ray = ScaledRay::new(ray)?;
            Some((ray, K::prepare(&ray), K::record(*corners)))
        };
        let prepared: Vec<_> = pairs.iter().filter_map(ready).collect();
        let run = move || {
            let test = |(ray, prepared, record): &(ScaledRay, K::Prepared, K::Record)| {
                let hit = K::intersect(prepared, ray, record, ray.t_max)?;
                Some([ray.caller_t(hit.t), hit.u, hit.v])
            };
            prepared.iter().map(test).collect()
        };
        Self { name, run: Box::new(run) }
    }

    fn obvhs(pairs: &[Pair]) -> Self {
        let prepared: Vec<(TheirRay, Triangle)> = pairs
            .iter()
            .map(|(ray, corners)| {
                let [v0, v1, v2] = corners.map(glam::Vec3A::from_array);
                (TheirRay::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max), Triangle { v0, v1, v2 })
            })
            .collect();
        let run = move || {
            let test = |(ray, triangle): &(TheirRay, Triangle)| {
                let t = triangle.intersect(ray);
                // They do not tell the weights.
                t.is_finite().then_some([t, f32::NAN, f32::NAN])
            };
            prepared.iter().map(test).collect()
        };
        Self { name: "obvhs", run: Box::new(run) }
    }

    fn all(pairs: &[Pair]) -> [Self; 4] {
        [
            Self::ours::<Watertight>("watertight", pairs),
            Self::ours::<MollerTrumbore>("Möller, Trumbore", pairs),
            Self::ours::<BaldwinWeber>("Baldwin, Weber", pairs),
            Self::obvhs(pairs),
        ]
    }
}

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let title = "Kernels: error and wrong answers against exact fractions";
    let mut chapter = Chapter { id: "kernels", title, ..Chapter::default() };
    let rounds = effort.pick(2, 7, 15);
    let mut table = Table::new(
        "Rays and triangles",
        &["case", "kernel", "t, ulps: median, worst", "u, v, ulps of 1/2: worst", "wrong hits", "wrong misses", "time"],
    );
    let mut errors: Vec<Series> = vec![];
    let mut wrongs: Vec<Series> = vec![];
    let mut sums: Vec<Sum> = vec![];
    for (case, mut pairs) in triangle::cases(effort.pick(1, 10, 10)) {
        pairs.retain(|(ray, _)| ScaledRay::new(ray).is_some());
        let truths: Vec<Judged> = pairs.iter().map(Judged::of).collect();
        let routines = Routine::all(&pairs);
        let times = times(&routines, rounds, pairs.len());
        for (i, (routine, ns)) in routines.iter().zip(times).enumerate() {
            let found = Judgement::of(&truths, &(routine.run)());
            table.rows.push(line(case, routine.name, &found, &ns));
            if errors.len() <= i {
                errors.push(Series { name: routine.name.to_owned(), points: vec![], is_joined: false });
                wrongs.push(Series { name: routine.name.to_owned(), points: vec![], is_joined: false });
                sums.push(Sum { name: routine.name, ..Sum::default() });
            }
            if !found.t_ulps.values().is_empty() {
                let y = Samples::from(found.t_ulps.values().iter().map(|x| x.max(LEAST_ULPS)).collect::<Vec<_>>());
                errors[i].points.push(Point { label: case.to_owned(), x: ns.clone(), y });
            }
            let wrong = 100.0 * (found.wrong_hits + found.wrong_misses);
            wrongs[i].points.push(Point { label: case.to_owned(), x: ns.clone(), y: wrong.into() });
            sums[i].wrong.push(wrong);
            sums[i].cases.push(case);
            sums[i].ns.push(ns.median());
            if !found.t_ulps.values().is_empty() {
                sums[i].ulps.push(found.t_ulps.median());
            }
        }
    }
    chapter.plots = vec![
        Plot {
            title: "Error of t over time, by case".to_owned(),
            x: Axis::log("ns a test"),
            y: Axis::log("units in the last place"),
            series: errors,
        },
        Plot {
            title: "Wrong answers over time, by case".to_owned(),
            x: Axis::log("ns a test"),
            y: Axis::linear("per cent of rays"),
            series: wrongs,
        },
    ];
    chapter.tables.push(table);
    let boxes::Found { table, plots, says } = boxes::measure(effort.pick(1, 6, 6), rounds);
    chapter.tables.push(table);
    chapter.plots.extend(plots);
    let lanes = lanes::measure(effort, rounds, &mut chapter.skipped)?;
    chapter.tables.push(lanes);
    chapter.tell(std::iter::once(least(&sums)).chain(sums.iter().map(Sum::sentence)).chain([says]));
    chapter.method = METHOD.map(str::to_owned).to_vec();
    Ok(chapter)
}

/// A kernel over all cases, a number each.
#[derive(Default)]
struct Sum {
    name: &'static str,
    ns: Vec<f64>,
    /// Per cent.
    wrong: Vec<f64>,
    /// The cases, in the same order.
    cases: Vec<&'static str>,
    ulps: Vec<f64>,
}

/// Which of ours is fastest, which errs least, and the peer, which comes last.
fn least(sums: &[Sum]) -> String {
    let [ours @ .., peer] = sums else { return String::new() };
    let median = |of: &[f64]| Samples::from(of.to_vec()).median();
    let least = |of: fn(&Sum) -> &Vec<f64>| ours.iter().min_by(|a, b| median(of(a)).total_cmp(&median(of(b))));
    let (Some(fast), Some(exact)) = (least(|sum| &sum.ns), least(|sum| &sum.ulps)) else { return String::new() };
    format!(
        "Of our single tests '{}' takes the least time, {} ns, and '{}' errs least in t, by {} ulps; '{}' takes {} ns and errs by \
         {} (medians of cases).",
        fast.name,
        number(median(&fast.ns)),
        exact.name,
        number(median(&exact.ulps)),
        peer.name,
        number(median(&peer.ns)),
        number(median(&peer.ulps)),
    )
}

impl Sum {
    fn sentence(&self) -> String {
        let [ns, wrong, ulps] = [&self.ns, &self.wrong, &self.ulps].map(|of| Samples::from(of.clone()));
        let worst = wrong.range()[1];
        let place = self.wrong.iter().position(|&wrong| wrong >= worst);
        let case = place.map_or("no case", |place| self.cases[place]);
        format!(
            "{} takes {} ns, is off in t by {} ulps (medians), and answers {}% of rays wrong (mean; {}% at worst, '{case}').",
            capital(self.name),
            number(ns.median()),
            number(ulps.median()),
            number(wrong.mean()),
            number(worst),
        )
    }
}

/// A name as a sentence begins; that of a library stays as it is written.
fn capital(name: &str) -> String {
    if name == "watertight" { "Watertight".to_owned() } else { name.to_owned() }
}

/// What a logarithmic axis shows of no error.
const LEAST_ULPS: f64 = 1e-3;

const METHOD: [&str; 5] = [
    "Truth is the solution of the ray's and the triangle's own bits in fractions. An answer is wrong where it is a hit and the truth is \
     a miss, or the other way; the triangle is closed, so rays through its very edge are hits. The error of t is in units in the last \
     place of the true value, that of u and v in units of 2^-24. An f32 kernel cannot answer all such rays right: near an edge the \
     shear of the watertight kernel moves vertices by a few roundings, all neighbours alike, so nothing leaks. What is promised is in \
     the table of extremes. Where t is nearly nothing, as with an origin on the triangle, its units are so small that their number \
     says little.",
    "Times are of one thread, one test after another; records of triangles and what a kernel computes once for a ray are made before. \
     All kernels in turn, round by round, after a warm-up. Points are medians, bars reach from least to greatest.",
    "'Möller, Trumbore' and 'Baldwin, Weber' are ours: an f32 filter each, and one finish in f64 that decides and computes what either \
     lets pass. So their errors and answers are the same, and they differ in time alone.",
    "Each test of a box is judged by the box that it is given, leaning or straight: 'lost' are rays that meet it and are told they do \
     not, which is promised never to be; 'enters' are rays that miss it and enter, as a pad lets them. Most cases aim at the box, so \
     that what misses does so by a rounding; the last three pass a leaning box at a distance. The error of an entry is that of `t`, \
     where the ray begins outside; ours enter early by their pad.",
    "On all SIMD paths hits have the same bits as the scalar kernel's, which is asserted here once more; only times differ. On a device \
     answers are those of its own arithmetic, and its times include sending rays and fetching hits.",
];

fn times(routines: &[Routine], rounds: usize, n: usize) -> Vec<Samples> {
    // A few hundred tests take microseconds: many times over, so that the clock does not show.
    let repeats = 20_000usize.div_ceil(n.max(1));
    let contenders = routines.iter().map(|Routine { name, run }| {
        Contender::new(*name, move || (0..repeats).for_each(|_| drop(std::hint::black_box(run()))))
    });
    #[expect(clippy::cast_precision_loss, reason = "small counts")]
    let to_ns = 1e9 / (repeats * n.max(1)) as f64;
    let timings = interleave::run(rounds, contenders.collect());
    timings.into_iter().map(|timing| Samples::from(timing.seconds).scaled(to_ns)).collect()
}

fn line(case: &str, name: &str, found: &Judgement, ns: &Samples) -> Vec<Cell> {
    let percent = |share: f64| format!("{}%", number(100.0 * share));
    let both = |samples: &Samples| match samples.values() {
        [] => "no hit".to_owned(),
        _ => format!("{}, {}", number(samples.median()), number(samples.range()[1])),
    };
    let worst = if found.uv_ulps.values().is_empty() { "–".to_owned() } else { number(found.uv_ulps.range()[1]) };
    vec![
        Cell::text(case),
        Cell::text(name),
        Cell::text(both(&found.t_ulps)),
        Cell::text(worst),
        Cell::text(percent(found.wrong_hits)),
        Cell::text(percent(found.wrong_misses)),
        Cell::measured(ns.clone(), "ns"),
    ]
}
