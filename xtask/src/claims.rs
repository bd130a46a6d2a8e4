//! Figures in documents, each marked with where it was measured.
//!
//! ```text
//! <!-- measured: SECTION | ROW, ROW | COLUMN -->7.7 / 5.4<!-- / -->    a table of benches/RESULTS.md
//! <!-- measured: report | KEY -->3.21<!-- / -->                        a claim of benches/report.json
//! ```
//!
//! A row's numbers stand as the table's, joined by ` / ` and rounded as one likes; `A to B` are the least and the greatest of all.

mod typed;

use std::{collections::BTreeMap, fs};

use anyhow::{Context, Result};
use serde_json::{Value, json};

use crate::{bench::RESULTS, workspace};
pub(crate) use typed::typed_by_hand;

/// The claims of the last report that was kept, from the root of the workspace.
const CLAIMS: &str = "benches/report.json";

/// What measuring all chapters took stands beside them under this name.
const WHOLE: &str = "all chapters";

const OPEN: &str = "<!-- measured: ";
const CLOSE: &str = "<!-- / -->";

/// What was measured, for documents to be compared with.
pub(crate) struct Measured {
    results: String,
    claims: BTreeMap<String, String>,
}

/// Keeps the claims of a report, with where, when and how it was made.
pub(crate) fn keep(report: &str) -> Result<()> {
    let report: Value = serde_json::from_str(report).context("the report is not JSON")?;
    let before = fs::read_to_string(workspace::root().join(CLAIMS))
        .ok()
        .and_then(|text| serde_json::from_str::<Value>(&text).ok())
        .unwrap_or_else(|| json!({}));
    let path = workspace::root().join(CLAIMS);
    fs::write(&path, format!("{:#}\n", kept(before, &report)))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// What was kept before, with what a report claims and what it took: one of few chapters leaves the others as they were.
fn kept(mut before: Value, report: &Value) -> Value {
    let facts = &report["facts"];
    for chapter in report["chapters"].as_array().into_iter().flatten() {
        if let Some(id) = chapter["id"].as_str() {
            let [says, claims, seconds] = ["says", "claims", "seconds"].map(|key| &chapter[key]);
            before[id] = json!({ "facts": facts, "says": says, "claims": claims, "seconds": seconds });
        }
    }
    if report["is_whole"] == true {
        before[WHOLE] = json!({ "facts": facts, "seconds": report["seconds"] });
    }
    before
}

impl Measured {
    /// Reads results and claims.
    pub(crate) fn read() -> Result<Self> {
        let read = |name: &str| fs::read_to_string(workspace::root().join(name)).unwrap_or_default();
        Self::of(read(RESULTS), &read(CLAIMS))
    }

    fn of(results: String, claims: &str) -> Result<Self> {
        let chapters: Value = match claims {
            "" => json!({}),
            text => serde_json::from_str(text).with_context(|| format!("{CLAIMS} is not JSON"))?,
        };
        let of_chapter = |(id, chapter): (&String, &Value)| -> Vec<(String, String)> {
            let claims = chapter["claims"].as_object().into_iter().flatten();
            claims.map(|(key, value)| (format!("{id}.{key}"), value.as_str().unwrap_or_default().to_owned())).collect()
        };
        Ok(Self { results, claims: chapters.as_object().into_iter().flatten().flat_map(of_chapter).collect() })
    }

    /// What is wrong with the marked figures of a document, with the line of each.
    pub(crate) fn wrong(&self, text: &str) -> Vec<(usize, String)> {
        let mut wrong = vec![];
        let mut at = 0;
        while let Some(found) = text[at..].find(OPEN) {
            let start = at + found;
            // An example in a code span marks nothing.
            if text[..start].ends_with('`') {
                at = start + OPEN.len();
                continue;
            }
            let is_line_start = start == 0 || text[..start].ends_with('\n');
            let line = text[..start].lines().count().max(1) + usize::from(text[..start].ends_with('\n'));
            let rest = &text[start + OPEN.len()..];
            let Some(((key, stated), after)) =
                rest.split_once(CLOSE).and_then(|(mark, after)| Some((mark.split_once("-->")?, after)))
            else {
                wrong.push((line, format!("a mark without its end '{CLOSE}'")));
                break;
            };
            at = text.len() - after.len();
            // Markdown ends a paragraph at a line that begins with a comment.
            if is_line_start {
                wrong.push((line, "a mark at the start of a line".to_owned()));
            }
            if let Err(message) = self.check(key.trim(), &plain(stated)) {
                wrong.push((line, message));
            }
        }
        wrong
    }

    fn check(&self, key: &str, stated: &str) -> Result<(), String> {
        let parts: Vec<&str> = key.split('|').map(str::trim).collect();
        match parts[..] {
            ["report", key] => match self.claims.get(key) {
                Some(value) if value == stated => Ok(()),
                Some(value) => Err(format!("{key} is {value} in {CLAIMS}, not {stated}")),
                None => Err(format!("{CLAIMS} has no claim '{key}'")),
            },
            [section, rows, column] => {
                let rows: Vec<&str> = rows.split(',').map(str::trim).collect();
                let measured =
                    rows.iter().map(|row| cell(&self.results, section, row, column)).collect::<Result<Vec<_>, _>>()?;
                if is_said(stated, &measured) {
                    Ok(())
                } else {
                    Err(format!("'{stated}' is not what '{key}' of {RESULTS} says: {measured:?}"))
                }
            }
            _ => Err(format!("'{key}' names neither a cell nor a claim")),
        }
    }
}

/// The numbers of a cell in a table of a section, or of a part of one.
fn cell(results: &str, section: &str, row: &str, column: &str) -> Result<Vec<f64>, String> {
    let titled = |line: &str| line.trim_start_matches('#').trim() == section && line.starts_with("##");
    let mut lines = results.lines().skip_while(|line| !titled(line)).skip(1).take_while(|line| !line.starts_with('#'));
    let head = lines.find(|line| line.starts_with('|')).ok_or_else(|| format!("{RESULTS} has no table '{section}'"))?;
    let place = cells(head).position(|word| word == column);
    let place = place.ok_or_else(|| format!("'{section}' of {RESULTS} has no column '{column}'"))?;
    let found = lines.find(|line| cells(line).next() == Some(row));
    let found = found.ok_or_else(|| format!("'{section}' of {RESULTS} has no row '{row}'"))?;
    let cell = cells(found).nth(place).unwrap_or_default();
    cell.split(" / ").map(|part| number(part).ok_or_else(|| format!("'{part}' of '{row}' is no number"))).collect()
}

fn cells(line: &str) -> impl Iterator<Item = &str> {
    line.trim().trim_matches('|').split('|').map(str::trim)
}

/// The number that a text begins with, emphasis aside.
fn number(text: &str) -> Option<f64> {
    let text = text.trim().trim_start_matches('*');
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.' && c != '-').unwrap_or(text.len());
    text[..end].parse().ok()
}

/// Whether the stated numbers are the measured ones, each rounded to the digits it is stated in.
fn is_said(stated: &str, measured: &[Vec<f64>]) -> bool {
    let all = || measured.iter().flatten().copied();
    let (words, values): (Vec<&str>, Vec<f64>) = match stated.split_once(" to ") {
        Some((low, high)) => (vec![low, high], vec![all().fold(f64::MAX, f64::min), all().fold(f64::MIN, f64::max)]),
        None => (stated.split('/').collect(), all().collect()),
    };
    words.len() == values.len()
        && words.iter().zip(values).all(|(word, value)| {
            let word = word.trim();
            let digits = word.split_once('.').map_or(0, |(_, digits)| digits.len());
            let half = 0.5 * 10f64.powi(-i32::try_from(digits).unwrap_or(i32::MAX));
            // Half-way either rounding will do: the table's own digits are rounded too.
            word.parse().is_ok_and(|stated: f64| (stated - value).abs() <= half * (1.0 + 1e-9))
        })
}

/// Text in one line, without emphasis.
fn plain(text: &str) -> String {
    text.replace('*', "").split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured() -> Measured {
        let results = "# R\n\n## A\n\n### B\n\n| scene | x | y |\n| --- | --- | --- |\n| s | 1 | **7.73** (±2 %) / **5.35** |\n\
                       | t | 2 | **1.04** / 1.26 |\n";
        let claims = r#"{ "pictures": { "claims": { "gain": "3.21" } } }"#;
        Measured::of(results.to_owned(), claims).unwrap()
    }

    #[test]
    fn claims_are_kept_with_what_measuring_took() {
        let before = json!({ "a": 1, "b": 2 });
        let chapter =
            json!({ "id": "b", "says": "It is.", "claims": { "x": "1" }, "seconds": { "wall": 3.0 }, "plots": [] });
        let mut report =
            json!({ "facts": { "date": "now" }, "chapters": [chapter], "seconds": { "wall": 4.0 }, "is_whole": false });
        let part = kept(before, &report);
        assert_eq!(
            (&part["a"], &part["b"]["seconds"]["wall"], &part["b"]["claims"]["x"]),
            (&json!(1), &json!(3.0), &json!("1"))
        );
        assert_eq!((&part[WHOLE], &part["b"]["plots"]), (&Value::Null, &Value::Null));
        report["is_whole"] = json!(true);
        assert_eq!(kept(part, &report)[WHOLE], json!({ "facts": { "date": "now" }, "seconds": { "wall": 4.0 } }));
    }

    #[test]
    fn marked_figures_are_those_that_were_measured() {
        for right in [
            "x <!-- measured: B | s | y -->7.7 /\n**5.35**<!-- / -->",
            "x <!-- measured: B | s, t | y -->1.0 to 7.7<!-- / -->",
            "x <!-- measured: report | pictures.gain -->3.21<!-- / -->",
            "as `<!-- measured: SECTION | ROW | COLUMN -->7.7<!-- / -->` is",
        ] {
            assert_eq!(measured().wrong(right), [], "{right}");
        }
    }

    #[test]
    fn figures_that_drifted_are_seen() {
        for (wrong, part) in [
            ("<!-- measured: B | s | y -->7.8 / 5.4<!-- / -->", "7.73"),
            ("<!-- measured: B | s | y -->7.7<!-- / -->", "7.73"),
            ("<!-- measured: B | u | y -->1<!-- / -->", "row 'u'"),
            ("<!-- measured: B | s | z -->1<!-- / -->", "column 'z'"),
            ("<!-- measured: C | s | y -->1<!-- / -->", "table 'C'"),
            ("<!-- measured: report | gain -->3.21<!-- / -->", "no claim 'gain'"),
            ("<!-- measured: report | pictures.gain -->3.2<!-- / -->", "not 3.2"),
            ("<!-- measured: B | s | y -->1", "without its end"),
            ("<!-- measured: B -->1<!-- / -->", "neither"),
        ] {
            let found = measured().wrong(&format!("one\nx {wrong}"));
            assert!(found.len() == 1 && found[0].0 == 2 && found[0].1.contains(part), "{wrong}: {found:?}");
        }
    }

    #[test]
    fn a_mark_does_not_break_its_paragraph() {
        let found = measured().wrong("x\n<!-- measured: B | s, t | x -->1 to 2<!-- / -->");
        assert_eq!(found, [(2, "a mark at the start of a line".to_owned())]);
    }
}
