//! Runs other programs, and prints.

use std::{
    ffi::OsString,
    io::{BufRead, BufReader, Write},
    process::{Command, Stdio},
};

use anyhow::{Context, Result, bail};

use crate::workspace;

/// Writes a line to standard output.
pub(crate) fn say(text: &str) {
    let mut out = std::io::stdout().lock();
    // A closed pipe is not an error: the reader has seen enough.
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

/// Writes a line to standard error.
pub(crate) fn warn(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// The same cargo that runs this program, in the root of the workspace.
pub(crate) fn cargo(args: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo")));
    command.args(args).current_dir(workspace::root()).stdin(Stdio::null());
    command
}

/// Runs a command with its output shown; whether it ended with exit code 0.
pub(crate) fn succeeds(command: &mut Command) -> Result<bool> {
    let status = command.status().with_context(|| format!("cannot start {}", name(command)))?;
    Ok(status.success())
}

/// Runs a command with its errors shown and returned; whether it ended with exit code 0.
pub(crate) fn with_errors(command: &mut Command) -> Result<(bool, String)> {
    let mut child =
        command.stderr(Stdio::piped()).spawn().with_context(|| format!("cannot start {}", name(command)))?;
    let mut reader = BufReader::new(child.stderr.take().context("standard error is piped")?);
    let (mut errors, mut line) = (String::new(), vec![]);
    // Compilers may print any bytes.
    while reader.read_until(b'\n', &mut line).context("cannot read standard error")? > 0 {
        let text = String::from_utf8_lossy(&line);
        warn(text.trim_end_matches(['\n', '\r']));
        errors += &text;
        line.clear();
    }
    Ok((child.wait()?.success(), errors))
}

/// Runs a command and calls `each` with every line of its standard output; whether it ended with exit code 0.
pub(crate) fn for_each_line(command: &mut Command, mut each: impl FnMut(&str)) -> Result<bool> {
    let mut child =
        command.stdout(Stdio::piped()).spawn().with_context(|| format!("cannot start {}", name(command)))?;
    let mut lines = BufReader::new(child.stdout.take().context("standard output is piped")?);
    let mut line = vec![];
    // Tests may print any bytes.
    while lines.read_until(b'\n', &mut line)? > 0 {
        each(String::from_utf8_lossy(&line).trim_end_matches(['\n', '\r']));
        line.clear();
    }
    Ok(child.wait()?.success())
}

/// Standard output of a program run in the root of the workspace.
pub(crate) fn output(program: &str, args: &[&str]) -> Result<String> {
    let mut command = Command::new(program);
    command.args(args).current_dir(workspace::root()).stdin(Stdio::null());
    let output = command.output().with_context(|| format!("cannot start {program}"))?;
    if !output.status.success() {
        bail!("{program} {} failed: {}", args.join(" "), String::from_utf8_lossy(&output.stderr).trim());
    }
    String::from_utf8(output.stdout).with_context(|| format!("{program} wrote invalid UTF-8"))
}

/// Whether `cargo NAME` is installed.
pub(crate) fn has_cargo_command(name: &str) -> bool {
    let mut command = cargo(&[name, "--version"]);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

fn name(command: &Command) -> String {
    command.get_program().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_arrive_one_by_one_and_failure_is_returned() {
        let mut lines = vec![];
        assert!(for_each_line(&mut cargo(&["--version"]), |line| lines.push(line.to_owned())).unwrap());
        assert_eq!(lines.len(), 1);
        assert!(lines[0].starts_with("cargo "), "{lines:?}");
        let mut wrong = cargo(&["no-such-command"]);
        assert!(!for_each_line(wrong.stderr(Stdio::null()), |_| ()).unwrap());
    }

    #[test]
    fn a_missing_program_is_named() {
        assert!(!has_cargo_command("no-such-command"));
        let error = output("canted-has-no-such-program", &[]).unwrap_err();
        assert!(error.to_string().contains("canted-has-no-such-program"));
    }
}
