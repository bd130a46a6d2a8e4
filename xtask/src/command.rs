//! Runs other programs, prints, and knows the folders and manifests of the workspace.

use std::{
    ffi::OsString,
    fmt, fs,
    io::{BufRead, BufReader, Read, Write},
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, Result, bail};

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

/// A program in the root of the workspace, without input.
pub(crate) fn program(name: impl Into<OsString>, args: &[&str]) -> Command {
    let mut command = Command::new(name.into());
    command.args(args).current_dir(root()).stdin(Stdio::null());
    // A layer of Mesa's Vulkan driver asks Wayland for the default adapter, and reports a missing folder as an error.
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        command.env("XDG_RUNTIME_DIR", std::env::temp_dir());
    }
    command
}

/// The same cargo that runs this program.
pub(crate) fn cargo(args: &[&str]) -> Command {
    program(std::env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo")), args)
}

/// Runs a command with its output shown; whether it ended with exit code 0.
pub(crate) fn succeeds(command: &mut Command) -> Result<bool> {
    let status = command.status().with_context(|| format!("cannot start {}", name(command)))?;
    Ok(status.success())
}

/// Runs a command without output; whether it ended with exit code 0.
pub(crate) fn succeeds_silently(command: &mut Command) -> bool {
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}

/// Runs a command with its errors shown and returned; whether it ended with exit code 0.
pub(crate) fn with_errors(command: &mut Command) -> Result<(bool, String)> {
    let mut child =
        command.stderr(Stdio::piped()).spawn().with_context(|| format!("cannot start {}", name(command)))?;
    let mut errors = String::new();
    read_lines(child.stderr.take().context("standard error is piped")?, |line| {
        warn(line);
        errors += line;
        errors.push('\n');
    })?;
    Ok((child.wait()?.success(), errors))
}

/// Runs a command and calls `each` with every line of its standard output; whether it ended with exit code 0.
pub(crate) fn for_each_line(command: &mut Command, each: impl FnMut(&str)) -> Result<bool> {
    let mut child =
        command.stdout(Stdio::piped()).spawn().with_context(|| format!("cannot start {}", name(command)))?;
    read_lines(child.stdout.take().context("standard output is piped")?, each)?;
    Ok(child.wait()?.success())
}

/// Compilers and tests may print any bytes.
fn read_lines(from: impl Read, mut each: impl FnMut(&str)) -> Result<()> {
    for line in BufReader::new(from).split(b'\n') {
        each(String::from_utf8_lossy(&line.context("cannot read its output")?).trim_end_matches('\r'));
    }
    Ok(())
}

/// Standard output of a program run in the root of the workspace.
pub(crate) fn output(name: &str, args: &[&str]) -> Result<String> {
    let output = program(name, args).output().with_context(|| format!("cannot start {name}"))?;
    if !output.status.success() {
        bail!("{name} {} failed: {}", args.join(" "), String::from_utf8_lossy(&output.stderr).trim());
    }
    String::from_utf8(output.stdout).with_context(|| format!("{name} wrote invalid UTF-8"))
}

/// Whether `cargo NAME` is installed.
pub(crate) fn has_cargo_command(name: &str) -> bool {
    succeeds_silently(&mut cargo(&[name, "--version"]))
}

fn name(command: &Command) -> String {
    command.get_program().to_string_lossy().into_owned()
}

/// The folder of the workspace's manifest.
pub(crate) fn root() -> PathBuf {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().unwrap_or(own).to_owned()
}

/// The folder in which cargo builds.
pub(crate) fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}

/// A program of the workspace, where cargo builds it for tests: in [`target()`], for the machine itself.
pub(crate) fn built(name: &str) -> PathBuf {
    root().join(target()).join("debug").join(format!("{name}{}", std::env::consts::EXE_SUFFIX))
}

/// The optional folder of real models: `CANTED_SCENES`, else `../shared/scenes`.
pub(crate) fn models() -> PathBuf {
    std::env::var_os("CANTED_SCENES").map_or_else(|| root().join("../shared/scenes"), PathBuf::from)
}

/// Writes a file of the workspace, with its folder, and prints its path.
pub(crate) fn write(path: &str, text: &str) -> Result<()> {
    let full = root().join(path);
    fs::create_dir_all(full.parent().unwrap_or(&full))
        .and_then(|()| fs::write(&full, text))
        .with_context(|| format!("cannot write {}", full.display()))?;
    say(&format!("wrote {path}"));
    Ok(())
}

/// Paths in a folder whose name ends with `.extension`, sorted; none if there is no folder.
pub(crate) fn files_with(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let mut paths: Vec<_> = entries.filter(|path| path.extension().is_some_and(|found| found == extension)).collect();
    paths.sort();
    paths
}

/// Paths, relative to the root, of all files that are tracked or would be added by `git add`.
pub(crate) fn files() -> Result<Vec<PathBuf>> {
    let list = output("git", &["ls-files", "-z", "--cached", "--others", "--exclude-standard"])?;
    // A file deleted but not yet committed is still listed.
    Ok(list.split_terminator('\0').map(PathBuf::from).filter(|path| root().join(path).is_file()).collect())
}

/// The value of `key` in the section `[section]` of a manifest: the first such line, without quotes.
pub(crate) fn value<'a>(manifest: &'a str, section: &str, key: &str) -> Option<&'a str> {
    entries(manifest, section).find(|(name, _)| *name == key).map(|(_, value)| value.trim_matches('"'))
}

/// The lines `key = value` of the section `[section]` of a manifest.
fn entries<'a>(manifest: &'a str, section: &str) -> impl Iterator<Item = (&'a str, &'a str)> {
    let lines = manifest.lines().skip_while(move |line| line.trim() != format!("[{section}]")).skip(1);
    let own = lines.take_while(|line| !line.starts_with('[')).filter(|line| !line.starts_with('#'));
    own.filter_map(|line| line.split_once('=')).map(|(key, value)| (key.trim(), value.trim()))
}

/// Name and features, without `default`, of every package under `crates/` that has features.
pub(crate) fn packages_with_features() -> Result<Vec<(String, Vec<String>)>> {
    let mut packages = vec![];
    for entry in fs::read_dir(root().join("crates")).context("cannot list the crates")? {
        let path = entry?.path().join("Cargo.toml");
        let Ok(manifest) = fs::read_to_string(&path) else { continue };
        let name = value(&manifest, "package", "name").with_context(|| format!("{}: no name", path.display()))?;
        let features = entries(&manifest, "features").map(|(key, _)| key.to_owned());
        let features: Vec<String> = features.filter(|feature| feature != "default").collect();
        if !features.is_empty() {
            packages.push((name.to_owned(), features));
        }
    }
    packages.sort();
    Ok(packages)
}

/// Numbers of tests.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Count {
    pub(crate) passed: usize,
    pub(crate) failed: usize,
    /// Tests that were ignored.
    pub(crate) skipped: usize,
}

impl Count {
    /// Adds the numbers of a line like `test result: ok. 3 passed; 0 failed; 1 ignored; ...`; other lines have none.
    pub(crate) fn add(&mut self, line: &str) {
        let Some((_, totals)) = line.strip_prefix("test result: ").and_then(|result| result.split_once(". ")) else {
            return;
        };
        for part in totals.split("; ") {
            let Some((n, kind)) = part.split_once(' ') else { continue };
            let n = n.parse().unwrap_or(0);
            match kind {
                "passed" => self.passed += n,
                "failed" => self.failed += n,
                "ignored" => self.skipped += n,
                _ => {}
            }
        }
    }
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} passed, {} failed, {} skipped", self.passed, self.failed, self.skipped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_arrive_one_by_one_and_failure_is_returned() {
        let mut lines = vec![];
        assert!(for_each_line(&mut cargo(&["--version"]), |line| lines.push(line.to_owned())).unwrap());
        assert!(lines.len() == 1 && lines[0].starts_with("cargo "), "{lines:?}");
        assert!(!for_each_line(cargo(&["no-such-command"]).stderr(Stdio::null()), |_| ()).unwrap());
        let error = output("canted-has-no-such-program", &[]).unwrap_err();
        assert!(!has_cargo_command("no-such-command") && error.to_string().contains("canted-has-no-such-program"));
    }

    #[test]
    fn values_come_from_their_section() {
        let manifest = "[package]\nname = \"a\"\n\n[features]\n# why = \"not\"\ndefault = [\"x\"]\nx = [\"dep:y\"]\n\n\
                        [dependencies]\nname = \"b\"\n";
        let names = ["package", "dependencies", "lints"].map(|section| value(manifest, section, "name"));
        assert_eq!(names, [Some("a"), Some("b"), None]);
        assert!(entries(manifest, "features").map(|(key, _)| key).eq(["default", "x"]));
        let packages = packages_with_features().unwrap();
        assert!(packages.iter().any(|(name, features)| name == "canted-lbvh" && features[..] == ["parallel"]));
        assert!(packages.iter().all(|(name, _)| name != "canted-gpu"), "canted-gpu has no features");
    }

    #[test]
    fn results_of_programs_are_summed() {
        let mut count = Count::default();
        for line in [
            "running 4 tests",
            "test a ... ok",
            "test result: FAILED. 2 passed; 1 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.00s",
            "test result: ok. 30 passed; 0 failed; 5 ignored; 0 measured; 0 filtered out; finished in 1.2s",
            "error: could not compile",
        ] {
            count.add(line);
        }
        assert_eq!(count.to_string(), "32 passed, 1 failed, 6 skipped");
    }
}
