//! The content of the report files.

use std::process::Command;

use serde_json::Value;

use super::MADE;

/// The entries of an array in a JSON object.
fn entries<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().unwrap()
}

fn n_points(plot: &Value) -> usize {
    entries(plot, "series").iter().map(|series| entries(series, "points").len()).sum()
}

/// The known chapters, from the error message about an unknown one.
fn known_chapters() -> Vec<String> {
    let output = Command::new(env!("CARGO_BIN_EXE_canted-bench")).args(["report", "nothing"]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let list = text.split_once("use the chapters ").and_then(|(_, rest)| rest.split_once(", --quick"));
    list.unwrap_or_else(|| panic!("{text}")).0.split(", ").map(str::to_owned).collect()
}

#[test]
fn every_known_chapter_is_present() {
    let known = known_chapters();
    // All chapters of the report, including the extremes.
    assert_eq!(known.len(), 9, "{known:?}");
    let found: Vec<&str> = MADE.chapters().iter().map(|chapter| chapter["id"].as_str().unwrap()).collect();
    assert_eq!(found, known);
}

#[test]
fn no_chapter_is_empty() {
    for chapter in MADE.chapters() {
        let title = chapter["title"].as_str().unwrap();
        assert!(chapter["says"].as_str().unwrap().ends_with('.'), "{title} has no main finding: {}", chapter["says"]);
        let says = chapter["says"].as_str().unwrap();
        assert!(!says.contains(". "), "{title} opens with more than one sentence: {says}");
        for part in ["plots", "tables", "method"] {
            assert!(!entries(chapter, part).is_empty(), "{title} has no {part}");
        }
        for plot in entries(chapter, "plots") {
            assert!(n_points(plot) > 0, "{title}: '{}' has no point", plot["title"]);
        }
        for table in entries(chapter, "tables") {
            let n_columns = entries(table, "head").len();
            assert!(!entries(table, "rows").is_empty(), "{title}: '{}' has no row", table["title"]);
            for row in entries(table, "rows") {
                assert_eq!(row.as_array().unwrap().len(), n_columns, "{title}: '{}': {row}", table["title"]);
            }
        }
    }
}

#[test]
fn every_measured_point_has_its_samples() {
    for chapter in MADE.chapters() {
        for series in entries(chapter, "plots").iter().flat_map(|plot| entries(plot, "series")) {
            for point in entries(series, "points") {
                for axis in ["x", "y"] {
                    let samples = entries(point, axis);
                    assert!(!samples.is_empty() && samples.iter().all(Value::is_f64), "{}: {point}", series["name"]);
                }
            }
        }
    }
}

#[test]
fn every_plot_is_drawn_for_wide_and_narrow_screens_with_its_points() {
    let html = &MADE.html;
    let mut figures = html.split("<figure ").skip(1);
    for plot in MADE.chapters().iter().flat_map(|chapter| entries(chapter, "plots")) {
        let figure = figures.next().unwrap().split("</figure>").next().unwrap();
        let [n, n_hidden]: [usize; 2] = ["data-points", "data-hidden"].map(|name| {
            let value = figure.split(&format!("{name}=\"")).nth(1).unwrap();
            value.split('"').next().unwrap().parse().unwrap()
        });
        assert_eq!(n + n_hidden, n_points(plot), "{}", plot["title"]);
        let drawings: Vec<&str> = figure.split("<svg").skip(1).collect();
        assert_eq!(drawings.len(), 2, "{}", plot["title"]);
        for drawing in drawings {
            assert_eq!(drawing.matches("<circle").count(), n, "{}", plot["title"]);
            assert_eq!(drawing.matches("</title></circle>").count(), n, "{}", plot["title"]);
        }
    }
    assert!(figures.next().is_none());
}

#[test]
fn the_page_is_self_contained() {
    for word in ["<script", "<link", "<img", "src=", "url(", "@import"] {
        assert!(!MADE.html.contains(word), "{word}");
    }
    // XML namespaces are addresses too, but nothing is fetched from them.
    let addresses = MADE.html.matches("http").count();
    assert_eq!(addresses, MADE.html.matches("xmlns=\"http://www.w3.org/2000/svg\"").count());
    assert!(MADE.html.contains("&lt;machine&gt;") && !MADE.html.contains("<machine>"), "text is escaped");
}

#[test]
fn the_text_has_every_chapter_and_table() {
    for chapter in MADE.chapters() {
        assert!(MADE.markdown.contains(&format!("## Report: {}\n", chapter["title"].as_str().unwrap())));
        for table in entries(chapter, "tables") {
            assert!(MADE.markdown.contains(&format!("### {}\n", table["title"].as_str().unwrap())));
        }
    }
}

#[test]
fn every_chapter_reports_its_time() {
    for chapter in MADE.chapters() {
        let [wall, cpu] = ["wall", "cpu"].map(|clock| chapter["seconds"][clock].as_f64().unwrap());
        assert!(wall > 0.0 && cpu > 0.0, "{}: {wall} {cpu}", chapter["title"]);
        let text = format!("Measured in {wall:.1} s ({cpu:.1} processor seconds).");
        assert!(MADE.markdown.contains(&text) && MADE.html.contains(&text), "{}: {text}", chapter["title"]);
    }
}

#[test]
fn the_report_states_its_total_time() {
    let of = |value: &Value| ["wall", "cpu"].map(|clock| value["seconds"][clock].as_f64().unwrap());
    let sum = MADE.chapters().iter().map(of).fold([0.0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
    let [wall, cpu] = of(&MADE.json);
    // The total is the sum of the chapters with little overhead.
    assert!(wall >= sum[0] && cpu >= sum[1] && wall < sum[0] + 1.0, "{wall} {cpu} {sum:?}");
    let text = format!("easured in {wall:.1} s ({cpu:.1} processor seconds)");
    assert!(MADE.html.contains(&format!("This is a quick run, m{text}: ")), "{text}");
    assert!(MADE.markdown.contains(&format!("## Report: Duration of a quick run\n\n**M{text}.**\n")), "{text}");
}

#[test]
fn pictures_report_the_error_of_their_reference() {
    let pictures = &MADE.chapters()[0];
    let table = entries(pictures, "tables")
        .iter()
        .find(|table| table["title"] == "built-in, 24 x 14: error over time")
        .unwrap();
    let column = entries(table, "head").iter().position(|word| word == "reference's share").unwrap();
    for row in entries(table, "rows") {
        assert!(row[column].as_str().unwrap().ends_with('%'), "{row}");
    }
}
