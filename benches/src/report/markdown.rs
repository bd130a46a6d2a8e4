//! The report without its plots, as sections for `benches/RESULTS.md`.

use std::fmt::Write as _;

use super::model::{Cell, Chapter, Report, Table};
use crate::clock::Seconds;

/// All chapters, then their times.
pub(super) fn markdown(report: &Report) -> String {
    report.chapters.iter().map(section).chain([times(report)]).collect()
}

/// The time of each chapter and the total; runs of another kind keep their own section.
fn times(report: &Report) -> String {
    let mut table = Table::new("Seconds by chapter", &["chapter", "seconds", "processor seconds"]);
    let all = report.chapters.iter().map(|chapter| (chapter.id, chapter.seconds)).chain([("all", report.seconds)]);
    for (name, Seconds { wall, cpu }) in all {
        table.rows.push([name.to_owned(), format!("{wall:.1}"), format!("{cpu:.1}")].map(Cell::text).to_vec());
    }
    let mut out = format!("## Report: Duration of {}\n\n**Measured in {}.**\n\n", report.kind(), report.took());
    rows(&mut out, &table);
    out
}

fn section(chapter: &Chapter) -> String {
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
        rows(&mut out, table);
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

fn rows(out: &mut String, table: &Table) {
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
