//! `cargo xtask report`: measures every chapter and writes the page; `--keep` records the results in the repository.

use std::{env, fs, path::Path};

use anyhow::{Context, Result};
use serde_json::{Value, json};

use crate::{
    bench::{self, PEERS},
    command::{self, say},
    workspace,
};

/// Folder of the page, from the root of the workspace.
const FOLDER: &str = "target/report";

/// The recorded values of the last kept report, from the root of the workspace.
const RECORDED: &str = "benches/report.json";

/// Key of the time that measuring all chapters took.
const ALL_CHAPTERS: &str = "all chapters";

/// The argument that records the results in the repository.
const KEEP: &str = "--keep";

/// Runs the benchmark program for a report with `args`.
pub(crate) fn run(args: &[&str]) -> Result<bool> {
    let machine = bench::machine();
    let compiler = command::output("rustc", &["--version"])?;
    // Read before measuring, which may take an hour in which files change.
    let commit = command::output("git", &["describe", "--always", "--dirty=, with changes"])?;
    let date = command::output("date", &["-u", "+%F"])?;
    let words = bench::words("report", args, |name| env::var(name).ok());
    let mut command = bench::program(args);
    command.args(["report", "--out", FOLDER]);
    for (name, value) in
        [("machine", &machine), ("compiler", &compiler), ("commit", &commit), ("date", &date), ("command", &words)]
    {
        command.arg(format!("--{name}")).arg(value.trim());
    }
    command.args(args.iter().filter(|&&arg| arg != PEERS && arg != KEEP));
    if !command::succeeds(&mut command)? {
        return Ok(false);
    }
    let folder = workspace::root().join(FOLDER);
    if args.contains(&KEEP) {
        let facts = bench::facts_of(&[&machine, &compiler, &commit, &date, &format!("`{words}`")]);
        bench::merge(&read(&folder.join("report.md"))?, &facts)?;
        record(&read(&folder.join("report.json"))?)?;
    }
    say(&format!("wrote {}", folder.join("index.html").display()));
    Ok(true)
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

/// Records the claims of a report, with where, when and how it was made.
fn record(report: &str) -> Result<()> {
    let report: Value = serde_json::from_str(report).context("the report is not JSON")?;
    let path = workspace::root().join(RECORDED);
    let before = fs::read_to_string(&path).ok().and_then(|text| serde_json::from_str(&text).ok());
    let after = recorded(before.unwrap_or_else(|| json!({})), &report);
    fs::write(&path, format!("{after:#}\n")).with_context(|| format!("cannot write {}", path.display()))
}

/// The earlier record, with the chapters of a report replaced.
fn recorded(mut before: Value, report: &Value) -> Value {
    let facts = &report["facts"];
    for chapter in report["chapters"].as_array().into_iter().flatten() {
        if let Some(id) = chapter["id"].as_str() {
            let [says, claims, seconds] = ["says", "claims", "seconds"].map(|key| &chapter[key]);
            before[id] = json!({ "facts": facts, "says": says, "claims": claims, "seconds": seconds });
        }
    }
    if report["is_whole"] == true {
        before[ALL_CHAPTERS] = json!({ "facts": facts, "seconds": report["seconds"] });
    }
    before
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_of_one_chapter_keeps_the_others() {
        let before = json!({ "a": 1, "b": 2 });
        let chapter =
            json!({ "id": "b", "says": "It is.", "claims": { "x": "1" }, "seconds": { "wall": 3.0 }, "plots": [] });
        let mut report =
            json!({ "facts": { "date": "now" }, "chapters": [chapter], "seconds": { "wall": 4.0 }, "is_whole": false });
        let part = recorded(before, &report);
        assert_eq!((&part["a"], &part["b"]["claims"]["x"]), (&json!(1), &json!("1")));
        assert_eq!(part["b"]["seconds"]["wall"], json!(3.0));
        assert_eq!((&part[ALL_CHAPTERS], &part["b"]["plots"]), (&Value::Null, &Value::Null));
        report["is_whole"] = json!(true);
        assert_eq!(recorded(part, &report)[ALL_CHAPTERS]["seconds"]["wall"], json!(4.0));
    }
}
