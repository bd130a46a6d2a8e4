//! `cargo xtask bench`: measures, and writes `benches/RESULTS.md`.

use std::{fs, process::Stdio, thread};

use anyhow::{Context, Result, bail};

use crate::{
    command::{self, cargo, say},
    workspace,
};

/// Runs the benches' program with `args`, and writes its Markdown under a header that says where, when and how.
pub(crate) fn run(args: &[&str]) -> Result<bool> {
    // Asked before the measuring, which may take an hour in which files change.
    let header = header(args)?;
    let mut command = cargo(&["run", "--release", "--package", "canted-benches", "--bin", "canted-bench", "--"]);
    let output = command.args(args).stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    if !output.status.success() {
        bail!("canted-bench failed: {}", output.status);
    }
    let tables = String::from_utf8(output.stdout).context("canted-bench wrote something that is not text")?;
    let path = workspace::root().join("benches/RESULTS.md");
    fs::write(&path, format!("{header}\n{tables}")).with_context(|| format!("cannot write {}", path.display()))?;
    say(&format!("wrote {}", path.display()));
    Ok(true)
}

fn header(args: &[&str]) -> Result<String> {
    let command = ["cargo xtask bench"].iter().chain(args).copied().collect::<Vec<_>>().join(" ");
    let facts = [
        ("Machine", format!("{}, {} threads", processor(), thread::available_parallelism().map_or(1, usize::from))),
        ("Compiler", command::output("rustc", &["--version"])?),
        ("Commit", command::output("git", &["describe", "--always", "--dirty=, with changes"])?),
        ("Date", command::output("date", &["-u", "+%F"])?),
        ("Command", format!("`{command}`")),
    ];
    let mut text =
        "# Results\n\nWritten by `cargo xtask bench`; change nothing by hand.\n\n| | |\n|---|---|\n".to_owned();
    for (name, value) in facts {
        text.push_str(&format!("| {name} | {} |\n", value.trim()));
    }
    Ok(text)
}

/// Name of the processor, as far as the system tells.
fn processor() -> String {
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
    fn the_processor_is_the_first_that_is_listed() {
        let cpuinfo = "processor\t: 0\nmodel name\t: Fast CPU @ 3.00GHz\n\nprocessor\t: 1\nmodel name\t: Slow\n";
        assert_eq!(model_name(cpuinfo).as_deref(), Some("Fast CPU @ 3.00GHz"));
        assert_eq!(model_name("processor\t: 0\n"), None);
    }

    #[test]
    fn the_header_says_where_when_and_how() {
        let header = header(&["--rounds", "3"]).unwrap();
        for part in ["| Compiler | rustc 1.", "| Command | `cargo xtask bench --rounds 3` |", "| Date | 20"] {
            assert!(header.contains(part), "{header}");
        }
    }
}
