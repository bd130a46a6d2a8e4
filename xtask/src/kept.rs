//! Long runs whose last table is kept in the repository.

use std::{
    env, fs,
    path::PathBuf,
    process::{Command, Stdio},
};

use anyhow::{Context, Result};

use crate::{
    bench::{PEERS, facts_of, machine},
    command::{self, cargo, say},
    workspace,
};

/// A run whose table is kept.
pub(crate) struct Kept {
    /// What follows `cargo xtask`.
    name: &'static str,
    /// Arguments of cargo, up to those of the program.
    cargo: &'static [&'static str],
    /// Where cargo builds the program, below its folder for the profile release, if it builds and does not run it: so what
    /// `cargo build --release` compiled is used again, which `cargo run` of one package would compile anew.
    built: Option<&'static str>,
    /// Arguments of the program, up to those of the run.
    program: &'static [&'static str],
    /// Where the page is, from the root of the workspace.
    file: &'static str,
    /// The head of the page.
    preamble: &'static str,
}

/// Millions of grazing rays at wide trees.
pub(crate) const GRAZING: Kept = Kept {
    name: "grazing",
    cargo: &["run", "--release", "--package", "canted-tests", "--example", "grazing"],
    built: None,
    program: &[],
    file: "tests/GRAZING.md",
    preamble: "# Grazing rays

Written by `cargo xtask grazing [--rays N]`; change nothing by hand. Rays through vertices and edges, within 10⁻³ rad of
face planes, along axes, from inside, from 100, 1,000 and 10,000 sizes away, each traced through the trees of all three
presets: `t`, `u`, `v` and primitive, and occlusion, beside what judges them.
",
};

/// Changed files through every reader; the profile is that of tests, which checks for overflow.
pub(crate) const FUZZ: Kept = Kept {
    name: "fuzz",
    cargo: &["run", "--package", "canted-scene", "--example", "fuzz"],
    built: None,
    program: &[],
    file: "tests/FUZZ.md",
    preamble: "# Changed files

Written by `cargo xtask fuzz [--minutes N] [--seed N]`; change nothing by hand. Real and malformed files of every format with
bytes, pieces and numbers changed, one to four times each, are read; half of the cases of JSON and of scene files stay well-formed,
with values, elements and tables changed, exchanged, doubled and left out. The answer may be a scene that keeps its promises or an
error, but neither a panic nor half a minute without any.
",
};

/// Rays at vertices and edges of closed meshes.
pub(crate) const WATERTIGHT: Kept = Kept {
    name: "watertight",
    cargo: &["build", "--release", "--bin", "canted-bench"],
    built: Some("canted-bench"),
    program: &["watertight"],
    file: "tests/WATERTIGHT.md",
    preamble: "# Closed meshes

Written by `cargo xtask watertight [--rays N]`; change nothing by hand. Rays at shared vertices and edges of closed meshes, half
of them from inside, half from outside to a point inside; as they are, at 1e-6, 2^-10, 2^10 and 1e6, at 1e7, sheared and
mirrored. Each is asked for its first hit and for any hit (a leak where either is none), or counted through: then a leak is a
ray that does not cross the surface at least once, in and out in turn, beginning with out where it starts inside. Of the bunny,
whose holes are closed by fans that may cut the rest, crossings need only be as many in as out. They are counted on the CPU alone:
devices tell first hits. Where a driver cuts a device's walk short the CPU answers; how often is in the table. The profile is
release; tests shoot fewer rays in theirs.
",
};

/// Every promise on every case, beside the peers.
pub(crate) const EXTREMES: Kept = Kept {
    name: "extremes",
    cargo: &["build", "--release", "--bin", "canted-bench"],
    built: Some("canted-bench"),
    program: &["extremes"],
    file: "tests/EXTREMES.md",
    preamble: "# Extremes

Written by `cargo xtask extremes [--effort N] [--peers]`; change nothing by hand. The numerical contract, case by case: what is
promised, what judges it, the bound, and the worst that each routine of ours did; a test asserts every line
(`tests/tests/extremes.rs`). Inputs are those of which the judge is certain. A count is of inputs that failed, any other value is
the worst of all inputs; behind it stand the routines that it belongs to. A bound that is `told` promises nothing: the value is
for information, or no input is certain. Answers that a driver cut short on a device are the CPU's. Of peers nothing is promised:
their values stand beside ours because their users asked for the same, and a peer may rightly decide an edge otherwise. No value
depends on a clock. The profile is release; the test runs in its own. What such cases revealed, and how it was mended, stands in
`docs/mended.md`.
",
};

/// What cargo built for the profile release.
fn program(built: &str) -> PathBuf {
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace::root().join("target"), PathBuf::from);
    target.join("release").join(format!("{built}{}", env::consts::EXE_SUFFIX))
}

impl Kept {
    /// Runs, and writes the page; whether nothing was found.
    pub(crate) fn run(&self, args: &[&str]) -> Result<bool> {
        let facts = self.facts(args)?;
        let features: &[&str] = if args.contains(&PEERS) { &["--features", "canted-benches/peers"] } else { &[] };
        let mut command = cargo(self.cargo);
        command.args(features);
        match self.built {
            None => drop(command.arg("--")),
            Some(built) => {
                anyhow::ensure!(command::succeeds(&mut command)?, "cargo {} failed", self.cargo.join(" "));
                command = Command::new(program(built));
            }
        }
        command.args(self.program).args(args.iter().filter(|&&arg| arg != PEERS));
        let output = command.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
        let table = String::from_utf8(output.stdout).context("the run wrote something that is not text")?;
        anyhow::ensure!(table.starts_with('|'), "the run failed: {}", output.status);
        let path = workspace::root().join(self.file);
        fs::write(&path, self.page(&facts, &table)).with_context(|| format!("cannot write {}", path.display()))?;
        say(table.trim_end());
        Ok(output.status.success())
    }

    fn facts(&self, args: &[&str]) -> Result<String> {
        let words: Vec<&str> = ["cargo xtask", self.name].iter().chain(args).copied().collect();
        Ok(facts_of(&[
            &machine(),
            &command::output("rustc", &["--version"])?,
            &command::output("git", &["describe", "--always", "--dirty=, with changes"])?,
            &command::output("date", &["-u", "+%F"])?,
            &format!("`{}`", words.join(" ")),
        ]))
    }

    fn page(&self, facts: &str, table: &str) -> String {
        format!("{}\n{facts}\n\n{}\n", self.preamble, table.trim_end())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_say_how_and_what() {
        for (kept, title) in [
            (GRAZING, "# Grazing rays\n"),
            (FUZZ, "# Changed files\n"),
            (WATERTIGHT, "# Closed meshes\n"),
            (EXTREMES, "# Extremes\n"),
        ] {
            let page = kept.page("*then*", "| a |\n\n");
            assert!(page.starts_with(title) && page.ends_with("\n\n*then*\n\n| a |\n"), "{page}");
        }
        assert!(GRAZING.facts(&["--rays", "9"]).unwrap().contains("`cargo xtask grazing --rays 9`"));
        assert!(FUZZ.facts(&["--minutes", "9"]).unwrap().contains("`cargo xtask fuzz --minutes 9`"));
    }
}
