//! Rays and triangles: single tests, eight at a time on every path, and on the device, case by case.

use anyhow::Result;
use canted_tests::extremes::triangle::cases;
use canted_trace::{BaldwinWeber, Kernel, MollerTrumbore, Projected, Ray, ScaledRay, Watertight};
use obvhs::{ray::Ray as TheirRay, triangle::Triangle};

use super::lanes;
use crate::report::{
    kernels::{self, Accuracy, Answer, Device, ExactHit, LEAST_ULPS, Pair, Test, Tested},
    model::{Axis, Cell, Effort, Plot, Point, Series, Table},
    samples::{Samples, number},
};

/// Tests all pairs in a row, with prepared data as in a BVH.
type Run = Box<dyn Fn() -> Vec<Answer>>;

fn test(name: &str, run: Run) -> Test<'static, Answer> {
    let answers = run();
    let n_tests = answers.len();
    Test { name: name.to_owned(), answers, work: Box::new(move || drop(std::hint::black_box(run()))), n_tests }
}

fn ours<K: Kernel<Prepared: 'static>>(name: &str, pairs: &[Pair]) -> Test<'static, Answer> {
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
    test(name, Box::new(run))
}

fn obvhs(pairs: &[Pair]) -> Test<'static, Answer> {
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
            // `obvhs` does not report the weights.
            t.is_finite().then_some([t, f32::NAN, f32::NAN])
        };
        prepared.iter().map(test).collect()
    };
    test("obvhs", Box::new(run))
}

/// Single tests on the processor: ours, then the peer's.
const N_SINGLE: usize = 5;

fn singles(pairs: &[Pair]) -> [Test<'static, Answer>; N_SINGLE] {
    [
        ours::<Watertight>("watertight", pairs),
        ours::<MollerTrumbore>("Möller, Trumbore", pairs),
        ours::<BaldwinWeber>("Baldwin, Weber", pairs),
        ours::<Projected>("projected", pairs),
        obvhs(pairs),
    ]
}

/// All tests of a case: single tests, then paths, in turn; then the device by its own clock.
fn tested(pairs: &[Pair], rounds: usize, device: Option<&Device>) -> Result<Vec<Tested<Answer>>> {
    let (rays, corners): (Vec<Ray>, Vec<_>) = pairs.iter().copied().unzip();
    let trees = lanes::singles(&corners)?;
    let mut tests = Vec::from(singles(pairs));
    let on_paths = lanes::tests(pairs, &trees, &tests[0].answers)?;
    tests.extend(on_paths);
    let mut tested = kernels::run(tests, rounds);
    tested.extend(device.map(|device| device.triangles(&trees, &rays, rounds)).transpose()?);
    Ok(tested)
}

/// The results of rays and triangles.
pub(super) struct Found {
    pub(super) tables: [Table; 2],
    pub(super) plots: [Plot; 2],
    pub(super) says: Vec<String>,
}

/// Every case with every triangle test.
pub(super) fn measure(effort: Effort, rounds: usize, device: Option<&Device>) -> Result<Found> {
    let head =
        ["case", "kernel", "t, ulps: median, worst", "u, v, ulps of 1/2: worst", "wrong hits", "wrong misses", "time"];
    let mut table = Table::new(Device::titled("Rays and triangles", device), &head);
    let title = format!(
        "Eight triangles at a time, {} in a leaf: time per test; answers equal the watertight test",
        lanes::LEAF
    );
    let mut on_paths = Table::new(title, &["case"]);
    let n_paths = lanes::paths().0.len();
    on_paths.head.extend(lanes::paths().0.iter().map(|path| path.name().to_owned()));
    let (mut errors, mut wrongs, mut sums): (Vec<Series>, Vec<Series>, Vec<Sum>) = (vec![], vec![], vec![]);
    for (case, mut pairs) in cases(effort.pick(1, 10, 10)) {
        pairs.retain(|(ray, _)| ScaledRay::new(ray).is_some());
        let truths: Vec<ExactHit> = pairs.iter().map(ExactHit::of).collect();
        let mut row = vec![Cell::text(case)];
        for (i, Tested { name, answers, ns, .. }) in tested(&pairs, rounds, device)?.into_iter().enumerate() {
            let found = Accuracy::of(&truths, &answers);
            if (N_SINGLE..N_SINGLE + n_paths).contains(&i) {
                row.push(Cell::measured(ns.clone(), "ns"));
            } else {
                table.rows.push(line(case, &name, &found, &ns));
            }
            if sums.len() <= i {
                errors.push(Series::dots(name.clone(), vec![]));
                wrongs.push(Series::dots(name.clone(), vec![]));
                sums.push(Sum { name, ..Sum::default() });
            }
            if !found.t_ulps.values().is_empty() {
                let y = Samples::from(found.t_ulps.values().iter().map(|x| x.max(LEAST_ULPS)).collect::<Vec<_>>());
                errors[i].points.push(Point::new(case, ns.clone(), y));
                sums[i].ulps.push(found.t_ulps.median());
            }
            let wrong = 100.0 * (found.wrong_hits + found.wrong_misses);
            wrongs[i].points.push(Point::new(case, ns.clone(), wrong));
            sums[i].wrong.push(wrong);
            sums[i].cases.push(case);
            sums[i].ns.push(ns.median());
            sums[i].n_rays += pairs.len();
        }
        on_paths.rows.push(row);
    }
    let plot = |title: &str, y, series| Plot { title: title.to_owned(), x: Axis::log("ns a test"), y, series };
    let plots = [
        plot("Error of t over time, by case", Axis::log("units in the last place"), errors),
        plot("Wrong answers over time, by case", Axis::linear("percentage of rays"), wrongs),
    ];
    let (single, others) = sums.split_at(N_SINGLE);
    let (paths, on_device) = others.split_at(n_paths);
    let mut says = vec![least(single)];
    says.extend(single.iter().map(Sum::sentence));
    says.push(bytes());
    says.push(of_paths(paths));
    says.extend(on_device.iter().map(Sum::sentence));
    Ok(Found { tables: [table, on_paths], plots, says })
}

/// What is stored for a triangle.
fn bytes() -> String {
    let [watertight, moller_trumbore, baldwin_weber, projected] = [
        size_of::<<Watertight as Kernel>::Record>(),
        size_of::<<MollerTrumbore as Kernel>::Record>(),
        size_of::<<BaldwinWeber as Kernel>::Record>(),
        size_of::<<Projected as Kernel>::Record>(),
    ];
    format!(
        "A triangle takes {watertight} bytes in the watertight test, {moller_trumbore} in that of Möller and Trumbore, {projected} in the projected one, \
         which stores its plane with the vertices, and {baldwin_weber} in that of Baldwin and Weber, which stores a map."
    )
}

/// A kernel over all cases, a value per case.
#[derive(Default)]
struct Sum {
    name: String,
    ns: Vec<f64>,
    /// In percent.
    wrong: Vec<f64>,
    /// The case names, in the same order.
    cases: Vec<&'static str>,
    ulps: Vec<f64>,
    /// Over all cases.
    n_rays: usize,
}

fn median(of: &[f64]) -> f64 {
    Samples::from(of.to_vec()).median()
}

/// Which of ours is fastest, which has the least error, and the peer, which is last.
fn least(sums: &[Sum]) -> String {
    let [ours @ .., peer] = sums else { return String::new() };
    let least = |of: fn(&Sum) -> &Vec<f64>| ours.iter().min_by(|a, b| median(of(a)).total_cmp(&median(of(b))));
    let (Some(fast), Some(exact)) = (least(|sum| &sum.ns), least(|sum| &sum.ulps)) else { return String::new() };
    format!(
        "Of our single tests, '{}' is the fastest with {} ns, and '{}' has the least error in t with {} ulps; '{}' takes {} ns with \
         an error of {} (medians of cases).",
        fast.name,
        number(median(&fast.ns)),
        exact.name,
        number(median(&exact.ulps)),
        peer.name,
        number(median(&peer.ns)),
        number(median(&peer.ulps)),
    )
}

/// The time of a test on each path; the answers were asserted to equal the single test.
fn of_paths(paths: &[Sum]) -> String {
    let Some(Sum { n_rays, .. }) = paths.first() else { return String::new() };
    let times: Vec<String> =
        paths.iter().map(|sum| format!("'{}' takes {} ns per test", sum.name, number(median(&sum.ns)))).collect();
    format!(
        "Eight at a time, {} (medians of cases), and all {n_rays} answers on every path equal the single watertight test bit for bit.",
        times.join(", ")
    )
}

impl Sum {
    fn sentence(&self) -> String {
        let [ns, wrong, ulps] = [&self.ns, &self.wrong, &self.ulps].map(|of| Samples::from(of.clone()));
        let worst = wrong.range()[1];
        let place = self.wrong.iter().position(|&wrong| wrong >= worst);
        let case = place.map_or("no case", |place| self.cases[place]);
        format!(
            "{} takes {} ns, has an error in t of {} ulps (medians), and is wrong for {}% of rays (mean; {}% at worst, '{case}').",
            capital(&self.name),
            number(ns.median()),
            number(ulps.median()),
            number(wrong.mean()),
            number(worst),
        )
    }
}

/// A name at the start of a sentence; library names are not capitalised.
fn capital(name: &str) -> String {
    match name {
        "watertight" => "Watertight".to_owned(),
        "projected" => "Projected".to_owned(),
        "device" => "The device".to_owned(),
        _ => name.to_owned(),
    }
}

fn line(case: &str, name: &str, found: &Accuracy, ns: &Samples) -> Vec<Cell> {
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
