//! One page with every choice of this project and its cost, `cargo xtask report`.
//!
//! ```text
//! chapters (plots, tables, each number with its repetitions) -> report.md and its plots, report.json
//! ```

mod boxes;
mod kernels;
mod model;
mod plot;
pub(crate) mod samples;
mod sources;
mod unused;

use std::{
    fs,
    io::Write as _,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, anyhow};
use model::{Chapter, Effort, Facts, Report};

use crate::timing::time_all;

/// The argument that selects a report.
pub(crate) const REPORT: &str = "report";

/// Measures a chapter.
type Measure = fn(Effort) -> Result<Chapter>;

/// All chapters, in the order of the page.
const CHAPTERS: [(&str, Measure); 4] = [
    ("boxes", boxes::chapter),
    ("kernels", kernels::chapter),
    ("sources", sources::chapter),
    ("unused", unused::chapter),
];

/// Measures the requested chapters and writes the files.
pub(crate) fn run(args: impl Iterator<Item = String>) -> Result<()> {
    let request = Request::read(args, &CHAPTERS.map(|(name, _)| name))?;
    let (chapters, seconds) = time_all(|| measured(&request));
    let chapters = chapters?;
    let report = Report { is_complete: chapters.len() == CHAPTERS.len(), facts: request.facts, chapters, seconds };
    writeln!(std::io::stderr(), "{}: {}", report.kind(), report.took())?;
    for (number, plot) in report.chapters.iter().flat_map(|chapter| &chapter.plots).enumerate() {
        write(&request.out, &model::plot_file(number), &plot::svg(plot))?;
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

/// The options of the command line.
#[derive(Debug)]
pub(crate) struct Request {
    pub(crate) effort: Effort,
    /// Output folder.
    pub(crate) out: PathBuf,
    pub(crate) facts: Facts,
    chapters: Vec<String>,
}

impl Request {
    /// Reads the arguments after `report`; `known` are the chapters.
    pub(crate) fn read(mut args: impl Iterator<Item = String>, known: &[&str]) -> Result<Self> {
        let out = PathBuf::from("target/report");
        let mut request = Self { effort: Effort::Full, out, facts: Facts::default(), chapters: vec![] };
        while let Some(arg) = args.next() {
            let mut value = || args.next().ok_or_else(|| anyhow!("{arg} needs a value"));
            match arg.as_str() {
                "--tiny" => request.effort = Effort::Tiny,
                "--quick" => request.effort = Effort::Quick,
                "--out" => request.out = value()?.into(),
                "--machine" => request.facts.machine = value()?,
                "--compiler" => request.facts.compiler = value()?,
                "--commit" => request.facts.commit = value()?,
                "--date" => request.facts.date = value()?,
                "--command" => request.facts.command = value()?,
                chapter if known.contains(&chapter) => request.chapters.push(arg),
                _ => {
                    let known = known.join(", ");
                    return Err(anyhow!("unknown argument '{arg}'; use the chapters {known}, --quick or --out FOLDER"));
                }
            }
        }
        request.facts.is_quick = request.effort != Effort::Full;
        Ok(request)
    }

    /// Whether a chapter is measured: all are if none is named.
    pub(crate) fn wants(&self, chapter: &str) -> bool {
        self.chapters.is_empty() || self.chapters.iter().any(|wanted| wanted == chapter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(args: &str) -> Result<Request> {
        Request::read(args.split_whitespace().map(str::to_owned), &["boxes", "kernels"])
    }

    #[test]
    fn options_are_read() {
        let request = read("--quick kernels --out there --commit abc").unwrap();
        assert_eq!(
            (request.effort, request.out.to_str(), &request.facts.commit[..]),
            (Effort::Quick, Some("there"), "abc")
        );
        assert!(request.wants("kernels") && !request.wants("boxes") && request.facts.is_quick);
        assert!(read("").unwrap().wants("boxes"));
    }

    #[test]
    fn a_wrong_argument_is_named() {
        for (args, word) in [("wild", "wild"), ("--out", "--out")] {
            assert!(read(args).unwrap_err().to_string().contains(word));
        }
    }
}
