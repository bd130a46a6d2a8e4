//! Rotation extraction from matrices: error over iterations and time, by condition and angle; ours, the paper's
//! listing, singular values.

use anyhow::Result;
use canted_fixtures::SplitMix64;
use canted_obb::{
    Quaternion,
    rotation::{MAX_ITERATIONS, extract},
};
use canted_tests::{
    clouds::random_rotation,
    rotations::{Matrix, angle_rad, as_listed, diagonal, svd_polar, times, transposed},
};

use super::effort::Effort;
use super::model::{Axis, Cell, Chapter, Plot, Point, Series, Table};
use super::samples::{Samples, number};
use crate::interleave::{self, Contender};

/// Iterations after which the listing stops.
const LISTED_CAP: usize = 1000;

/// What a logarithmic axis shows for zero error: a quarter of the rounding of `f64`.
const NOTHING_RAD: f64 = f64::EPSILON / 8.0;

/// An extraction method: name, function with an iteration limit, default limit.
type Method = (&'static str, fn(Matrix, usize) -> Quaternion, usize);

const METHODS: [Method; 3] = [
    ("extract", |a, most| extract(a, most).rotation, MAX_ITERATIONS),
    ("as the paper lists it", |a, most| as_listed(a, most).0, LISTED_CAP),
    ("singular values, f64", |a, _| svd_polar(a), 0),
];

/// Matrices of one condition and the rotations they contain.
struct Inputs {
    name: String,
    matrices: Vec<(Matrix, Quaternion)>,
}

impl Inputs {
    /// Stretched by `values` along random axes, then rotated by `angle_rad` about another axis, or by any rotation.
    fn new(name: String, values: [f64; 3], angle_rad: Option<f64>, n: usize) -> Self {
        let mut rng = SplitMix64::new(name.bytes().map(u64::from).sum());
        let matrix = |_| {
            let any = random_rotation(&mut rng);
            let rotation = angle_rad.map_or(any, |angle| Quaternion::from_axis_angle(any.columns()[0], angle));
            let v = random_rotation(&mut rng).columns();
            (times(rotation.columns(), times(v, times(diagonal(values), transposed(v)))), rotation)
        };
        Self { matrices: (0..n).map(matrix).collect(), name }
    }

    /// Errors of a method with at most `most` iterations, in radians.
    fn errors(&self, method: fn(Matrix, usize) -> Quaternion, most: usize) -> Samples {
        let error = |&(a, rotation): &(Matrix, Quaternion)| angle_rad(method(a, most), rotation).max(NOTHING_RAD);
        self.matrices.iter().map(error).collect::<Vec<_>>().into()
    }

    /// Nanoseconds of methods with iteration limits, a sample per round.
    fn times(&self, rounds: usize, runs: &[(usize, usize)]) -> Vec<Samples> {
        let contenders = runs.iter().map(|&(method, most)| {
            let (name, run, _) = METHODS[method];
            let work = move || {
                for &(a, _) in &self.matrices {
                    std::hint::black_box(run(a, most));
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
    let title = "Rotation extraction: error over iterations and time";
    let mut chapter = Chapter { id: "rotation", title, ..Chapter::default() };
    let (n, rounds) = (effort.pick(4, 300, 300), effort.pick(2, 5, 9));
    let caps = METHODS.map(|(.., cap)| cap);
    let conditions: Vec<f64> = (0..=6).map(|i| 100.0_f64.powi(i)).collect();
    let mut table =
        Table::new("After the last iteration", &["matrices", "method", "median error, rad", "worst, rad", "time"]);
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
    let angles_deg = [0.0, 1.0, 30.0, 60.0, 90.0, 120.0, 150.0, 170.0, 179.0, 179.999, 180.0];
    let inputs: Vec<Inputs> = angles_deg
        .iter()
        .map(|&angle: &f64| Inputs::new(format!("angle {angle}°"), [3.0, 2.0, 1.0], Some(angle.to_radians()), n))
        .collect();
    let by_angle = measure(&inputs, rounds, caps, &mut table);
    let axis = Axis::linear("angle, degrees");
    chapter.plots.push(over("Error over angle".to_owned(), axis, &angles_deg, &by_angle));
    let stiff = Inputs::new("condition 1e4, two small values".to_owned(), [1.0, 1e-4, 1e-4], None, n);
    let plain = Inputs::new("condition 10".to_owned(), [1.0, 0.4, 0.1], None, n);
    for inputs in [&plain, &stiff] {
        chapter.plots.extend(by_iterations(inputs, rounds));
    }
    chapter.says = sentence(&by_condition, &by_angle);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    chapter.tables.push(table);
    Ok(chapter)
}

const METHOD: [&str; 2] = [
    "Matrices are a known rotation times a stretch along random axes, in f64; the error is the angle to that rotation. Points are \
     medians over matrices, bars reach from the best to the worst; zero error is shown as 2.8e-17 rad. With two singular values of \
     1/condition, f64 limits the error to about condition times 1e-16; ours promises eight times the rounding noise over the sum of \
     the two smaller values.",
    "The listing starts from the identity and stops after an iteration of less than 1e-9 rad or after 1,000 iterations; singular \
     values use Jacobi's method on columns until all are orthogonal. Nanoseconds are per matrix; all methods run in turn, and for \
     error over time all iteration limits too.",
];

/// Errors and times of every method on each input, and their table rows.
fn measure(inputs: &[Inputs], rounds: usize, caps: [usize; 3], table: &mut Table) -> Vec<Vec<(Samples, Samples)>> {
    let of = |inputs: &Inputs| {
        let runs: Vec<(usize, usize)> = caps.into_iter().enumerate().collect();
        let times = inputs.times(rounds, &runs);
        let errors = METHODS.iter().zip(caps).map(|(&(_, method, _), most)| inputs.errors(method, most));
        let both: Vec<(Samples, Samples)> = errors.zip(times).collect();
        for ((name, ..), (errors, ns)) in METHODS.iter().zip(&both) {
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

/// A plot of errors over a property of the matrices.
fn over(title: String, x: Axis, xs: &[f64], measured: &[Vec<(Samples, Samples)>]) -> Plot {
    let series = METHODS.iter().enumerate().map(|(i, (name, ..))| {
        let points = xs.iter().zip(measured).map(|(&x, methods)| Point {
            label: String::new(),
            x: x.into(),
            y: methods[i].0.clone(),
        });
        Series { name: (*name).to_owned(), points: points.collect(), is_joined: true }
    });
    Plot { title, x, y: Axis::log("error, rad"), series: series.collect() }
}

/// Iteration limits of each method in plots over iterations; singular values have none.
const ITERATIONS: [&[usize]; 3] =
    [&[1, 2, 3, 4, 5, 6, 8, 12, 16], &[1, 2, 3, 5, 8, 12, 20, 30, 50, 100, 200, 500, 1000], &[1]];

/// Error over the iteration limit and over time: all methods and limits in turn, round by round.
fn by_iterations(inputs: &Inputs, rounds: usize) -> [Plot; 2] {
    let mut plots = ["iteration limit", "ns per matrix"].map(|x| Plot {
        title: format!("Error over {x}: {}", inputs.name),
        x: Axis::log(x),
        y: Axis::log("error, rad"),
        series: vec![],
    });
    let runs: Vec<(usize, usize)> = ITERATIONS
        .iter()
        .enumerate()
        .flat_map(|(method, turns)| turns.iter().map(move |&most| (method, most)))
        .collect();
    let mut times = inputs.times(rounds, &runs).into_iter();
    for (i, (name, method, _)) in METHODS.iter().enumerate() {
        let mut points: [Vec<Point>; 2] = [vec![], vec![]];
        for (&most, ns) in ITERATIONS[i].iter().zip(&mut times) {
            let errors = inputs.errors(*method, most);
            #[expect(clippy::cast_precision_loss, reason = "few turns")]
            let turns = Samples::from(most as f64);
            for (points, x) in points.iter_mut().zip([turns, ns]) {
                points.push(Point { label: format!("{most} iterations"), x, y: errors.clone() });
            }
        }
        for (plot, points) in plots.iter_mut().zip(points) {
            plot.series.push(Series { name: (*name).to_owned(), points, is_joined: true });
        }
    }
    plots[0].series.pop();
    plots
}

/// Short names of the methods.
const SHORT_NAMES: [&str; 3] = ["ours", "the paper's listing", "singular values"];

/// The worst errors and the times of every method, the most accurate one over angles and over conditions, and the
/// fastest.
fn sentence(by_condition: &[Vec<(Samples, Samples)>], by_angle: &[Vec<(Samples, Samples)>]) -> String {
    let worst = |rows: &[Vec<(Samples, Samples)>]| -> [f64; 3] {
        std::array::from_fn(|method| rows.iter().map(|methods| methods[method].0.range()[1]).fold(0.0, f64::max))
    };
    let ns: [f64; 3] = std::array::from_fn(|method| {
        let all: Vec<f64> = by_condition.iter().chain(by_angle).map(|methods| methods[method].1.median()).collect();
        Samples::from(all).median()
    });
    let least = |of: [f64; 3]| SHORT_NAMES[(0..3).min_by(|&a, &b| of[a].total_cmp(&of[b])).unwrap_or(0)];
    let listed = |of: [f64; 3], unit: &str| {
        let all: Vec<String> =
            SHORT_NAMES.iter().zip(of).map(|(name, x)| format!("{name} {}{unit}", number(x))).collect();
        all.join(", ")
    };
    let [angles, conditions] = [worst(by_angle), worst(by_condition)];
    let exact = match (least(angles), least(conditions)) {
        (a, b) if a == b => {
            format!("{a} {} the most accurate in the worst case over angles and over conditions", is(a))
        }
        (a, b) => format!("{a} {} the most accurate in the worst case over angles and {b} over conditions", is(a)),
    };
    let fast = least(ns);
    format!(
        "{}, and {fast} {} the least time: worst errors over angles up to 180° are {}, over conditions up to 1e12 {}; times per \
         matrix are {} (medians).",
        capital(&exact),
        if fast == SHORT_NAMES[2] { "take" } else { "takes" },
        listed(angles, " rad"),
        listed(conditions, " rad"),
        listed(ns, " ns"),
    )
}

fn is(name: &str) -> &'static str {
    if name == SHORT_NAMES[2] { "are" } else { "is" }
}

fn capital(text: &str) -> String {
    let (first, rest) = text.split_at(1);
    first.to_uppercase() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sentence_names_the_best_method() {
        let of = |errors: [f64; 3], ns: [f64; 3]| -> Vec<(Samples, Samples)> {
            errors.into_iter().zip(ns).map(|(error, ns)| (error.into(), ns.into())).collect()
        };
        let ns = [300.0, 900.0, 100.0];
        let text = sentence(&[of([1e-5, 3.0, 1e-6], ns)], &[of([1e-15, 1e-9, 1e-16], ns)]);
        assert!(text.starts_with(
            "Singular values are the most accurate in the worst case over angles and over conditions, and singular values take"
        ));
        let text = sentence(&[of([1e-7, 3.0, 1e-6], ns)], &[of([1e-15, 1e-9, 1e-16], [50.0, 900.0, 100.0])]);
        assert!(
            text.starts_with(
                "Singular values are the most accurate in the worst case over angles and ours over conditions"
            ),
            "{text}"
        );
        assert!(text.ends_with(
            "times per matrix are ours 175 ns, the paper's listing 900 ns, singular values 100 ns (medians)."
        ));
    }

    #[test]
    fn zero_iterations_and_zero_error_fit_logarithmic_axes() {
        let exact =
            Inputs { name: "none".to_owned(), matrices: vec![(diagonal([3.0, 2.0, 1.0]), Quaternion::IDENTITY)] };
        let rounded = Inputs::new("angle 0°".to_owned(), [3.0, 2.0, 1.0], Some(0.0), 5);
        for (name, method, most) in METHODS {
            assert_eq!(exact.errors(method, most).values(), [NOTHING_RAD], "{name}");
            let errors = rounded.errors(method, most);
            let [least, greatest] = errors.range();
            assert!(least >= NOTHING_RAD && greatest < 1e-8 && errors.spread().is_finite(), "{name}: {errors:?}");
        }
    }

    #[test]
    fn every_iteration_limit_has_its_time() {
        let inputs = Inputs::new("plain".to_owned(), [1.0, 0.5, 0.25], None, 2);
        let [over_turns, over_time] = by_iterations(&inputs, 1);
        let counts = |plot: &Plot| plot.series.iter().map(|series| series.points.len()).collect::<Vec<_>>();
        assert_eq!(counts(&over_turns), ITERATIONS.map(<[usize]>::len)[..2]);
        assert_eq!(counts(&over_time), ITERATIONS.map(<[usize]>::len));
        assert!(over_time.series[1].points.iter().all(|point| point.x.values().len() == 1));
    }
}
