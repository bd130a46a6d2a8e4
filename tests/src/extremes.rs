//! The numerical contract, case by case, as data: what is promised, what judges it, and the worst that was measured.
//!
//! ```text
//! a case's inputs -> a routine -> an oracle simpler than it -> Row { promise, bound, worst }
//! ```
//!
//! A row is one routine on one case. Tests assert that every row of ours holds; `cargo xtask extremes` writes all of them,
//! with what peers do on the same input, and the report shows them. Nothing here depends on a clock: the same rows on every
//! run. Not covered: how long anything takes (`degenerate.rs`, the benches).

mod film;
mod fit;
pub mod hierarchy;
mod instance;
mod merge;
mod rotation;
pub mod slab;
mod trackers;
mod tree;
pub mod triangle;

use std::collections::BTreeMap;

pub use trackers::{TRACKERS, Tracker};

use crate::tracers::Way;

/// What says whether a promise was kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Oracle {
    /// Integers or fractions on the same bits of input.
    Exact,
    /// A loop over all triangles with the same test.
    Loop,
    /// The routine itself on an input whose answer must be the same, or known from this one's.
    Same,
    /// What a sound result looks like, by definition.
    Structure,
    /// Singular values or eigenvalues by Jacobi's method in `f64`.
    Jacobi,
    /// An answer known in closed form.
    Known,
}

impl Oracle {
    /// A few words for tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact arithmetic",
            Self::Loop => "every triangle",
            Self::Same => "the same in other words",
            Self::Structure => "definition",
            Self::Jacobi => "Jacobi in f64",
            Self::Known => "closed form",
        }
    }
}

/// What is promised of a station on one kind of input.
#[derive(Clone, Copy, Debug)]
pub struct Promise {
    /// The station: `fit`, `merge`, and so on.
    pub station: &'static str,
    /// The kind of input.
    pub case: &'static str,
    /// The promise, in words.
    pub promise: &'static str,
    /// What judges it.
    pub oracle: Oracle,
    /// Greatest value of a row that keeps it; infinite where the value is told and nothing is promised of it.
    pub bound: f64,
    /// What the values count.
    pub unit: &'static str,
}

impl Promise {
    /// A promise of which a count of failures says everything: there may be none.
    #[must_use]
    pub const fn none(
        station: &'static str,
        case: &'static str,
        promise: &'static str,
        oracle: Oracle,
        unit: &'static str,
    ) -> Self {
        Self { station, case, promise, oracle, bound: 0.0, unit }
    }

    /// What a routine of ours did.
    #[must_use]
    pub fn row(&self, routine: impl Into<String>, n_inputs: usize, worst: f64) -> Row {
        Row { promise: *self, routine: routine.into(), is_peer: false, n_inputs, worst }
    }

    /// How often a routine of ours failed.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "counts far below 2^52")]
    pub fn count(&self, routine: impl Into<String>, n_inputs: usize, n_failed: usize) -> Row {
        self.row(routine, n_inputs, n_failed as f64)
    }
}

/// What one routine did on one case.
#[derive(Clone, Debug)]
pub struct Row {
    /// What was promised.
    pub promise: Promise,
    /// Who was asked.
    pub routine: String,
    /// Whether it is another project's, of which nothing is promised.
    pub is_peer: bool,
    /// Inputs tried.
    pub n_inputs: usize,
    /// The worst value over all of them.
    pub worst: f64,
}

impl Row {
    /// Whether ours promises it: neither a peer's nor one that is only told.
    #[must_use]
    pub fn is_promise(&self) -> bool {
        !self.is_peer && self.promise.bound.is_finite()
    }

    /// Whether the promise was kept; what is not a number keeps none.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.n_inputs > 0 && self.worst <= self.promise.bound
    }
}

/// Every row of every station.
///
/// `effort` multiplies the inputs tried: tests use 1. `ways` are whom the cases with rays are put before.
#[must_use]
pub fn rows(effort: usize, ways: &[Way]) -> Vec<Row> {
    let mut rows = [fit::rows(effort), merge::rows(effort), rotation::rows(effort), tree::rows()].concat();
    rows.extend([slab::rows(effort), triangle::rows(effort), hierarchy::rows(effort, ways)].concat());
    rows.extend([instance::rows(effort), film::rows()].concat());
    rows.extend(TRACKERS.iter().flat_map(|tracker| (tracker.rows)(ways)));
    rows
}

/// A line each promise: station, case, promise, judge, bound, the worst of ours, peers; routines of equal value side by side.
#[must_use]
pub fn lines(rows: &[Row]) -> Vec<[String; 7]> {
    let line = |around: &[Row]| {
        let Promise { station, case, promise, oracle, bound, unit } = around[0].promise;
        let bound = if bound.is_finite() { format!("{} {unit}", number(bound)) } else { format!("told, {unit}") };
        let words = [station, case, promise, oracle.name()].map(str::to_owned);
        let [station, case, promise, oracle] = words;
        [station, case, promise, oracle, bound, values(around, false), values(around, true)]
    };
    rows.chunk_by(|a, b| key(a) == key(b)).map(line).collect()
}

/// The rows as Markdown.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let mut lines = vec![
        "| station | case | promise | judged by | bound | worst of ours | peers |".to_owned(),
        "|---|---|---|---|---|---|---|".to_owned(),
    ];
    lines.extend(self::lines(rows).into_iter().map(|line| format!("| {} |", line.join(" | "))));
    let promised = || rows.iter().filter(|row| row.is_promise());
    let (n_held, n_ours) = (promised().filter(|row| row.holds()).count(), promised().count());
    lines.push(format!("| all | | | | | {n_held} of {n_ours} promises kept | |"));
    lines.join("\n")
}

fn key(row: &Row) -> [&'static str; 3] {
    [row.promise.station, row.promise.case, row.promise.promise]
}

/// `value (routines)`, in the order of the first routine of each value; of one value alone the routines are counted.
fn values(rows: &[Row], is_peer: bool) -> String {
    let mut order: Vec<String> = vec![];
    let mut by_value: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.is_peer == is_peer) {
        let broken = if row.is_peer || row.holds() { "" } else { "**broken** " };
        let value = format!("{broken}{} of {}", number(row.worst), row.n_inputs);
        if !by_value.contains_key(&value) {
            order.push(value.clone());
        }
        by_value.entry(value).or_default().push(&row.routine);
    }
    order.iter().map(|value| format!("{value} ({})", by_value[value].join(", "))).collect::<Vec<_>>().join("; ")
}

/// A number as tables show it: whole where it is, else three digits.
fn number(x: f64) -> String {
    if x == x.round() && x.abs() < 1e7 {
        format!("{x}")
    } else if (1e-3..1e5).contains(&x.abs()) {
        format!("{x:.4}")
    } else {
        format!("{x:.2e}")
    }
}

/// What rounding a frame to `f32` may add to a box that is merged along it, relative to its greatest half-extent.
///
/// The frame is rounded in the child and in the parent, by half a unit in the last place of each of three entries, and
/// turns the box's diagonal, `√3` times as long at most.
pub(crate) const REFRAMED: f64 = 2.0 * 3.0 * 1.733 * 0.5 * f32::EPSILON as f64;

#[cfg(test)]
mod tests {
    use super::*;

    const PROMISE: Promise = Promise::none("fit", "a case", "holds", Oracle::Exact, "points");

    #[test]
    fn what_is_broken_is_seen_and_told() {
        let rows = [PROMISE.count("a", 3, 0), PROMISE.count("b", 3, 0), PROMISE.count("c", 3, 2)];
        assert_eq!(rows.iter().map(Row::holds).collect::<Vec<_>>(), [true, true, false]);
        let table = table(&rows);
        assert!(table.contains("| 0 of 3 (a, b); **broken** 2 of 3 (c) |  |"), "{table}");
        assert!(table.ends_with("2 of 3 promises kept | |"), "{table}");
    }

    #[test]
    fn no_input_and_no_number_keep_no_promise() {
        assert!(!PROMISE.count("a", 0, 0).holds());
        assert!(!PROMISE.row("a", 1, f64::NAN).holds());
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.0, 1.0, 0.25, 1e-9, 12_345_678.0].map(number), ["0", "1", "0.2500", "1.00e-9", "1.23e7"]);
    }
}
