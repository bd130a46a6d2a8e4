//! `cargo xtask agree A B`: whether two reports, as of a quick run and of a full one, say the same of what both measured.
//!
//! Points of plots are compared that have the same plot, series, label and place; they agree where their repetitions meet.
//! Plots of other sizes have other titles, so what was made larger in a full run is not compared with what was not.

use std::{collections::BTreeMap, fs, path::Path};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::command::say;

/// Every repetition, by what was measured: plot, series, label, axis.
type Measured = BTreeMap<[String; 4], Vec<f64>>;

/// Prints what does not agree; whether everything does.
pub(crate) fn run(a: &Path, b: &Path) -> Result<bool> {
    let [a, b] = [a, b].map(|path| -> Result<Measured> {
        let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        Ok(measured(&serde_json::from_str(&text).with_context(|| format!("{} is not JSON", path.display()))?))
    });
    let (a, b) = (a?, b?);
    let (n_shared, apart) = compare(&a, &b);
    ensure!(n_shared > 0, "the two reports measured nothing in common");
    for line in &apart {
        say(line);
    }
    say(&format!("{} of {n_shared} shared values agree within their spreads", n_shared - apart.len()));
    Ok(apart.is_empty())
}

/// How many values both measured, and a line for each that does not agree.
fn compare(a: &Measured, b: &Measured) -> (usize, Vec<String>) {
    let shared: Vec<_> = a.iter().filter_map(|(key, a)| Some((key, a, b.get(key)?))).collect();
    let line = |&(key, a, b): &(&[String; 4], &Vec<f64>, &Vec<f64>)| {
        let ([low, high], [other_low, other_high]) = (range(a), range(b));
        let meets = low <= other_high && other_low <= high;
        let words = key.iter().filter(|word| !word.is_empty()).cloned().collect::<Vec<_>>().join(", ");
        (!meets).then(|| format!("{words}: {low:.4e} to {high:.4e} and {other_low:.4e} to {other_high:.4e}"))
    };
    (shared.len(), shared.iter().filter_map(line).collect())
}

fn range(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &x| [low.min(x), high.max(x)])
}

/// The points of a report that were measured more than once; of an axis of single numbers the number is a place.
fn measured(report: &Value) -> Measured {
    let list = |value: &Value, key: &str| value[key].as_array().cloned().unwrap_or_default();
    let word = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let mut all = Measured::new();
    for plot in list(report, "chapters").iter().flat_map(|chapter| list(chapter, "plots")) {
        for series in list(&plot, "series") {
            for point in list(&series, "points") {
                let [x, y] = ["x", "y"]
                    .map(|axis| -> Vec<f64> { list(&point, axis).iter().filter_map(Value::as_f64).collect() });
                let place =
                    if let [x] = x[..] { format!("{} {x}", word(&point["label"])) } else { word(&point["label"]) };
                for (axis, values) in [("x", x), ("y", y)] {
                    if values.len() > 1 {
                        let label = word(&plot[axis]["label"]);
                        all.insert(
                            [word(&plot["title"]), word(&series["name"]), place.trim().to_owned(), label],
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

    fn report(title: &str, place: f64, values: &[f64]) -> Measured {
        let point = json!({ "label": "p", "x": [place], "y": values });
        let series = json!([{ "name": "s", "points": [point] }]);
        let plot = json!({ "title": title, "x": { "label": "n" }, "y": { "label": "ns" }, "series": series });
        measured(&json!({ "chapters": [{ "plots": [plot] }] }))
    }

    #[test]
    fn repetitions_that_meet_agree() {
        let a = report("t", 1.0, &[1.0, 2.0]);
        assert_eq!(compare(&a, &report("t", 1.0, &[2.0, 3.0])), (1, vec![]));
        let (n, apart) = compare(&a, &report("t", 1.0, &[2.1, 3.0]));
        assert!(n == 1 && apart.len() == 1 && apart[0].starts_with("t, s, p 1, ns: 1"), "{apart:?}");
    }

    #[test]
    fn other_plots_places_and_single_values_are_not_compared() {
        let a = report("t", 1.0, &[1.0, 2.0]);
        for b in [report("u", 1.0, &[9.0, 9.5]), report("t", 2.0, &[9.0, 9.5]), report("t", 1.0, &[9.0])] {
            assert_eq!(compare(&a, &b).0, 0);
        }
    }
}
