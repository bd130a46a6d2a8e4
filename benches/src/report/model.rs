//! The content of a report: chapters of plots and tables, each number with its repetitions.

use std::collections::BTreeMap;

use serde::Serialize;

use super::samples::Samples;
use crate::clock::Seconds;

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
}

fn formatted(Seconds { wall, cpu }: Seconds) -> String {
    format!("{wall:.1} s ({cpu:.1} processor seconds)")
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

/// A measured point: the medians, with bars from minimum to maximum.
#[derive(Debug, Serialize)]
pub(crate) struct Point {
    /// A label, if the series name is not enough.
    pub(crate) label: String,
    pub(crate) x: Samples,
    pub(crate) y: Samples,
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
