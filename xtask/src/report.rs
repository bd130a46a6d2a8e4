//! `cargo xtask report`: measures every chapter and writes the page; `--keep` takes it into the repository.

use std::{env, fs, path::Path};

use anyhow::{Context, Result};

use crate::{
    bench::{self, PEERS},
    claims,
    command::{self, say},
    workspace,
};

/// Folder of the page, from the root of the workspace.
const FOLDER: &str = "target/report";

/// The word among the arguments that keeps what was measured: sections in the results, and values that documents quote.
const KEEP: &str = "--keep";

/// Runs the benches' program for a report with `args`.
pub(crate) fn run(args: &[&str]) -> Result<bool> {
    let machine = bench::machine();
    let compiler = command::output("rustc", &["--version"])?;
    // Asked before the measuring, which may take an hour in which files change.
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
        claims::keep(&read(&folder.join("report.json"))?)?;
    }
    say(&format!("wrote {}", folder.join("index.html").display()));
    Ok(true)
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}
