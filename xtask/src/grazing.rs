//! `cargo xtask grazing`: millions of grazing rays at wide trees, and the table that is kept of the last run.

use std::{fs, process::Stdio, thread};

use anyhow::{Context, Result};

use crate::{
    bench::{facts_of, processor},
    command::{self, cargo, say},
    workspace,
};

const PREAMBLE: &str = "# Grazing rays

Written by `cargo xtask grazing [--rays N]`; change nothing by hand. Rays through vertices and edges, within 10⁻³ rad of
face planes, along axes, from inside, from 100, 1,000 and 10,000 sizes away, each traced through the trees of all three
presets: `t`, `u`, `v` and primitive, and occlusion, beside what judges them.
";

/// Shoots, and writes the table; whether no answer differed.
pub(crate) fn run(args: &[&str]) -> Result<bool> {
    let facts = facts(args)?;
    let mut command = cargo(&["run", "--release", "--package", "canted-tests", "--example", "grazing", "--"]);
    let output = command.args(args).stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    let table = String::from_utf8(output.stdout).context("the run wrote something that is not text")?;
    anyhow::ensure!(output.status.code() == Some(0) || table.starts_with('|'), "the run failed: {}", output.status);
    let path = workspace::root().join("tests/GRAZING.md");
    fs::write(&path, page(&facts, &table)).with_context(|| format!("cannot write {}", path.display()))?;
    say(table.trim_end());
    Ok(output.status.success())
}

fn facts(args: &[&str]) -> Result<String> {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let words: Vec<&str> = ["cargo xtask grazing"].iter().chain(args).copied().collect();
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
        assert!(page.starts_with("# Grazing rays\n") && page.ends_with("\n\n*then*\n\n| a |\n"), "{page}");
        assert!(facts(&["--rays", "9"]).unwrap().contains("`cargo xtask grazing --rays 9`"));
    }
}
