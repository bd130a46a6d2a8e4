//! `cargo xtask bench`: runs benchmarks and writes `benches/RESULTS.md`.

use std::{
    env, fs,
    process::{Command, Stdio},
    thread,
};

use anyhow::{Context, Result, bail};

use crate::{
    command::{self, cargo, say},
    workspace,
};

/// The text above all sections.
const PREAMBLE: &str = "# Results

Written by `cargo xtask bench` and `cargo xtask report --keep`; do not edit. A run replaces the sections it measures. Each section
states machine, compiler, commit, date and command.
";

/// The file of results, from the root of the workspace.
pub(crate) const RESULTS: &str = "benches/RESULTS.md";

/// The argument that adds peers written in other languages.
pub(crate) const PEERS: &str = "--peers";

/// Environment variables that change results.
const VARIABLES: [&str; 2] = ["RUSTFLAGS", "CANTED_EMBREE"];

/// Runs the benchmark program with `args` and writes its sections into the results.
pub(crate) fn run(args: &[&str]) -> Result<bool> {
    // Read before measuring, which may take an hour in which files change.
    let facts = facts(args)?;
    let mut command = program(args);
    command.args(args.iter().filter(|&&arg| arg != PEERS));
    let output = command.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    if !output.status.success() {
        bail!("canted-bench failed: {}", output.status);
    }
    let measured = String::from_utf8(output.stdout).context("canted-bench wrote invalid UTF-8")?;
    merge(&measured, &facts)?;
    Ok(true)
}

/// The benchmark program with thin LTO, as the results were recorded, and with the peers where `args` request them.
pub(crate) fn program(args: &[&str]) -> Command {
    let mut command = cargo(&["run", "--release", "--bin", "canted-bench"]);
    command.env("CARGO_PROFILE_RELEASE_LTO", "thin");
    if args.contains(&PEERS) {
        command.args(["--features", "canted-benches/peers"]);
    }
    command.arg("--");
    command
}

/// Writes measured sections into the results, each with its facts.
pub(crate) fn merge(measured: &str, facts: &str) -> Result<()> {
    let path = workspace::root().join(RESULTS);
    let old = fs::read_to_string(&path).unwrap_or_default();
    fs::write(&path, merged(&old, measured, facts)).with_context(|| format!("cannot write {}", path.display()))?;
    say(&format!("wrote {}", path.display()));
    Ok(())
}

/// Processor and number of threads.
pub(crate) fn machine() -> String {
    format!("{}, {} threads", processor(), thread::available_parallelism().map_or(1, usize::from))
}

/// One line: machine, compiler, commit, date, command.
fn facts(args: &[&str]) -> Result<String> {
    Ok(facts_of(&[
        &machine(),
        &command::output("rustc", &["--version"])?,
        &command::output("git", &["describe", "--always", "--dirty=, with changes"])?,
        &command::output("date", &["-u", "+%F"])?,
        &format!("`{}`", words("bench", args, |name| env::var(name).ok())),
    ]))
}

/// The command as it was given: environment variables that change results, then `cargo xtask` with task and arguments.
pub(crate) fn words(task: &str, args: &[&str], variable: impl Fn(&str) -> Option<String>) -> String {
    let variables = VARIABLES.iter().filter_map(|&name| match (name, variable(name)?) {
        // The path of a library is private; that one was given is not.
        ("CANTED_EMBREE", _) => Some("CANTED_EMBREE=…".to_owned()),
        (name, value) => Some(format!("{name}='{value}'")),
    });
    let words = ["cargo xtask", task].into_iter().chain(args.iter().copied()).map(str::to_owned);
    variables.chain(words).collect::<Vec<_>>().join(" ")
}

/// The values as one line in italics.
pub(crate) fn facts_of(values: &[&str]) -> String {
    format!("*{}*", values.iter().map(|value| value.trim()).collect::<Vec<_>>().join("; "))
}

/// The old results with sections of the same title replaced, and new ones last.
fn merged(old: &str, measured: &str, facts: &str) -> String {
    let (above, mut sections) = sections(old);
    // Older results have one table of facts above all sections.
    let shared: Vec<&str> = above.lines().filter_map(table_value).collect();
    if !shared.is_empty() {
        for (_, body) in &mut sections {
            *body = format!("\n{}\n{body}", facts_of(&shared));
        }
    }
    for (title, body) in self::sections(measured).1 {
        let body = format!("\n{facts}\n{body}");
        match sections.iter_mut().find(|(known, _)| *known == title) {
            Some(section) => section.1 = body,
            None => sections.push((title, body)),
        }
    }
    let mut text = PREAMBLE.to_owned();
    for (title, body) in sections {
        text.push_str(&format!("\n## {title}\n{}\n", body.trim_end()));
    }
    text
}

/// The second cell of a table row with a non-empty first cell.
fn table_value(line: &str) -> Option<&str> {
    let (name, value) = line.strip_prefix("| ")?.strip_suffix('|')?.split_once('|')?;
    (!name.trim().is_empty()).then_some(value.trim())
}

/// The text above the first section, then title and body of each section.
fn sections(text: &str) -> (String, Vec<(String, String)>) {
    let (mut above, mut sections) = (String::new(), Vec::<(String, String)>::new());
    for line in text.lines() {
        match (line.strip_prefix("## "), sections.last_mut()) {
            (Some(title), _) => sections.push((title.to_owned(), String::new())),
            (None, Some((_, body))) => *body += &format!("{line}\n"),
            (None, None) => above += &format!("{line}\n"),
        }
    }
    (above, sections)
}

/// Name of the processor, as reported by the system.
pub(crate) fn processor() -> String {
    let linux = || model_name(&fs::read_to_string("/proc/cpuinfo").ok()?);
    let mac = || command::output("sysctl", &["-n", "machdep.cpu.brand_string"]).ok();
    linux().or_else(mac).map_or_else(|| "unknown processor".to_owned(), |name| name.trim().to_owned())
}

fn model_name(cpuinfo: &str) -> Option<String> {
    let line = cpuinfo.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
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
    fn facts_name_compiler_date_and_command() {
        let facts = facts(&["--rounds", "3"]).unwrap();
        for part in ["; rustc 1.", "cargo xtask bench --rounds 3`*", "; 20"] {
            assert!(facts.contains(part), "{facts}");
        }
    }

    #[test]
    fn environment_variables_precede_the_command() {
        let set = |name: &str| match name {
            "RUSTFLAGS" => Some("-C target-cpu=x86-64-v3".to_owned()),
            "CANTED_EMBREE" => Some("/a/folder".to_owned()),
            _ => None,
        };
        let said = words("report", &["--quick"], set);
        assert_eq!(said, "RUSTFLAGS='-C target-cpu=x86-64-v3' CANTED_EMBREE=… cargo xtask report --quick");
        assert_eq!(words("bench", &[], |_| None), "cargo xtask bench");
    }

    #[test]
    fn a_run_replaces_its_sections_alone() {
        let old = merged("", "\n## A\n\nold\n\n### part\n\n## B\n\nkept\n", "*then*");
        assert_eq!(old, format!("{PREAMBLE}\n## A\n\n*then*\n\nold\n\n### part\n\n## B\n\n*then*\n\nkept\n"));
        let new = merged(&old, "## A\n\nnew\n\n## C\n\nadded\n", "*now*");
        let sections = "## A\n\n*now*\n\nnew\n\n## B\n\n*then*\n\nkept\n\n## C\n\n*now*\n\nadded\n";
        assert_eq!(new, format!("{PREAMBLE}\n{sections}"));
    }

    #[test]
    fn an_older_header_is_handed_to_its_sections() {
        let old = "# Results\n\n| | |\n|---|---|\n| Machine | CPU |\n| Date | 2026 |\n\n## A\n\nkept\n";
        assert_eq!(merged(old, "", "*now*"), format!("{PREAMBLE}\n## A\n\n*CPU; 2026*\n\nkept\n"));
    }
}
