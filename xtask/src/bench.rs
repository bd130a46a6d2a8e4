//! `cargo xtask bench`, `report` and the long-running records: runs what measures, and with `--keep` records the result.

use std::{
    env, fs,
    process::{Command, Stdio},
    thread,
};

use anyhow::{Context, Result, bail};

use crate::{
    command::{self, cargo, say},
    results::{self, Facts},
};

/// The argument that adds peers written in other languages.
const PEERS: &str = "--peers";
/// The section that compares README with a measurement of the peers.
const CLAIMS: &str = "claims";
/// The argument that records the results in the repository.
pub(crate) const KEEP: &str = "--keep";

/// Environment variables that change results.
const VARIABLES: [&str; 2] = ["RUSTFLAGS", "CANTED_EMBREE"];

/// The folder of a report, from the root of the workspace.
const REPORT: &str = "target/report";

/// Runs the benchmark program with `args`.
pub(crate) fn run(args: &[&str]) -> Result<bool> {
    // Read before measuring, which may take an hour in which files change.
    let facts = facts()?;
    let mut command = program(args);
    command.args(own(args));
    let output = command.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    let measured = String::from_utf8(output.stdout).context("canted-bench wrote invalid UTF-8")?;
    say(measured.trim_end());
    if !output.status.success() {
        bail!("canted-bench failed: {}", output.status);
    }
    if args.contains(&KEEP) {
        results::keep(&measured, facts, &words("bench", args, variable))?;
    } else {
        command::write("target/bench/measured.md", &measured)?;
        say(&format!("not recorded: add {KEEP} to write {}", results::RECORD));
    }
    Ok(true)
}

/// Runs the benchmark program for a report with `args`.
pub(crate) fn report(args: &[&str]) -> Result<bool> {
    let facts = facts()?;
    let words = words("report", args, variable);
    let mut command = program(args);
    command.args(["report", "--out", REPORT]);
    let Facts { machine, compiler, commit, date } = &facts;
    for (name, value) in
        [("machine", machine), ("compiler", compiler), ("commit", commit), ("date", date), ("command", &words)]
    {
        command.arg(format!("--{name}")).arg(value);
    }
    if !command::succeeds(command.args(own(args)))? {
        return Ok(false);
    }
    let page = command::root().join(REPORT).join("report.md");
    if args.contains(&KEEP) {
        let text = fs::read_to_string(&page).with_context(|| format!("cannot read {}", page.display()))?;
        results::keep(&text, facts, &words)?;
    }
    say(&format!("wrote {}", page.display()));
    Ok(true)
}

/// The arguments that the program itself reads.
fn own<'a>(args: &[&'a str]) -> impl Iterator<Item = &'a str> {
    args.iter().copied().filter(|&arg| arg != PEERS && arg != KEEP).collect::<Vec<_>>().into_iter()
}

/// The benchmark program with thin LTO, as the results were recorded, and with the peers where `args` request them.
fn program(args: &[&str]) -> Command {
    let mut command = cargo(&["run", "--release", "--package", "canted-benches"]);
    command.env("CARGO_PROFILE_RELEASE_LTO", "thin");
    if args.contains(&PEERS) || args.contains(&CLAIMS) {
        command.args(["--features", "canted-benches/peers"]);
    }
    command.arg("--");
    command
}

/// Machine, compiler, commit and date.
fn facts() -> Result<Facts> {
    let machine = format!("{}, {} threads", processor(), thread::available_parallelism().map_or(1, usize::from));
    let line = |program: &str, args: &[&str]| command::output(program, args).map(|text| text.trim().to_owned());
    // Results of a command are no change for the next one.
    let results = [":!benches/results", ":!benches/RESULTS.md", ":!benches/PYTHON.md"];
    let changed = line("git", &[&["status", "--porcelain", "--", "."][..], &results].concat())?;
    let changes = if changed.is_empty() { "" } else { ", with changes" };
    Ok(Facts {
        machine,
        compiler: line("rustc", &["--version"])?,
        commit: line("git", &["rev-parse", "--short", "HEAD"])? + changes,
        date: line("date", &["-u", "+%F"])?,
    })
}

fn variable(name: &str) -> Option<String> {
    env::var(name).ok()
}

/// The command as it was given: environment variables that change results, then `cargo xtask` with task and arguments.
fn words(task: &str, args: &[&str], variable: impl Fn(&str) -> Option<String>) -> String {
    let variables = VARIABLES.iter().filter_map(|&name| match (name, variable(name)?) {
        // The path of a library is private; that one was given is not.
        ("CANTED_EMBREE", _) => Some("CANTED_EMBREE=…".to_owned()),
        (name, value) => Some(format!("{name}='{value}'")),
    });
    let args = args.iter().copied().filter(|&arg| arg != KEEP);
    let words = ["cargo xtask", task].into_iter().chain(args).map(str::to_owned);
    variables.chain(words).collect::<Vec<_>>().join(" ")
}

/// Name of the processor, as reported by the system.
fn processor() -> String {
    let linux = || model_name(&fs::read_to_string("/proc/cpuinfo").ok()?);
    let mac = || command::output("sysctl", &["-n", "machdep.cpu.brand_string"]).ok();
    linux().or_else(mac).map_or_else(|| "unknown processor".to_owned(), |name| name.trim().to_owned())
}

fn model_name(cpuinfo: &str) -> Option<String> {
    let line = cpuinfo.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// A long run whose last kept result is a page of its own in `benches/results`, below the text that says what it is.
pub(crate) struct Long {
    /// Name of the task; also of the page.
    name: &'static str,
    /// Arguments of cargo.
    cargo: &'static [&'static str],
    /// The binary in cargo's release folder, if cargo only builds it: `cargo run` of one package would select other features and
    /// compile dependencies again.
    built: Option<&'static str>,
    /// First arguments of the program.
    program: &'static [&'static str],
}

const BUILD_BENCH: &[&str] = &["build", "--release", "--package", "canted-benches", "--bin", "canted-bench"];
const RUN_GRAZING: &[&str] = &["run", "--release", "--package", "canted-tests", "--example", "grazing"];

/// All long runs.
pub(crate) const LONG: [Long; 5] = [
    Long { name: "grazing", cargo: RUN_GRAZING, built: None, program: &[] },
    Long { name: "grazing-device", cargo: RUN_GRAZING, built: None, program: &["--device"] },
    Long { name: "watertight", cargo: BUILD_BENCH, built: Some("canted-bench"), program: &["watertight"] },
    Long { name: "extremes", cargo: BUILD_BENCH, built: Some("canted-bench"), program: &["extremes"] },
    Long {
        name: "fuzz",
        // In the test profile, which checks for overflow.
        cargo: &["run", "--package", "canted-scene", "--example", "fuzz"],
        built: None,
        program: &[],
    },
];

impl Long {
    /// Runs and prints the table; with `--keep` writes the page. Returns whether the run found nothing.
    pub(crate) fn run(&self, args: &[&str]) -> Result<bool> {
        let Facts { machine, compiler, commit, date } = facts()?;
        let command = words(self.name, args, variable);
        let facts = format!("*{machine}; {compiler}; {commit}; {date}; `{command}`*");
        let output = self.command(args)?.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
        let table = String::from_utf8(output.stdout).context("the run wrote invalid UTF-8")?;
        anyhow::ensure!(table.starts_with('|'), "the run failed: {}", output.status);
        say(table.trim_end());
        if args.contains(&KEEP) {
            let page = self.page();
            let old = fs::read_to_string(command::root().join(&page)).with_context(|| format!("cannot read {page}"))?;
            command::write(&page, &format!("{}{facts}\n\n{}\n", preamble(&old), table.trim_end()))?;
        } else {
            say(&format!("not recorded: add {KEEP} to write {}", self.page()));
        }
        Ok(output.status.success())
    }

    /// The program with its arguments, built.
    fn command(&self, args: &[&str]) -> Result<Command> {
        let mut command = cargo(self.cargo);
        if args.contains(&PEERS) {
            command.args(["--features", "canted-benches/peers"]);
        }
        match self.built {
            None => drop(command.arg("--")),
            Some(built) => {
                anyhow::ensure!(command::succeeds(&mut command)?, "cargo {} failed", self.cargo.join(" "));
                let target = command::target();
                command = Command::new(target.join("release").join(format!("{built}{}", env::consts::EXE_SUFFIX)));
            }
        }
        command.args(self.program).args(own(args));
        Ok(command)
    }

    /// The page, from the root of the workspace.
    fn page(&self) -> String {
        format!("benches/results/{}.md", self.name)
    }

    /// The run of this name.
    pub(crate) fn named(name: &str) -> Option<&'static Self> {
        LONG.iter().find(|long| long.name == name)
    }
}

/// What stands on a page before the line of machine and command.
fn preamble(page: &str) -> &str {
    &page[..page.find("\n*").map_or(page.len(), |at| at + 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_processor_is_the_first_in_the_list() {
        let cpuinfo = "processor\t: 0\nmodel name\t: Fast CPU @ 3.00GHz\n\nprocessor\t: 1\nmodel name\t: Slow\n";
        assert_eq!(model_name(cpuinfo).as_deref(), Some("Fast CPU @ 3.00GHz"));
        assert_eq!(model_name("processor\t: 0\n"), None);
    }

    #[test]
    fn commands_have_variables_and_no_keep() {
        let set = |name: &str| match name {
            "RUSTFLAGS" => Some("-C target-cpu=x86-64-v3".to_owned()),
            "CANTED_EMBREE" => Some("/a/folder".to_owned()),
            _ => None,
        };
        let said = words("report", &["--quick", KEEP], set);
        assert_eq!(said, "RUSTFLAGS='-C target-cpu=x86-64-v3' CANTED_EMBREE=… cargo xtask report --quick");
        assert_eq!(words("bench", &[], |_| None), "cargo xtask bench");
        assert_eq!(own(&["wide", PEERS, KEEP, "--quick"]).collect::<Vec<_>>(), ["wide", "--quick"]);
    }

    #[test]
    fn every_long_run_has_its_page_with_a_text_that_is_kept() {
        for long in &LONG {
            let page = fs::read_to_string(command::root().join(long.page())).unwrap();
            let preamble = preamble(&page);
            assert!(preamble.starts_with("# ") && preamble.ends_with("\n\n") && preamble.len() > 200, "{}", long.name);
            assert!(page[preamble.len()..].starts_with('*'), "{}", long.name);
        }
    }
}
