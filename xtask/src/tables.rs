//! `cargo xtask tables`: tables in documents whose numbers come from `benches/RESULTS.md` and `benches/PYTHON.md`.
//!
//! ```text
//! <!-- measured
//! scene = truss: steel truss; sponza
//! robust = Compared with peers in robust mode | WideBvh quality
//! -->
//! | scene | robust |
//! | --- | --- |
//! | steel truss | 7.73 / 5.35 / 4.94 |
//! | sponza | 1.25 / 1.32 / 1.05 |
//! <!-- end -->
//! ```
//!
//! The first line names the first column and lists the rows: the row's name in the results, and a label where it differs.
//! Each further line is a column: its heading, then section and column of the results. `cargo xtask tidy` checks that
//! the table below is the one that these lines give.

use std::{fs, path::Path};

use anyhow::{Context, Result, anyhow};

use crate::{bench::RESULTS, command::say, python::RECORD, workspace};

const OPEN: &str = "<!-- measured\n";
const CLOSE: &str = "<!-- end -->";

/// Writes the tables of every document anew.
pub(crate) fn run() -> Result<bool> {
    let results = results()?;
    for path in workspace::files()? {
        let full = workspace::root().join(&path);
        if path.extension().is_none_or(|extension| extension != "md") {
            continue;
        }
        let text = fs::read_to_string(&full).with_context(|| format!("cannot read {}", path.display()))?;
        let written = written(&text, &results).with_context(|| format!("cannot fill {}", path.display()))?;
        if written != text {
            fs::write(&full, written).with_context(|| format!("cannot write {}", path.display()))?;
            say(&format!("wrote {}", path.display()));
        }
    }
    Ok(true)
}

/// What `benches/RESULTS.md` and `benches/PYTHON.md` hold.
pub(crate) fn results() -> Result<String> {
    let read = |name: &str| {
        let path = workspace::root().join(name);
        fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    Ok(read(RESULTS)? + "\n" + &read(RECORD)?)
}

/// What is wrong with the tables of a document, if anything.
pub(crate) fn flaw(path: &Path, text: &str, results: &str) -> Option<String> {
    match written(text, results) {
        Ok(written) if written == text => None,
        Ok(_) => Some(format!("a table of {} is not what {RESULTS} says; run `cargo xtask tables`", path.display())),
        Err(error) => Some(format!("{error:#}")),
    }
}

/// The document with its tables filled from `results`.
fn written(text: &str, results: &str) -> Result<String> {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    // An example inside of a code block is indented or quoted: a table starts at the start of a line.
    while let Some((before, after)) = split_at_line(rest, OPEN) {
        let (spec, after) = after.split_once("-->\n").ok_or_else(|| anyhow!("'{}' has no '-->'", OPEN.trim_end()))?;
        let (_, after) = after.split_once(CLOSE).ok_or_else(|| anyhow!("a measured table has no '{CLOSE}'"))?;
        out += &format!("{before}{OPEN}{spec}-->\n{}{CLOSE}", table(spec, results)?);
        rest = after;
    }
    Ok(out + rest)
}

/// Splits around the first `mark` that starts a line.
fn split_at_line<'a>(text: &'a str, mark: &str) -> Option<(&'a str, &'a str)> {
    let starts_line = |&(at, _): &(usize, &str)| at == 0 || text[..at].ends_with('\n');
    let (at, _) = text.match_indices(mark).find(starts_line)?;
    Some((&text[..at], &text[at + mark.len()..]))
}

/// The table that a specification asks for.
fn table(spec: &str, results: &str) -> Result<String> {
    let lines = spec.lines().filter_map(|line| line.split_once(" = "));
    let lines: Vec<(&str, &str)> = lines.map(|(head, value)| (head.trim(), value.trim())).collect();
    let [(first, rows), columns @ ..] = &lines[..] else { anyhow::bail!("a measured table names no rows") };
    let heads = columns.iter().map(|(head, _)| format!(" {head} |")).collect::<String>();
    let mut out = format!("| {first} |{heads}\n|{}\n", " --- |".repeat(lines.len()));
    for row in rows.split(';').map(str::trim) {
        let (name, label) = row.split_once(": ").unwrap_or((row, row));
        out += &format!("| {label} |");
        for (head, source) in columns {
            let (section, column) =
                source.split_once(" | ").ok_or_else(|| anyhow!("column '{head}' is not 'SECTION | COLUMN'"))?;
            out += &format!(" {} |", cell(results, section.trim(), name, column.trim())?);
        }
        out.push('\n');
    }
    Ok(out)
}

/// The numbers of a cell in a table of a section, without spreads and emphasis.
fn cell(results: &str, section: &str, row: &str, column: &str) -> Result<String> {
    let is_title = |line: &str| line.starts_with("##") && line.trim_start_matches('#').trim() == section;
    let mut lines =
        results.lines().skip_while(|line| !is_title(line)).skip(1).take_while(|line| !line.starts_with('#'));
    let head = lines.find(|line| line.starts_with('|')).ok_or_else(|| anyhow!("{RESULTS} has no table '{section}'"))?;
    let index = cells(head).position(|word| word == column);
    let index = index.ok_or_else(|| anyhow!("'{section}' of {RESULTS} has no column '{column}'"))?;
    let found = lines.find(|line| cells(line).next() == Some(row));
    let found = found.ok_or_else(|| anyhow!("'{section}' of {RESULTS} has no row '{row}'"))?;
    let numbers: Vec<&str> = cells(found).nth(index).unwrap_or_default().split(" / ").map(number).collect();
    anyhow::ensure!(numbers.iter().all(|n| !n.is_empty()), "'{row}' in column '{column}' of '{section}' has no number");
    Ok(numbers.join(" / "))
}

fn cells(line: &str) -> impl Iterator<Item = &str> {
    line.trim().trim_matches('|').split('|').map(str::trim)
}

/// The number that a text begins with, emphasis aside.
fn number(text: &str) -> &str {
    let text = text.trim().trim_start_matches('*');
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.' && c != '-').unwrap_or(text.len());
    &text[..end]
}

/// A document without its measured tables.
pub(crate) fn without_tables(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, after)) = split_at_line(rest, OPEN) {
        let (table, after) = after.split_once(CLOSE).unwrap_or((after, ""));
        // Lines keep their numbers.
        out += before;
        out += &"\n".repeat(1 + table.matches('\n').count());
        rest = after;
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    const RESULTS: &str = "# R\n\n## A\n\n### B\n\n| scene | x | y |\n| --- | --- | --- |\n| s | 1 | **7.73** (±2 %) / **5.35** |\n\
                           | t | 2 | **1.04** / 1.26 |\n";
    const SPEC: &str = "<!-- measured\nscene = s: the first; t\ny of B = B | y\n-->\n";
    const TABLE: &str = "| scene | y of B |\n| --- | --- |\n| the first | 7.73 / 5.35 |\n| t | 1.04 / 1.26 |\n";

    #[test]
    fn tables_are_filled_once() {
        let want = format!("before\n{SPEC}{TABLE}<!-- end -->\nafter\n");
        assert_eq!(written(&format!("before\n{SPEC}<!-- end -->\nafter\n"), RESULTS).unwrap(), want);
        assert_eq!(written(&want, RESULTS).unwrap(), want);
        assert_eq!(flaw(Path::new("a.md"), &want, RESULTS), None);
        assert_eq!(
            without_tables(&want).lines().filter(|line| !line.is_empty()).collect::<Vec<_>>(),
            ["before", "after"]
        );
        assert_eq!(without_tables(&want).lines().count(), want.lines().count());
    }

    #[test]
    fn outdated_and_impossible_tables_are_reported() {
        for (spec, part) in [
            (format!("{SPEC}{}<!-- end -->", TABLE.replace("7.73", "7.74")), "run `cargo xtask tables`"),
            (SPEC.replace("B | y", "C | y") + "<!-- end -->", "no table 'C'"),
            (SPEC.replace("B | y", "B | z") + "<!-- end -->", "no column 'z'"),
            (SPEC.replace("; t", "; u") + "<!-- end -->", "no row 'u'"),
            (SPEC.replace("B | y", "B") + "<!-- end -->", "SECTION | COLUMN"),
            (SPEC.to_owned(), "no '<!-- end -->'"),
        ] {
            let found = flaw(Path::new("a.md"), &spec, RESULTS).unwrap();
            assert!(found.contains(part), "{spec}: {found}");
        }
    }

    #[test]
    fn an_example_that_does_not_start_a_line_is_text() {
        let text = format!("//! {SPEC}");
        assert_eq!(written(&text, RESULTS).unwrap(), text);
    }
}
