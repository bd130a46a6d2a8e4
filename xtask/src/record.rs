//! Long runs whose last result is recorded in the repository.

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

/// A recorded run.
pub(crate) struct Recorded {
    /// Name of the task.
    name: &'static str,
    /// Arguments of cargo.
    cargo: &'static [&'static str],
    /// The binary in cargo's release folder, if cargo only builds it: `cargo run` of one package would select other features and
    /// compile dependencies again.
    built: Option<&'static str>,
    /// First arguments of the program.
    program: &'static [&'static str],
    /// The page, from the root of the workspace.
    file: &'static str,
    /// Title and introduction of the page.
    preamble: &'static str,
}

/// Millions of grazing rays through wide BVHs.
pub(crate) const GRAZING: Recorded = Recorded {
    name: "grazing",
    cargo: &["run", "--release", "--package", "canted-tests", "--example", "grazing"],
    built: None,
    program: &[],
    file: "tests/GRAZING.md",
    preamble: "# Grazing rays

Written by `cargo xtask grazing [--rays N]`; do not edit. Rays pass through vertices and edges, within 10⁻³ rad of
face planes, along axes, from inside, and from 100, 1,000 and 10,000 mesh sizes away. Each is traced through the BVHs of all three
presets. `t`, `u`, `v`, primitive and occlusion are compared with a reference.
",
};

/// The same through BVHs that a device builds.
pub(crate) const GRAZING_DEVICE: Recorded = Recorded {
    name: "grazing-device",
    cargo: GRAZING.cargo,
    built: None,
    program: &["--device"],
    file: "tests/GRAZING_DEVICE.md",
    preamble: "# Grazing rays on a device

Written by `cargo xtask grazing-device [--rays N]`; do not edit. The rays are those of `tests/GRAZING.md`. Each is traced through binary
and eight-wide BVHs that the device builds over a program's own buffers, with boxes of each volume strategy, in one level. A hit of the CPU's reference
is lost if the device finds nothing, or something behind it that is not within the stated error of the ray. Other triangles are ties
within that error. Rays that the driver ended early are not answered.
",
};

/// Mutated files for every reader, in the test profile, which checks for overflow. Requires a C++ compiler.
pub(crate) const FUZZ: Recorded = Recorded {
    name: "fuzz",
    cargo: &["run", "--package", "canted-scene", "--example", "fuzz", "--features", "meshopt,ktx2"],
    built: None,
    program: &[],
    file: "tests/FUZZ.md",
    preamble: "# Mutated files

Written by `cargo xtask fuzz [--minutes N] [--seed N]`; do not edit. Real and malformed files of every format are mutated one to
four times (bytes, ranges, numbers) and read. Half of the JSON and scene file cases stay well-formed: values, elements and tables
are changed, swapped, duplicated or removed. A reader must return a valid scene or an error, without a panic and within half a minute.
",
};

/// Rays at vertices and edges of closed meshes.
pub(crate) const WATERTIGHT: Recorded = Recorded {
    name: "watertight",
    cargo: &["build", "--release", "--bin", "canted-bench"],
    built: Some("canted-bench"),
    program: &["watertight"],
    file: "tests/WATERTIGHT.md",
    preamble: "# Closed meshes

Written by `cargo xtask watertight [--rays N]`; do not edit. Rays pass through shared vertices and edges of closed meshes, half
of them from inside, half from outside towards a point inside. Meshes are unchanged, scaled by 1e-6, 2^-10, 2^10 and 1e6, moved to 1e7,
sheared and mirrored. A ray leaks if it has no closest hit or no occlusion, or if its crossings do not alternate between entering and
leaving (leaving first from inside). The bunny's holes are closed by fans that may intersect the rest, so its
crossings must only be balanced. Crossings are counted on the CPU; devices return first hits. Where a driver ends a traversal
early, the CPU traces the ray; the table states how often. Runs use the release profile; tests trace fewer rays in the test profile.
",
};

/// Every numerical promise on every case, compared with peers.
pub(crate) const EXTREMES: Recorded = Recorded {
    name: "extremes",
    cargo: &["build", "--release", "--bin", "canted-bench"],
    built: Some("canted-bench"),
    program: &["extremes"],
    file: "tests/EXTREMES.md",
    preamble: "# Extremes

Written by `cargo xtask extremes [--effort N] [--peers]`; do not edit. The numerical contract, case by case: the promise,
the reference that checks it, the bound, and the worst result of each of our routines. A test asserts every line
(`tests/tests/extremes.rs`). Inputs are those that the reference decides with certainty. A count is the number of failed inputs; any
other value is the worst over all inputs, followed by the routines it belongs to. The bound `reported` promises nothing: the
value is for information, or no input is certain. Rays that a driver ended early on a device are traced by the CPU. Peers promise
nothing here: their values are shown because their users requested the same, and a peer may decide an edge differently. No value
depends on a clock. Runs use the release profile, tests the test profile. `docs/mended.md` lists what such cases revealed.
",
};

/// A binary in cargo's release folder.
fn program(built: &str) -> PathBuf {
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace::root().join("target"), PathBuf::from);
    target.join("release").join(format!("{built}{}", env::consts::EXE_SUFFIX))
}

impl Recorded {
    /// Runs and writes the page. Returns whether the run found nothing.
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
        let table = String::from_utf8(output.stdout).context("the run wrote invalid UTF-8")?;
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
    fn pages_have_title_facts_and_table() {
        for (run, title) in [
            (GRAZING, "# Grazing rays\n"),
            (GRAZING_DEVICE, "# Grazing rays on a device\n"),
            (FUZZ, "# Mutated files\n"),
            (WATERTIGHT, "# Closed meshes\n"),
            (EXTREMES, "# Extremes\n"),
        ] {
            let page = run.page("*then*", "| a |\n\n");
            assert!(page.starts_with(title) && page.ends_with("\n\n*then*\n\n| a |\n"), "{page}");
        }
        assert!(GRAZING.facts(&["--rays", "9"]).unwrap().contains("`cargo xtask grazing --rays 9`"));
        assert!(FUZZ.facts(&["--minutes", "9"]).unwrap().contains("`cargo xtask fuzz --minutes 9`"));
    }
}
