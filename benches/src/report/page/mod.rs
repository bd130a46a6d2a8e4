//! The page: one self-contained HTML file, for wide screens and phones, light and dark.

mod axis;
mod svg;
mod text;

use std::fmt::Write as _;

use anyhow::Result;

use super::model::{Chapter, Plot, Report, Table};

/// The style sheet. Plots use placeholder colors, which its rules replace.
const STYLE: &str = include_str!("style.css");

/// Renders the page.
pub(super) fn page(report: &Report) -> Result<String> {
    let facts = &report.facts;
    let mut out = String::from("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    let _ = write!(
        out,
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>canted: measured \
         trade-offs</title>\n<style>\n{STYLE}{}</style>\n</head>\n<body>\n<header>\n<h1>canted: measured trade-offs</h1>\n",
        placeholders()
    );
    let _ = writeln!(
        out,
        "<p>This is {}, measured in {}: {}; {}; commit {}; {}; <code>{}</code>. Points are medians; bars reach from the minimum to \
         the maximum repetition, ± is half that distance, or the standard error after an exponent. Compared items run in turn: a \
         difference is called noise if the interval of the median ratio of five or more rounds (by order statistics, with at least \
         93 % confidence) contains 1, or, with fewer or unequal rounds, if the ranges of both overlap.</p>",
        report.kind(),
        report.took(),
        escaped(&facts.machine),
        escaped(&facts.compiler),
        escaped(&facts.commit),
        escaped(&facts.date),
        escaped(&facts.command)
    );
    out.push_str("<nav><ol>\n");
    for chapter in &report.chapters {
        let _ = writeln!(out, "<li><a href=\"#{}\">{}</a></li>", chapter.id, escaped(chapter.title));
    }
    out.push_str("</ol></nav>\n</header>\n<main>\n");
    for chapter in &report.chapters {
        section(&mut out, chapter)?;
    }
    out.push_str("</main>\n</body>\n</html>\n");
    Ok(out)
}

fn section(out: &mut String, chapter: &Chapter) -> Result<()> {
    let _ = writeln!(out, "<section id=\"{}\">\n<h2>{}</h2>", chapter.id, escaped(chapter.title));
    let _ = writeln!(out, "<p class=\"says\">{}</p>", escaped(&chapter.says));
    list(out, "findings", &chapter.findings);
    for plot in &chapter.plots {
        figure(out, plot)?;
    }
    for table in &chapter.tables {
        rows(out, table);
    }
    for paragraph in &chapter.method {
        let _ = writeln!(out, "<p class=\"method\">{}</p>", escaped(paragraph));
    }
    if !chapter.skipped.is_empty() {
        out.push_str("<p class=\"method\">Not measured:</p>\n");
        list(out, "method", &chapter.skipped);
    }
    let _ = writeln!(out, "<p class=\"method\">Measured in {}.</p>", chapter.took());
    out.push_str("</section>\n");
    Ok(())
}

fn list(out: &mut String, class: &str, items: &[String]) {
    if items.is_empty() {
        return;
    }
    let _ = writeln!(out, "<ul class=\"{class}\">");
    for item in items {
        let _ = writeln!(out, "<li>{}</li>", escaped(item));
    }
    out.push_str("</ul>\n");
}

fn figure(out: &mut String, plot: &Plot) -> Result<()> {
    let all = || plot.series.iter().flat_map(|series| &series.points);
    let n_points = all().filter(|point| svg::is_shown(plot, point)).count();
    let n_hidden = all().count() - n_points;
    let hidden = match n_hidden {
        0 => String::new(),
        n => format!(" ({n} outside these axes not shown)"),
    };
    let _ = writeln!(
        out,
        "<figure data-points=\"{n_points}\" data-hidden=\"{n_hidden}\">\n<figcaption>{}{hidden}</figcaption>\n<ul \
         class=\"legend\">",
        escaped(&plot.title)
    );
    for (number, series) in plot.series.iter().enumerate() {
        let (color, is_hollow) = svg::mark(number);
        let hollow = if is_hollow { " hollow" } else { "" };
        let _ = writeln!(out, "<li><i class=\"c{color}{hollow}\"></i>{}</li>", escaped(&series.name));
    }
    out.push_str("</ul>\n");
    for (class, size) in svg::SIZES {
        let _ = writeln!(out, "<div class=\"{class}\">{}</div>", svg::svg(plot, size)?);
    }
    out.push_str("</figure>\n");
    Ok(())
}

fn rows(out: &mut String, table: &Table) {
    let _ = writeln!(out, "<h3>{}</h3>", escaped(&table.title));
    if !table.says.is_empty() {
        let _ = writeln!(out, "<p>{}</p>", escaped(&table.says));
    }
    out.push_str("<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr>\n");
    for word in &table.head {
        let _ = write!(out, "<th>{}</th>", escaped(word));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for row in &table.rows {
        out.push_str("<tr>");
        for cell in row {
            let _ = write!(out, "<td>{}</td>", escaped(&cell.show()));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>\n");
}

/// Rules that replace the placeholder colors of plots.
fn placeholders() -> String {
    let mut rules = String::new();
    let mut rule = |placeholder: &str, variable: &str| {
        for property in ["fill", "stroke"] {
            let _ = writeln!(rules, "svg [{property}=\"{placeholder}\"] {{ {property}: var({variable}); }}");
        }
    };
    rule("#010101", "--ink");
    rule("#020202", "--grid");
    for number in 0..svg::N_COLORS {
        rule(&format!("#0303{:02X}", 10 + number), &format!("--c{number}"));
    }
    rules
}

/// Text as HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::model::{Axis, Point, Series};

    #[test]
    fn a_caption_counts_hidden_points() {
        let points = [1.0, 0.0, 2.0].map(|y| Point { label: String::new(), x: 1.0.into(), y: y.into() }).into();
        let series = vec![Series { name: "a".to_owned(), points, is_joined: false }];
        let mut plot = Plot { title: "t".to_owned(), x: Axis::log("x"), y: Axis::log("y"), series };
        let drawn = |plot: &Plot| {
            let mut out = String::new();
            figure(&mut out, plot).unwrap();
            out
        };
        assert!(drawn(&plot).contains("data-points=\"2\"") && drawn(&plot).contains("t (1 outside"));
        plot.y.is_log = false;
        assert!(drawn(&plot).contains("data-points=\"3\"") && drawn(&plot).contains("<figcaption>t</figcaption>"));
    }
}
