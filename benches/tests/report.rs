//! A minimal report: every chapter measures something, and its files fit together.

use std::{fs, process::Command};

use serde_json::Value;

#[test]
fn every_chapter_has_a_sentence_tables_and_plots() {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_canted-bench"))
        .args(["report", "--tiny", "--machine", "<machine>", "--out"])
        .arg(folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
    let (markdown, json) = (read("report.md"), serde_json::from_str::<Value>(&read("report.json")).unwrap());
    assert_eq!(json["facts"]["machine"], "<machine>");
    let chapters = json["chapters"].as_array().unwrap();
    assert_eq!(chapters.len(), 4);
    for chapter in chapters {
        let (title, says) = (chapter["title"].as_str().unwrap(), chapter["says"].as_str().unwrap());
        assert!(
            markdown.contains(&format!("## Report: {title}\n\n**{says}**")) && says.ends_with('.'),
            "{title}: {says}"
        );
        let (tables, plots) = (chapter["tables"].as_array().unwrap(), chapter["plots"].as_array().unwrap());
        assert!(!tables.is_empty() && !plots.is_empty(), "{title}");
        for table in tables {
            let n_columns = table["head"].as_array().unwrap().len();
            let rows = table["rows"].as_array().unwrap();
            assert!(rows.iter().all(|row| row.as_array().unwrap().len() == n_columns), "{title}: {table}");
        }
    }
    // A row of the sources each.
    for title in [
        "Box passes by size of mesh",
        "Camera rays by meshes per triangle",
        "Holes and speckle of the dissertation's six pictures",
        "A BIH from boxes alone, and builds from primitives",
        "Builders in one table",
        "A frame by stage",
        "kd-trees by the bonus of planes that cut off empty space",
        "A falling elastic body by stage of a frame",
    ] {
        let rows = markdown
            .split(&format!("### {title}"))
            .nth(1)
            .map(|after| after.lines().skip(1).take_while(|line| !line.starts_with('#')));
        let n_rows = rows.map_or(0, |lines| lines.filter(|line| line.starts_with("| ")).count());
        assert!(n_rows > 2, "{title}: {n_rows} rows");
    }
    assert!(markdown.contains("Box tests of a traversal by links"));
    let n_plots: usize = chapters.iter().map(|chapter| chapter["plots"].as_array().unwrap().len()).sum();
    let last = read(&format!("plots/{:02}.svg", n_plots - 1));
    assert!(last.contains("<circle") && last.ends_with("</svg>\n"), "{last}");
}
