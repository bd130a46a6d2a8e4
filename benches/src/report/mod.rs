//! One page with every choice of this project and its cost, `cargo xtask report`.
//!
//! ```text
//! chapters (plots, tables, each number with its repetitions) -> report.md and its plots, report.json
//! ```

mod boxes;
mod effort;
mod kernels;
mod model;
mod plot;
pub(crate) mod samples;
mod sources;
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
const CHAPTERS: [(&str, Measure); 4] = [
    ("boxes", boxes::chapter),
    ("kernels", kernels::chapter),
    ("sources", sources::chapter),
    ("left-out", unused::chapter),
];

/// Measures the requested chapters and writes the files.
pub(crate) fn run(args: impl Iterator<Item = String>) -> Result<()> {
    let request = Request::read(args, &CHAPTERS.map(|(name, _)| name))?;
    let (chapters, seconds) = time_all(|| measured(&request));
    let chapters = chapters?;
    let report = Report { is_complete: chapters.len() == CHAPTERS.len(), facts: request.facts, chapters, seconds };
    writeln!(std::io::stderr(), "{}: {}", report.kind(), report.took())?;
    for (number, plot) in report.chapters.iter().flat_map(|chapter| &chapter.plots).enumerate() {
        write(&request.out, &plot::file(number), &plot::svg(plot))?;
    }
    write(&request.out, "report.json", &serde_json::to_string(&report)?)?;
    write(&request.out, "report.md", &model::markdown(&report))
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
    fs::create_dir_all(path.parent().unwrap_or(folder))
        .and_then(|()| fs::write(&path, text))
        .with_context(|| format!("cannot write {}", path.display()))
}
