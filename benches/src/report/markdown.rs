//! The report without its plots, as sections for `benches/RESULTS.md`.

use std::fmt::Write as _;

use super::model::{Chapter, Report, Table};

/// All chapters.
pub(super) fn markdown(report: &Report) -> String {
    report.chapters.iter().map(section).collect()
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
    let _ = writeln!(out, "### {}\n\n| {} |", table.title, table.head.join(" | "));
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
    use crate::clock::Seconds;
    use crate::report::model::{Cell, Facts};

    #[test]
    fn tables_are_markdown() {
        let mut table = Table::new("T", &["a", "b"]);
        table.rows.push(vec![Cell::text("x|y"), Cell::measured(vec![1.0, 1.0], "ms")]);
        let mut chapter = Chapter {
            title: "C",
            tables: vec![table],
            skipped: vec!["z".to_owned()],
            seconds: Seconds { wall: 61.24, cpu: 120.0 },
            ..Chapter::default()
        };
        chapter.tell(["", "It shows.", "", "And more."].map(str::to_owned));
        let text = markdown(&Report { facts: Facts::default(), chapters: vec![chapter] });
        assert!(
            text.starts_with("## Report: C\n\n**It shows.**\n\n* And more.\n\n### T\n\n| a | b |\n| --- | --- |\n"),
            "{text}"
        );
        let end = "| x\\|y | 1.00 ±0% ms |\n\n* Not measured: z\n\nMeasured in 61.2 s, of all processors 120.0 s.\n\n";
        assert!(text.ends_with(end), "{text}");
    }
}
