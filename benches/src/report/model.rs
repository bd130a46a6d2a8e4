//! The content of a report: chapters of plots and tables, each number with its repetitions, and the same as Markdown.

use std::{collections::BTreeMap, fmt::Write as _};

use serde::Serialize;

use super::samples::Samples;
use crate::timing::Seconds;

/// Everything that was measured, and where, when and how.
#[derive(Serialize)]
pub(crate) struct Report {
    pub(crate) facts: Facts,
    pub(crate) chapters: Vec<Chapter>,
    /// Whether all chapters are included.
    pub(crate) is_complete: bool,
    /// Time of the measurement; processor time covers all threads.
    pub(crate) seconds: Seconds,
}

impl Report {
    /// The kind of run, in words.
    pub(crate) fn kind(&self) -> String {
        let kind = if self.facts.is_quick { "quick run" } else { "full run" };
        if self.is_complete { format!("a {kind}") } else { format!("a {kind} of some chapters") }
    }

    /// The time of the measurement, in words.
    pub(crate) fn took(&self) -> String {
        formatted(self.seconds)
    }
}

/// Where, when and how a report was made.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Facts {
    /// Processor and threads.
    pub(crate) machine: String,
    pub(crate) compiler: String,
    pub(crate) commit: String,
    pub(crate) date: String,
    pub(crate) command: String,
    /// Whether sizes and repetitions were reduced.
    pub(crate) is_quick: bool,
}

/// A question, its answer, and the measurements for it.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Chapter {
    /// A word that names the section's anchor and its claims.
    pub(crate) id: &'static str,
    pub(crate) title: &'static str,
    /// The main finding: one sentence made from the numbers.
    pub(crate) says: String,
    /// Further findings, a sentence each.
    pub(crate) findings: Vec<String>,
    /// How it was measured, in paragraphs.
    pub(crate) method: Vec<String>,
    pub(crate) plots: Vec<Plot>,
    pub(crate) tables: Vec<Table>,
    /// What was not measured, and why.
    pub(crate) skipped: Vec<String>,
    /// Values for other pages, by name.
    pub(crate) claims: BTreeMap<String, String>,
    /// Time of the measurement; processor time covers all threads.
    pub(crate) seconds: Seconds,
}

impl Chapter {
    /// Takes the first sentence as the main finding and the others as further findings; skips empty ones, whose inputs
    /// were not available.
    pub(crate) fn set_sentences(&mut self, sentences: impl IntoIterator<Item = String>) {
        let mut formatted = sentences.into_iter().filter(|sentence| !sentence.is_empty());
        self.says = formatted.next().unwrap_or_default();
        self.findings = formatted.collect();
    }

    /// The time of the measurement, in words.
    pub(crate) fn took(&self) -> String {
        formatted(self.seconds)
    }

    /// Adds a plot.
    pub(crate) fn plot(&mut self, title: impl Into<String>, x: Axis, y: Axis, series: Vec<Series>) {
        self.plots.push(Plot { title: title.into(), x, y, series });
    }
}

fn formatted(Seconds { wall, cpu }: Seconds) -> String {
    format!("{wall:.1} s ({cpu:.1} processor seconds)")
}

/// How much is measured.
///
/// A quick report has fewer scenes, seeds and rounds than a full one, but as many rays and inputs in what both measure:
/// fewer would suit caches and branch prediction better, and change the times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effort {
    /// The minimum that fills every plot and table, for tests.
    Tiny,
    /// Five minutes on two cores.
    Quick,
    /// An hour on two cores.
    Full,
}

impl Effort {
    /// The value for each effort.
    pub(crate) fn pick<T>(self, tiny: T, quick: T, full: T) -> T {
        match self {
            Self::Tiny => tiny,
            Self::Quick => quick,
            Self::Full => full,
        }
    }
}

/// Points in a plane.
#[derive(Debug, Serialize)]
pub(crate) struct Plot {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) series: Vec<Series>,
}

/// An axis of a plot.
#[derive(Debug, Serialize)]
pub(crate) struct Axis {
    /// Quantity and unit.
    pub(crate) label: String,
    pub(crate) is_log: bool,
}

impl Axis {
    pub(crate) fn log(label: impl Into<String>) -> Self {
        Self { label: label.into(), is_log: true }
    }

    pub(crate) fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), is_log: false }
    }
}

/// Points that belong together.
#[derive(Debug, Serialize)]
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) points: Vec<Point>,
    /// Whether a line connects them in order.
    pub(crate) is_joined: bool,
}

impl Series {
    /// Points that no line connects.
    pub(crate) fn dots(name: impl Into<String>, points: Vec<Point>) -> Self {
        Self { name: name.into(), points, is_joined: false }
    }

    /// Points that a line connects in order.
    pub(crate) fn line(name: impl Into<String>, points: Vec<Point>) -> Self {
        Self { name: name.into(), points, is_joined: true }
    }
}

/// A measured point: the medians, with bars from minimum to maximum.
#[derive(Debug, Serialize)]
pub(crate) struct Point {
    /// A label, if the series name is not enough.
    pub(crate) label: String,
    pub(crate) x: Samples,
    pub(crate) y: Samples,
}

impl Point {
    pub(crate) fn new(label: impl Into<String>, x: impl Into<Samples>, y: impl Into<Samples>) -> Self {
        Self { label: label.into(), x: x.into(), y: y.into() }
    }
}

/// Rows under a head.
#[derive(Debug, Serialize)]
pub(crate) struct Table {
    pub(crate) title: String,
    /// What the table shows, for instance whether a source's claim holds; may be empty.
    pub(crate) says: String,
    pub(crate) head: Vec<String>,
    pub(crate) rows: Vec<Vec<Cell>>,
}

impl Table {
    pub(crate) fn new(title: impl Into<String>, head: &[&str]) -> Self {
        Self {
            title: title.into(),
            says: String::new(),
            head: head.iter().map(|&word| word.to_owned()).collect(),
            rows: vec![],
        }
    }
}

/// A cell of a table.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum Cell {
    /// Text, or a number without repetitions, such as a count or a value from a source.
    Text(String),
    /// A measured quantity in a unit, empty for a plain number.
    Measured {
        /// Every repetition.
        samples: Samples,
        unit: &'static str,
    },
}

impl Cell {
    pub(crate) fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    pub(crate) fn measured(samples: impl Into<Samples>, unit: &'static str) -> Self {
        Self::Measured { samples: samples.into(), unit }
    }

    /// As it is printed.
    pub(crate) fn show(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Measured { samples, unit } => {
                let space = if unit.is_empty() { "" } else { " " };
                format!("{samples}{space}{unit}")
            }
        }
    }
}

/// The file of a plot, in the folder of the page.
pub(super) fn plot_file(number: usize) -> String {
    format!("plots/{number:02}.svg")
}

/// All chapters with their plots, then their times.
pub(super) fn markdown(report: &Report) -> String {
    let mut n_plots = 0;
    let mut out = String::new();
    for chapter in &report.chapters {
        out += &section(chapter, n_plots);
        n_plots += chapter.plots.len();
    }
    out + &times(report)
}

/// The time of each chapter and the total.
fn times(report: &Report) -> String {
    let mut table = Table::new("Seconds by chapter", &["chapter", "seconds", "processor seconds"]);
    let all = report.chapters.iter().map(|chapter| (chapter.id, chapter.seconds)).chain([("all", report.seconds)]);
    for (name, Seconds { wall, cpu }) in all {
        table.rows.push([name.to_owned(), format!("{wall:.1}"), format!("{cpu:.1}")].map(Cell::text).to_vec());
    }
    let mut out = format!("## Report: Duration of {}\n\n**Measured in {}.**\n\n", report.kind(), report.took());
    write_rows(&mut out, &table);
    out
}

fn section(chapter: &Chapter, n_plots_before: usize) -> String {
    let mut out = format!("## Report: {}\n\n**{}**\n\n", chapter.title, chapter.says);
    for finding in &chapter.findings {
        let _ = writeln!(out, "* {finding}");
    }
    if !chapter.findings.is_empty() {
        out.push('\n');
    }
    for paragraph in &chapter.method {
        let _ = writeln!(out, "{paragraph}\n");
    }
    for table in &chapter.tables {
        write_rows(&mut out, table);
    }
    for (number, plot) in (n_plots_before..).zip(&chapter.plots) {
        let _ = writeln!(out, "![{}]({})\n", plot.title, plot_file(number));
    }
    for skipped in &chapter.skipped {
        let _ = writeln!(out, "* Not measured: {skipped}");
    }
    if !chapter.skipped.is_empty() {
        out.push('\n');
    }
    let _ = writeln!(out, "Measured in {}.\n", chapter.took());
    out
}

fn write_rows(out: &mut String, table: &Table) {
    let _ = writeln!(out, "### {}\n", table.title);
    if !table.says.is_empty() {
        let _ = writeln!(out, "{}\n", table.says);
    }
    let _ = writeln!(out, "| {} |", table.head.join(" | "));
    let _ = writeln!(out, "|{}", " --- |".repeat(table.head.len()));
    for row in &table.rows {
        let cells: Vec<String> = row.iter().map(|cell| cell.show().replace('|', "\\|")).collect();
        let _ = writeln!(out, "| {} |", cells.join(" | "));
    }
    out.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::model::Facts;

    #[test]
    fn tables_are_markdown() {
        let mut table = Table::new("T", &["a", "b"]);
        table.rows.push(vec![Cell::text("x|y"), Cell::measured(vec![1.0, 1.0], "ms")]);
        let mut chapter = Chapter {
            id: "c",
            title: "C",
            tables: vec![table],
            skipped: vec!["z".to_owned()],
            seconds: Seconds { wall: 61.24, cpu: 120.0 },
            ..Chapter::default()
        };
        chapter.set_sentences(["", "It shows.", "", "And more."].map(str::to_owned));
        let seconds = Seconds { wall: 62.0, cpu: 121.0 };
        let mut report = Report { facts: Facts::default(), chapters: vec![chapter], is_complete: true, seconds };
        let text = markdown(&report);
        assert!(
            text.starts_with("## Report: C\n\n**It shows.**\n\n* And more.\n\n### T\n\n| a | b |\n| --- | --- |\n"),
            "{text}"
        );
        let (chapter, times) = text.split_once("## Report: Duration of a full run\n\n").unwrap();
        let end = "| x\\|y | 1.00 ±0% ms |\n\n* Not measured: z\n\nMeasured in 61.2 s (120.0 processor seconds).\n\n";
        assert!(chapter.ends_with(end), "{text}");
        assert!(times.starts_with("**Measured in 62.0 s (121.0 processor seconds).**\n\n### Seconds by chapter\n"));
        assert!(times.ends_with("| c | 61.2 | 120.0 |\n| all | 62.0 | 121.0 |\n\n"), "{times}");
        // A partial run does not replace a full one.
        (report.is_complete, report.facts.is_quick) = (false, true);
        assert!(markdown(&report).contains("## Report: Duration of a quick run of some chapters\n"));
    }
}
