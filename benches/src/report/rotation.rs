//! Rotations out of matrices: error over turns and time, by condition and angle; ours, the paper's listing, singular values.

use anyhow::Result;
use canted_fixtures::SplitMix64;
use canted_obb::{
    Quaternion,
    rotation::{MOST_ITERATIONS, extract},
};
use canted_tests::{
    clouds::random_rotation,
    rotations::{Matrix, angle_rad, as_listed, diagonal, svd_polar, times, transposed},
};

use super::effort::Effort;
use super::model::{Axis, Cell, Chapter, Plot, Point, Series, Table};
use super::samples::{Samples, number};
use crate::interleave::{self, Contender};

/// Turns after which the listing gives up.
const LISTED_CAP: usize = 1000;

/// What a logarithmic axis shows of no error: a quarter of the rounding of `f64`.
const NOTHING_RAD: f64 = f64::EPSILON / 8.0;

/// A way to extract, given the most turns that it may take.
type Way = (&'static str, fn(Matrix, usize) -> Quaternion, usize);

const WAYS: [Way; 3] = [
    ("extract", |a, most| extract(a, most).rotation, MOST_ITERATIONS),
    ("as the paper lists it", |a, most| as_listed(a, most).0, LISTED_CAP),
    ("singular values, f64", |a, _| svd_polar(a), 0),
];

/// Matrices of one condition and the rotations in them.
struct Inputs {
    name: String,
    matrices: Vec<(Matrix, Quaternion)>,
}

impl Inputs {
    /// Stretched by `values` along random axes, then turned by `angle_rad` about another, or by any rotation.
    fn new(name: String, values: [f64; 3], angle_rad: Option<f64>, n: usize) -> Self {
        let mut rng = SplitMix64::new(name.bytes().map(u64::from).sum());
        let matrix = |_| {
            let any = random_rotation(&mut rng);
            let turn = angle_rad.map_or(any, |angle| Quaternion::about(any.columns()[0], angle));
            let v = random_rotation(&mut rng).columns();
            (times(turn.columns(), times(v, times(diagonal(values), transposed(v)))), turn)
        };
        Self { matrices: (0..n).map(matrix).collect(), name }
    }

    /// Errors of a way within `most` turns, in radians.
    fn errors(&self, way: fn(Matrix, usize) -> Quaternion, most: usize) -> Samples {
        let error = |&(a, turn): &(Matrix, Quaternion)| angle_rad(way(a, most), turn).max(NOTHING_RAD);
        self.matrices.iter().map(error).collect::<Vec<_>>().into()
    }

    /// Nanoseconds of each way, a sample a round.
    fn times(&self, rounds: usize, most: [usize; 3]) -> Vec<Samples> {
        let contenders = WAYS.iter().zip(most).map(|(&(name, way, _), most)| {
            let work = move || {
                for &(a, _) in &self.matrices {
                    std::hint::black_box(way(a, most));
                }
            };
            Contender::new(name, work)
        });
        #[expect(clippy::cast_precision_loss, reason = "few matrices")]
        let to_ns = 1e9 / self.matrices.len() as f64;
        let timings = interleave::run(rounds, contenders.collect());
        timings.into_iter().map(|timing| Samples::from(timing.seconds).scaled(to_ns)).collect()
    }
}

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let title = "Rotation extraction: error over turns and time";
    let mut chapter = Chapter { id: "rotation", title, ..Chapter::default() };
    let (n, rounds) = (effort.pick(4, 60, 300), effort.pick(2, 5, 9));
    let caps = WAYS.map(|(.., cap)| cap);
    let conditions: Vec<f64> = (0..=6).map(|i| 100.0_f64.powi(i)).collect();
    let mut table =
        Table::new("At the last turn allowed", &["matrices", "way", "median error, rad", "worst, rad", "time"]);
    let mut by_condition = vec![];
    for (kind, values) in [
        ("one small value", (|c| [1.0, 1.0, 1.0 / c]) as fn(f64) -> [f64; 3]),
        ("two small values", |c| [1.0, 1.0 / c, 1.0 / c]),
    ] {
        let inputs: Vec<Inputs> = conditions
            .iter()
            .map(|&c| Inputs::new(format!("condition {}, {kind}", number(c)), values(c), None, n))
            .collect();
        let measured = measure(&inputs, rounds, caps, &mut table);
        chapter.plots.push(over(
            format!("Error over condition: {kind}"),
            Axis::log("condition"),
            &conditions,
            &measured,
        ));
        by_condition.extend(measured);
    }
    let angles_deg = [1.0, 30.0, 60.0, 90.0, 120.0, 150.0, 170.0, 179.0, 179.999, 180.0];
    let inputs: Vec<Inputs> = angles_deg
        .iter()
        .map(|&angle: &f64| Inputs::new(format!("{angle}° away"), [3.0, 2.0, 1.0], Some(angle.to_radians()), n))
        .collect();
    let by_angle = measure(&inputs, rounds, caps, &mut table);
    let axis = Axis::linear("angle from the start of the listing, degrees");
    chapter.plots.push(over("Error over angle".to_owned(), axis, &angles_deg, &by_angle));
    let stiff = Inputs::new("condition 1e4, two small values".to_owned(), [1.0, 1e-4, 1e-4], None, n);
    let plain = Inputs::new("condition 10".to_owned(), [1.0, 0.4, 0.1], None, n);
    for inputs in [&plain, &stiff] {
        chapter.plots.extend(by_turns(inputs, rounds));
    }
    chapter.says = sentence(&by_condition, &by_angle);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    chapter.tables.push(table);
    Ok(chapter)
}

const METHOD: [&str; 2] = [
    "Matrices are a known rotation times a stretch along random axes, in f64; the error is the angle to that rotation. Points are \
     medians over matrices, bars reach from the best to the worst; an error of nothing is shown as 2.8e-17 rad. What two values of \
     1/condition leave of f64 is about condition times 1e-16: no way can do better, ours promises eight times its noise over the \
     sum of the two lesser values.",
    "The listing starts without a rotation and stops when a turn is shorter than 1e-9 rad or after 1,000 turns; singular values are \
     by Jacobi's method on columns until all are at right angles. Nanoseconds are those of one matrix, all ways in turn.",
];

/// Errors and times of every way on each input, and their lines in the table.
fn measure(inputs: &[Inputs], rounds: usize, caps: [usize; 3], table: &mut Table) -> Vec<Vec<(Samples, Samples)>> {
    let of = |inputs: &Inputs| {
        let times = inputs.times(rounds, caps);
        let errors = WAYS.iter().zip(caps).map(|(&(_, way, _), most)| inputs.errors(way, most));
        let both: Vec<(Samples, Samples)> = errors.zip(times).collect();
        for ((name, ..), (errors, ns)) in WAYS.iter().zip(&both) {
            table.rows.push(vec![
                Cell::text(&inputs.name),
                Cell::text(*name),
                Cell::text(number(errors.median())),
                Cell::text(number(errors.range()[1])),
                Cell::measured(ns.clone(), "ns"),
            ]);
        }
        both
    };
    inputs.iter().map(of).collect()
}

/// Error over a property of the matrices.
fn over(title: String, x: Axis, places: &[f64], measured: &[Vec<(Samples, Samples)>]) -> Plot {
    let series = WAYS.iter().enumerate().map(|(i, (name, ..))| {
        let points = places.iter().zip(measured).map(|(&place, ways)| Point {
            label: String::new(),
            x: place.into(),
            y: ways[i].0.clone(),
        });
        Series { name: (*name).to_owned(), points: points.collect(), is_joined: true }
    });
    Plot { title, x, y: Axis::log("error, rad"), series: series.collect() }
}

/// Error over the turns allowed, and over the time that they take.
fn by_turns(inputs: &Inputs, rounds: usize) -> [Plot; 2] {
    let most = |way: usize| -> Vec<usize> {
        match way {
            0 => vec![1, 2, 3, 4, 5, 6, 8, 12, 16],
            1 => vec![1, 2, 3, 5, 8, 12, 20, 30, 50, 100, 200, 500, 1000],
            _ => vec![1],
        }
    };
    let mut plots = ["turns allowed", "ns a matrix"].map(|x| Plot {
        title: format!("Error over {x}: {}", inputs.name),
        x: Axis::log(x),
        y: Axis::log("error, rad"),
        series: vec![],
    });
    for (i, (name, way, _)) in WAYS.iter().enumerate() {
        let mut points: [Vec<Point>; 2] = [vec![], vec![]];
        for most in most(i) {
            let errors = inputs.errors(*way, most);
            let ns = inputs.times_of(i, most, rounds);
            #[expect(clippy::cast_precision_loss, reason = "few turns")]
            let turns = Samples::from(most as f64);
            for (points, x) in points.iter_mut().zip([turns, ns]) {
                points.push(Point { label: format!("{most} turns"), x, y: errors.clone() });
            }
        }
        for (plot, points) in plots.iter_mut().zip(points) {
            plot.series.push(Series { name: (*name).to_owned(), points, is_joined: true });
        }
    }
    // Singular values take no turns.
    plots[0].series.pop();
    plots
}

impl Inputs {
    /// Nanoseconds of one way within `most` turns.
    fn times_of(&self, way: usize, most: usize, rounds: usize) -> Samples {
        let (name, run, _) = WAYS[way];
        let work = move || {
            for &(a, _) in &self.matrices {
                std::hint::black_box(run(a, most));
            }
        };
        #[expect(clippy::cast_precision_loss, reason = "few matrices")]
        let to_ns = 1e9 / self.matrices.len() as f64;
        let timings = interleave::run(rounds, vec![Contender::new(name, work)]);
        timings.into_iter().next().map_or_else(|| Samples::from(f64::NAN), |t| Samples::from(t.seconds).scaled(to_ns))
    }
}

fn sentence(by_condition: &[Vec<(Samples, Samples)>], by_angle: &[Vec<(Samples, Samples)>]) -> String {
    let worst = |rows: &[Vec<(Samples, Samples)>], way: usize| {
        rows.iter().map(|ways| ways[way].0.range()[1]).fold(0.0, f64::max)
    };
    let medians = |way: usize| {
        let all: Vec<f64> = by_condition.iter().chain(by_angle).map(|ways| ways[way].1.median()).collect();
        number(Samples::from(all).median())
    };
    format!(
        "Over angles up to 180° ours is off by {} rad at worst, the paper's listing by {}, singular values by {}; over conditions up to \
         1e12 by {}, {} and {}; the median of all takes {}, {} and {} ns a matrix.",
        number(worst(by_angle, 0)),
        number(worst(by_angle, 1)),
        number(worst(by_angle, 2)),
        number(worst(by_condition, 0)),
        number(worst(by_condition, 1)),
        number(worst(by_condition, 2)),
        medians(0),
        medians(1),
        medians(2),
    )
}
