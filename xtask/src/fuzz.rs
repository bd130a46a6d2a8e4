//! `cargo xtask fuzz`: changed files through every reader, and the table that is kept of the last run.

use std::{fs, process::Stdio, thread};

use anyhow::{Context, Result};

use crate::{
    bench::{facts_of, processor},
    command::{self, cargo, say},
    workspace,
};

const PREAMBLE: &str = "# Changed files

Written by `cargo xtask fuzz [--minutes N] [--seed N]`; change nothing by hand. Real and malformed files of every format with
bytes, pieces and numbers changed, one to four times each, are read: the answer may be a scene that keeps its promises or an
error, but neither a panic nor half a minute without any.
";

/// Reads, and writes the table; whether nothing was found. The profile is that of tests, which checks for overflow.
pub(crate) fn run(args: &[&str]) -> Result<bool> {
    let facts = facts(args)?;
    let mut command = cargo(&["run", "--package", "canted-scene", "--example", "fuzz", "--"]);
    let output = command.args(args).stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    let table = String::from_utf8(output.stdout).context("the run wrote something that is not text")?;
    anyhow::ensure!(table.starts_with('|'), "the run failed: {}", output.status);
    let path = workspace::root().join("tests/FUZZ.md");
    fs::write(&path, page(&facts, &table)).with_context(|| format!("cannot write {}", path.display()))?;
    say(table.trim_end());
    Ok(output.status.success())
}

fn facts(args: &[&str]) -> Result<String> {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let words: Vec<&str> = ["cargo xtask fuzz"].iter().chain(args).copied().collect();
    Ok(facts_of(&[
        &format!("{}, {threads} threads", processor()),
        &command::output("rustc", &["--version"])?,
        &command::output("git", &["describe", "--always", "--dirty=, with changes"])?,
        &command::output("date", &["-u", "+%F"])?,
        &format!("`{}`", words.join(" ")),
    ]))
}

fn page(facts: &str, table: &str) -> String {
    format!("{PREAMBLE}\n{facts}\n\n{}\n", table.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_says_how_and_what() {
        let page = page("*then*", "| a |\n\n");
        assert!(page.starts_with("# Changed files\n") && page.ends_with("\n\n*then*\n\n| a |\n"), "{page}");
        assert!(facts(&["--minutes", "9"]).unwrap().contains("`cargo xtask fuzz --minutes 9`"));
    }
}
