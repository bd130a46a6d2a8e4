//! The table of extreme inputs, ours compared with the peers: `cargo xtask extremes`.

use std::io::Write as _;

use anyhow::{Result, anyhow, ensure};
use canted_tests::{extremes, tracers};

use crate::wide;

/// The argument that selects it.
pub(crate) const EXTREMES: &str = "extremes";

/// Prints the table; an error if one of our promises is broken.
pub(crate) fn run(mut args: impl Iterator<Item = String>) -> Result<()> {
    let mut effort = 1;
    while let Some(arg) = args.next() {
        ensure!(arg == "--effort", "unexpected '{arg}'; use --effort N");
        let value = args.next().ok_or_else(|| anyhow!("--effort needs a value"))?;
        let number = value.parse().ok().filter(|&effort| effort > 0);
        effort = number.ok_or_else(|| anyhow!("--effort '{value}' is not a positive number"))?;
    }
    let (mut methods, missing) = tracers::ours();
    methods.extend(wide::peers());
    let rows = extremes::rows(effort, &methods);
    let mut out = std::io::stdout();
    writeln!(out, "{}\n\nNot tried:\n", extremes::table(&rows))?;
    for what in extremes::not_tried(&missing) {
        writeln!(out, "* {what}.")?;
    }
    for peer in wide::skipped_peers() {
        writeln!(out, "* {peer}.")?;
    }
    let n_broken = rows.iter().filter(|row| row.is_broken()).count();
    ensure!(n_broken == 0, "{n_broken} promises are broken");
    Ok(())
}
