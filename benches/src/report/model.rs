//! What a report holds: chapters of plots and tables, each number with its repetitions.

use std::collections::BTreeMap;

use serde::Serialize;

use super::samples::Samples;
use crate::clock::Seconds;

/// Everything that was measured, and where, when and how.
#[derive(Serialize)]
pub(crate) struct Report {
    pub(crate) facts: Facts,
    pub(crate) chapters: Vec<Chapter>,
    /// Whether no chapter is left out.
    pub(crate) is_whole: bool,
    /// What measuring all of it took, the processors' of all threads.
    pub(crate) seconds: Seconds,
}

impl Report {
    /// How much was run, in words.
    pub(crate) fn kind(&self) -> String {
        let kind = if self.facts.is_quick { "quick run" } else { "full run" };
        if self.is_whole { format!("a {kind}") } else { format!("a {kind} of some chapters") }
    }

    /// What all of it took, in words.
    pub(crate) fn took(&self) -> String {
        told(self.seconds)
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
    /// Whether sizes and repetitions were cut down.
    pub(crate) is_quick: bool,
}

/// A question, its answer, and what was measured for it.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Chapter {
    /// A word: names the section's anchor and its claims.
    pub(crate) id: &'static str,
    pub(crate) title: &'static str,
    /// The one sentence that the chapter shows, made from its numbers.
    pub(crate) says: String,
    /// What else it shows, a sentence each.
    pub(crate) findings: Vec<String>,
    /// How it was measured: a paragraph each.
    pub(crate) method: Vec<String>,
    pub(crate) plots: Vec<Plot>,
    pub(crate) tables: Vec<Table>,
    /// What was not measured, by name, and why.
    pub(crate) skipped: Vec<String>,
    /// Values that other pages quote, by name.
    pub(crate) claims: BTreeMap<String, String>,
    /// What measuring it took, the processors' of all threads.
    pub(crate) seconds: Seconds,
}

impl Chapter {
    /// Takes the first sentence as what the chapter shows and the others as findings; empty ones are of what was not there to
    /// be measured.
    pub(crate) fn tell(&mut self, sentences: impl IntoIterator<Item = String>) {
        let mut told = sentences.into_iter().filter(|sentence| !sentence.is_empty());
        self.says = told.next().unwrap_or_default();
        self.findings = told.collect();
    }

    /// What measuring it took, in words.
    pub(crate) fn took(&self) -> String {
        told(self.seconds)
    }
}

fn told(Seconds { wall, cpu }: Seconds) -> String {
    format!("{wall:.1} s, of all processors {cpu:.1} s")
}

/// Points in a plane.
#[derive(Debug, Serialize)]
pub(crate) struct Plot {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) series: Vec<Series>,
}

/// One axis of a plot.
#[derive(Debug, Serialize)]
pub(crate) struct Axis {
    /// What it shows, and in what unit.
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
    /// Whether a line joins them in their order.
    pub(crate) is_joined: bool,
}

/// A measured point: its place is the medians, its bars reach from least to greatest.
#[derive(Debug, Serialize)]
pub(crate) struct Point {
    /// What it stands for, where the series does not say.
    pub(crate) label: String,
    pub(crate) x: Samples,
    pub(crate) y: Samples,
}

/// Rows under a head.
#[derive(Debug, Serialize)]
pub(crate) struct Table {
    pub(crate) title: String,
    pub(crate) head: Vec<String>,
    pub(crate) rows: Vec<Vec<Cell>>,
}

impl Table {
    pub(crate) fn new(title: impl Into<String>, head: &[&str]) -> Self {
        Self { title: title.into(), head: head.iter().map(|&word| word.to_owned()).collect(), rows: vec![] }
    }
}

/// One entry of a table.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum Cell {
    /// Words, or a number without repetitions: a count, or one that a source gives.
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
