//! The page: one file of HTML with everything in it, for wide screens and phones, light and dark.

mod axis;
mod svg;

use std::fmt::Write as _;

use anyhow::Result;

use super::model::{Chapter, Plot, Report, Table};

/// Every rule of the page. Plots are drawn in placeholder colours, which rules here replace.
const STYLE: &str = include_str!("style.css");

/// The whole page.
pub(super) fn page(report: &Report) -> Result<String> {
    let facts = &report.facts;
    let mut out = String::from("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    let _ = write!(
        out,
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>canted: what each choice costs and \
         buys</title>\n<style>\n{STYLE}{}</style>\n</head>\n<body>\n<header>\n<h1>canted: what each choice costs and \
         buys</h1>\n",
        placeholders()
    );
    let kind = if facts.is_quick { "Quick run" } else { "Full run" };
    let _ = writeln!(
        out,
        "<p>{kind}: {}; {}; commit {}; {}; <code>{}</code>. Points are medians; bars reach from the least to the greatest \
         repetition, ± is half that distance. Differences within it are called noise.</p>",
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
    let n_points: usize = plot.series.iter().map(|series| series.points.len()).sum();
    let _ = writeln!(
        out,
        "<figure data-points=\"{n_points}\">\n<figcaption>{}</figcaption>\n<ul class=\"legend\">",
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
    let _ =
        writeln!(out, "<h3>{}</h3>\n<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr>", escaped(&table.title));
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

/// Rules that give the placeholders of plots their colours.
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
