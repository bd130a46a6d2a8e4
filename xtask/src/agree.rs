//! `cargo xtask agree A B`: compares two reports, e.g. of a quick and a full run, where they measured the same.
//!
//! Two points are compared if plot, series, label and position are the same; they agree if the ranges of their repetitions
//! overlap. Plots of different sizes have different titles. Clock and caches of the machine change between two runs, so
//! times are divided by the median ratio of all times of their plot, which is printed.

use std::{collections::BTreeMap, fs, path::Path};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::command::say;

/// Every repetition, by what was measured: plot, series, label, axis.
type Measured = BTreeMap<[String; 4], Vec<f64>>;

/// Prints the values that disagree. Returns whether all agree.
pub(crate) fn run(a: &Path, b: &Path) -> Result<bool> {
    let [a, b] = [a, b].map(|path| -> Result<Measured> {
        let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        Ok(measured(&serde_json::from_str(&text).with_context(|| format!("{} is not JSON", path.display()))?))
    });
    let (a, b) = (a?, b?);
    let Compared { n_shared, n_times, n_times_apart, speeds, apart } = compare(&a, &b);
    ensure!(n_shared > 0, "the two reports measured nothing in common");
    for line in speeds.iter().chain(&apart) {
        say(line);
    }
    let n_others = n_shared - n_times;
    say(&format!(
        "{} of {n_times} times agree within their spreads, and {} of {n_others} other values",
        n_times - n_times_apart,
        n_others + n_times_apart - apart.len()
    ));
    Ok(apart.is_empty())
}

/// How two reports compare.
#[derive(Debug, Default, PartialEq)]
struct Compared {
    n_shared: usize,
    n_times: usize,
    n_times_apart: usize,
    /// A line for each plot of times: the ratio of the second report to the first.
    speeds: Vec<String>,
    /// A line for each value that disagrees.
    apart: Vec<String>,
}

fn compare(a: &Measured, b: &Measured) -> Compared {
    let mut plots: BTreeMap<[&str; 2], Vec<_>> = BTreeMap::new();
    for (key, a) in a {
        if let Some(b) = b.get(key) {
            plots.entry([&key[0], &key[3]]).or_default().push((key, a, b));
        }
    }
    let mut all = Compared::default();
    for ([plot, axis], shared) in plots {
        all.n_shared += shared.len();
        let mut speed = 1.0;
        if is_of_time(axis) {
            all.n_times += shared.len();
            speed = median(shared.iter().map(|(_, a, b)| median(b.iter().copied()) / median(a.iter().copied())));
            all.speeds.push(format!("{plot}, {axis}: {speed:.2} times (median)"));
        }
        for (key, a, b) in shared {
            let ([low, high], [other_low, other_high]) = (range(a), range(b));
            if low * speed > other_high || other_low > high * speed {
                all.n_times_apart += usize::from(is_of_time(axis));
                let words = key.iter().filter(|word| !word.is_empty()).cloned().collect::<Vec<_>>().join(", ");
                all.apart.push(format!("{words}: {low:.4e} to {high:.4e} and {other_low:.4e} to {other_high:.4e}"));
            }
        }
    }
    all
}

/// Whether an axis depends on the speed of the machine.
fn is_of_time(axis: &str) -> bool {
    let unit = axis.split_once(' ').map_or(axis, |(first, _)| first);
    unit == "ns" || axis.ends_with(" a second") || [", s", ", ms", ", ns"].iter().any(|unit| axis.ends_with(unit))
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn range(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &x| [low.min(x), high.max(x)])
}

/// The points of a report that were measured more than once. A single number on an axis is part of the key.
fn measured(report: &Value) -> Measured {
    let list = |value: &Value, key: &str| value[key].as_array().cloned().unwrap_or_default();
    let word = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let mut all = Measured::new();
    for plot in list(report, "chapters").iter().flat_map(|chapter| list(chapter, "plots")) {
        for series in list(&plot, "series") {
            for point in list(&series, "points") {
                let [x, y] = ["x", "y"]
                    .map(|axis| -> Vec<f64> { list(&point, axis).iter().filter_map(Value::as_f64).collect() });
                let position =
                    if let [x] = x[..] { format!("{} {x}", word(&point["label"])) } else { word(&point["label"]) };
                for (axis, values) in [("x", x), ("y", y)] {
                    if values.len() > 1 {
                        let label = word(&plot[axis]["label"]);
                        all.insert(
                            [word(&plot["title"]), word(&series["name"]), position.trim().to_owned(), label],
                            values,
                        );
                    }
                }
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// A report of one plot, with a point for each list.
    fn report(title: &str, axis: &str, lists: &[&[f64]]) -> Measured {
        let point = |(i, values): (usize, &&[f64])| json!({ "label": "p", "x": [i], "y": values });
        let points: Vec<Value> = lists.iter().enumerate().map(point).collect();
        let series = json!([{ "name": "s", "points": points }]);
        let plot = json!({ "title": title, "x": { "label": "n" }, "y": { "label": axis }, "series": series });
        measured(&json!({ "chapters": [{ "plots": [plot] }] }))
    }

    #[test]
    fn overlapping_repetitions_agree() {
        let a = report("t", "area", &[&[1.0, 2.0]]);
        let compared = compare(&a, &report("t", "area", &[&[2.0, 3.0]]));
        assert_eq!(compared, Compared { n_shared: 1, ..Compared::default() });
        let apart = compare(&a, &report("t", "area", &[&[2.1, 3.0]])).apart;
        assert!(apart.len() == 1 && apart[0].starts_with("t, s, p 0, area: 1"), "{apart:?}");
    }

    #[test]
    fn a_slower_machine_agrees_and_another_order_does_not() {
        let lists: [&[f64]; 3] = [&[1.0, 1.1], &[2.0, 2.1], &[3.0, 3.1]];
        let a = report("t", "ns a ray", &lists);
        let slower: [&[f64]; 3] = [&[2.0, 2.2], &[4.0, 4.2], &[6.0, 6.2]];
        let compared = compare(&a, &report("t", "ns a ray", &slower));
        assert!(
            compared.apart.is_empty() && compared.n_times == 3 && compared.speeds[0].contains("2.00 times"),
            "{compared:?}"
        );
        let swapped: [&[f64]; 3] = [&[2.0, 2.2], &[6.0, 6.2], &[4.0, 4.2]];
        assert_eq!(compare(&a, &report("t", "ns a ray", &swapped)).n_times_apart, 2);
        assert_eq!(compare(&report("t", "area", &lists), &report("t", "area", &slower)).apart.len(), 3);
    }

    #[test]
    fn units_of_time_are_recognized() {
        assert!(
            ["ns", "ns a test", "build, s", "picture, ms", "a camera ray, ns", "million rays a second"].map(is_of_time)
                == [true; 6]
        );
        assert!(["area over least", "error, rad", "n", "units in the last place"].map(is_of_time) == [false; 4]);
    }

    #[test]
    fn other_plots_positions_and_single_values_are_not_compared() {
        let a = report("t", "ns", &[&[1.0, 2.0]]);
        let (one, other) = (&[9.0][..], &[9.0, 9.5][..]);
        for b in [report("u", "ns", &[other]), report("t", "ns", &[one, other]), report("t", "ns", &[one])] {
            assert_eq!(compare(&a, &b).n_shared, 0);
        }
    }
}
