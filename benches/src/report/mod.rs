//! One page that measures every trade-off of this project, `cargo xtask report`.
//!
//! ```text
//! chapters (plots, tables, each number with its repetitions) -> index.html, report.json, report.md
//! ```

mod boxes;
mod builds;
mod effort;
mod extremes;
mod fits;
mod growth;
mod hierarchies;
mod kernels;
mod markdown;
mod model;
mod page;
mod pictures;
mod rotation;
pub(crate) mod samples;
mod sources;
mod subjects;
mod unused;

use std::{fs, io::Write as _, path::Path};

use anyhow::{Context, Result};

use crate::clock::time_all;
use effort::Request;
use model::{Chapter, Report};

/// The argument that selects a report.
pub(crate) const REPORT: &str = "report";

/// Measures a chapter.
type Measure = fn(effort::Effort) -> Result<Chapter>;

/// All chapters, in the order of the page.
const CHAPTERS: [(&str, Measure); 9] = [
    ("pictures", pictures::chapter),
    ("boxes", boxes::chapter),
    ("rotation", rotation::chapter),
    ("kernels", kernels::chapter),
    ("hierarchies", hierarchies::chapter),
    ("sources", sources::chapter),
    ("left-out", unused::chapter),
    ("growth", growth::chapter),
    ("extremes", extremes::chapter),
];

/// Measures the requested chapters and writes the three files.
pub(crate) fn run(args: impl Iterator<Item = String>) -> Result<()> {
    let request = Request::read(args, &CHAPTERS.map(|(name, _)| name))?;
    let (chapters, seconds) = time_all(|| measured(&request));
    let chapters = chapters?;
    let report = Report { is_complete: chapters.len() == CHAPTERS.len(), facts: request.facts, chapters, seconds };
    writeln!(std::io::stderr(), "{}: {}", report.kind(), report.took())?;
    write(&request.out, "index.html", &page::page(&report)?)?;
    write(&request.out, "report.json", &serde_json::to_string(&report)?)?;
    write(&request.out, "report.md", &markdown::markdown(&report))
}

/// Measures every requested chapter.
fn measured(request: &Request) -> Result<Vec<Chapter>> {
    let mut chapters = vec![];
    let mut stderr = std::io::stderr();
    for (name, measure) in CHAPTERS.iter().filter(|(name, _)| request.wants(name)) {
        writeln!(stderr, "measuring {name}")?;
        let (chapter, seconds) = time_all(|| measure(request.effort));
        let chapter = Chapter { seconds, ..chapter.with_context(|| format!("chapter '{name}'"))? };
        writeln!(stderr, "{name}: {}", chapter.took())?;
        chapters.push(chapter);
    }
    Ok(chapters)
}

fn write(folder: &Path, name: &str, text: &str) -> Result<()> {
    let path = folder.join(name);
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(&path, text))
        .with_context(|| format!("cannot write {}", path.display()))
}
