//! A promise about a stage, the result of a routine, and rows of both as lines of a table.

use std::collections::BTreeSet;

/// What decides whether a promise holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Oracle {
    /// Exact arithmetic on the bits of the input.
    Exact,
    /// A loop over all triangles with the same test.
    Loop,
    /// The same routine on an equivalent input.
    Same,
    /// Properties required by definition.
    Structure,
    /// Singular values or eigenvalues by Jacobi's method in `f64`.
    Jacobi,
    /// A result known in closed form.
    Known,
}

impl Oracle {
    /// Short text for tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact arithmetic",
            Self::Loop => "loop over all triangles",
            Self::Same => "equivalent input",
            Self::Structure => "definition",
            Self::Jacobi => "Jacobi in f64",
            Self::Known => "closed form",
        }
    }
}

/// What a row's value is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// The number of failed inputs.
    Failed,
    /// The worst value over all inputs, in the promise's unit.
    Worst,
    /// The fraction of inputs for which the unit applies, between zero and one.
    Share,
}

/// What is promised about a stage for one kind of input.
#[derive(Clone, Copy, Debug)]
pub struct Promise {
    /// The stage: `fit`, `merge`, and so on.
    pub stage: &'static str,
    /// The kind of input.
    pub case: &'static str,
    /// The promise as text.
    pub promise: &'static str,
    /// The reference.
    pub oracle: Oracle,
    /// Greatest value that satisfies the promise; infinite if the value is only reported.
    pub bound: f64,
    /// Unit of the values.
    pub unit: &'static str,
}

impl Promise {
    /// A promise that allows no failure.
    #[must_use]
    pub const fn none(
        stage: &'static str,
        case: &'static str,
        promise: &'static str,
        oracle: Oracle,
        unit: &'static str,
    ) -> Self {
        Self { stage, case, promise, oracle, bound: 0.0, unit }
    }

    /// The same without a bound: the value is only reported.
    #[must_use]
    pub const fn reported(self) -> Self {
        Self { bound: f64::INFINITY, ..self }
    }

    /// The worst value of one of our routines.
    #[must_use]
    pub fn row(&self, routine: impl Into<String>, n_inputs: usize, worst: f64) -> Row {
        let measure = Measure::Worst;
        Row { promise: *self, routine: routine.into(), is_peer: false, n_inputs, worst, measure, n_cut: 0 }
    }

    /// The number of failures of one of our routines.
    #[must_use]
    pub fn count(&self, routine: impl Into<String>, n_inputs: usize, n_failed: usize) -> Row {
        Row { measure: Measure::Failed, ..self.row(routine, n_inputs, n_failed as f64) }
    }

    /// The number of failures of one of our routines on inputs with a certain result. Without any such input the row is only
    /// reported, because a routine that does nothing would pass.
    #[must_use]
    pub fn count_certain(&self, routine: impl Into<String>, n_certain: usize, n_failed: usize) -> Row {
        let promise = if n_certain == 0 { self.reported() } else { *self };
        promise.count(routine, n_certain, n_failed)
    }

    /// The fraction of inputs for which the unit applies.
    #[must_use]
    pub fn share(&self, routine: impl Into<String>, n_inputs: usize, n_so: usize) -> Row {
        Row { measure: Measure::Share, ..self.row(routine, n_inputs, n_so as f64 / n_inputs.max(1) as f64) }
    }
}

/// The result of one routine on one case.
#[derive(Clone, Debug)]
pub struct Row {
    /// The promise.
    pub promise: Promise,
    /// Name of the routine.
    pub routine: String,
    /// Whether it belongs to another project, which promises nothing.
    pub is_peer: bool,
    /// Number of inputs that are relevant to the promise.
    pub n_inputs: usize,
    /// The worst value over all of them, or the number of failures.
    pub worst: f64,
    /// What `worst` is.
    pub measure: Measure,
    /// Queries answered by the CPU because a driver ended the device's traversal early.
    pub n_cut: usize,
}

impl Row {
    /// Whether the row is a promise of ours: neither a peer's nor only reported.
    #[must_use]
    pub fn is_promise(&self) -> bool {
        !self.is_peer && self.promise.bound.is_finite()
    }

    /// Whether the value satisfies the bound; NaN does not.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.n_inputs > 0 && self.worst <= self.promise.bound
    }

    /// Whether it is a promise of ours that does not hold.
    #[must_use]
    pub fn is_broken(&self) -> bool {
        self.is_promise() && !self.holds()
    }
}

/// One line for each promise: stage, case, promise, reference, bound, our worst values, peers. Routines of equal value are grouped.
#[must_use]
pub fn lines(rows: &[Row]) -> Vec<[String; 7]> {
    let line = |around: &[Row]| {
        let Promise { stage, case, promise, oracle, .. } = around[0].promise;
        let [stage, case, promise, oracle] = [stage, case, promise, oracle.name()].map(str::to_owned);
        [stage, case, promise, oracle, bounds(around), values(around, false), values(around, true)]
    };
    rows.chunk_by(|a, b| key(a) == key(b)).map(line).collect()
}

/// The rows as Markdown.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let mut lines = vec![
        "| stage | case | promise | reference | bound | worst of ours | peers |".to_owned(),
        "|---|---|---|---|---|---|---|".to_owned(),
    ];
    lines.extend(self::lines(rows).into_iter().map(|line| format!("| {} |", line.join(" | "))));
    lines.push(format!("| all | | | | | {} | |", summary(rows)));
    lines.join("\n")
}

/// The number of promises and cases, and how many promises hold for every routine.
#[must_use]
pub fn summary(rows: &[Row]) -> String {
    let promised: Vec<&Row> = rows.iter().filter(|row| row.is_promise()).collect();
    let all: BTreeSet<[&str; 3]> = promised.iter().map(|row| key(row)).collect();
    let cases: BTreeSet<[&str; 2]> = all.iter().map(|&[stage, case, _]| [stage, case]).collect();
    let broken: BTreeSet<[&str; 3]> = promised.iter().filter(|row| row.is_broken()).map(|row| key(row)).collect();
    format!("Of {} promises on {} cases, {} hold.", all.len(), cases.len(), all.len() - broken.len())
}

fn key(row: &Row) -> [&'static str; 3] {
    [row.promise.stage, row.promise.case, row.promise.promise]
}

/// `value (routines)`, in the order of the first routine with each value.
fn together(reported: impl Iterator<Item = (String, String)>) -> String {
    let mut order: Vec<(String, Vec<String>)> = vec![];
    for (words, routine) in reported {
        match order.iter_mut().find(|(known, _)| *known == words) {
            Some((_, routines)) => routines.push(routine),
            None => order.push((words, vec![routine])),
        }
    }
    let words = order.into_iter().map(|(words, routines)| format!("{words} ({})", routines.join(", ")));
    words.collect::<Vec<_>>().join("; ")
}

/// The bound of all our routines, or each bound with its routines.
fn bounds(rows: &[Row]) -> String {
    let bound = |row: &Row| {
        let Promise { bound, unit, .. } = row.promise;
        if bound.is_finite() { format!("{} {unit}", number(bound)) } else { "reported".to_owned() }
    };
    let ours = || rows.iter().filter(|row| !row.is_peer);
    let one = ours().next().map(bound).filter(|first| ours().all(|row| bound(row) == *first));
    one.unwrap_or_else(|| together(ours().map(|row| (bound(row), row.routine.clone()))))
}

/// The values of our routines or of peers, with their inputs.
fn values(rows: &[Row], is_peer: bool) -> String {
    together(rows.iter().filter(|row| row.is_peer == is_peer).map(|row| (value(row), who(row))))
}

/// The value and the number of inputs.
fn value(row: &Row) -> String {
    let Row { promise: Promise { unit, .. }, n_inputs, worst, .. } = row;
    let inputs = if *n_inputs == 1 { "1 input".to_owned() } else { format!("{n_inputs} inputs") };
    let value = match row.measure {
        _ if *n_inputs == 0 => "no input is certain".to_owned(),
        Measure::Failed => format!("{} of {inputs}", number(*worst)),
        Measure::Worst => format!("{} {unit}, {inputs}", number(*worst)),
        Measure::Share => format!("{} % {unit}, {inputs}", number(100.0 * worst)),
    };
    if row.is_broken() { format!("**broken** {value}") } else { value }
}

/// The routine, and the number of queries that it did not answer itself.
fn who(row: &Row) -> String {
    let Row { routine, n_cut, .. } = row;
    if *n_cut == 0 { routine.clone() } else { format!("{routine} [{n_cut} queries ended early by the driver]") }
}

/// A number as shown in tables: an integer, or three digits.
fn number(x: f64) -> String {
    if x == x.round() && x.abs() < 1e7 {
        format!("{x}")
    } else if (1e-3..1e5).contains(&x.abs()) {
        format!("{x:.4}")
    } else {
        format!("{x:.2e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROMISE: Promise = Promise::none("fit", "a case", "holds", Oracle::Exact, "points");

    #[test]
    fn a_row_without_inputs_or_with_nan_does_not_hold() {
        assert!(!PROMISE.count("a", 0, 0).holds());
        assert!(!PROMISE.row("a", 1, f64::NAN).holds());
    }

    #[test]
    fn a_row_without_certain_inputs_promises_nothing() {
        let row = PROMISE.count_certain("a", 0, 0);
        assert!(!row.is_promise() && !row.is_broken());
        assert!(PROMISE.count_certain("a", 1, 1).is_broken() && !PROMISE.count_certain("a", 1, 0).is_broken());
    }

    #[test]
    fn broken_rows_are_marked() {
        let rows = [PROMISE.count("a", 3, 0), PROMISE.count("b", 3, 0), PROMISE.count("c", 3, 2)];
        assert_eq!(rows.iter().map(Row::holds).collect::<Vec<_>>(), [true, true, false]);
        let broken = table(&rows);
        assert!(broken.contains("| 0 points | 0 of 3 inputs (a, b); **broken** 2 of 3 inputs (c) |  |"), "{broken}");
        assert!(broken.ends_with("Of 1 promises on 1 cases, 0 hold. | |"), "{broken}");
        assert!(table(&rows[..2]).ends_with("Of 1 promises on 1 cases, 1 hold. | |"));
    }

    #[test]
    fn different_bounds_name_their_routines() {
        let peer = Row { is_peer: true, ..PROMISE.count("peer", 3, 3) };
        let rows = [PROMISE.count("a", 3, 0), PROMISE.reported().count("b", 3, 2), peer];
        assert!(
            table(&rows).contains(
                "| 0 points (a); reported (b) | 0 of 3 inputs (a); 2 of 3 inputs (b) | 3 of 3 inputs (peer) |"
            )
        );
        assert!(table(&rows[..1]).contains("| 0 points | 0 of 3 inputs (a) |  |"));
    }

    #[test]
    fn values_show_unit_and_inputs() {
        let reported = Promise { unit: "of all misses", ..PROMISE.reported() };
        assert_eq!(value(&reported.share("a", 400, 400)), "100 % of all misses, 400 inputs");
        assert_eq!(value(&reported.row("a", 1, 0.25)), "0.2500 of all misses, 1 input");
        let cut = Row { n_cut: 7, ..PROMISE.count("device", 3, 0) };
        assert_eq!(lines(&[cut])[0][5], "0 of 3 inputs (device [7 queries ended early by the driver])");
        assert_eq!(lines(&[PROMISE.count_certain("a", 0, 0)])[0][4..6], ["reported", "no input is certain (a)"]);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.0, 1.0, 0.25, 1e-9, 12_345_678.0].map(number), ["0", "1", "0.2500", "1.00e-9", "1.23e7"]);
    }
}
