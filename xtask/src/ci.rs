//! `cargo xtask ci`: everything that is checked before a change is taken.
//!
//! Every step runs even where an earlier one failed; the tests come last, so that the output ends on their count.

use std::{
    fs,
    process::Command,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};

use crate::{
    command::{cargo, has_cargo_command, say, succeeds},
    png, test, tidy, workspace,
};

/// How a step ended.
enum End {
    Passed,
    Failed,
    Skipped(String),
}

impl End {
    fn of(is_well: bool) -> Self {
        if is_well { Self::Passed } else { Self::Failed }
    }
}

type Step = (&'static str, fn() -> Result<End>);

const STEPS: [Step; 8] = [
    ("formatting", formatting),
    ("tidy", || tidy::run().map(End::of)),
    ("lints", lints),
    ("documentation", documentation),
    ("features", features),
    ("dependencies", dependencies),
    ("benches as tests", benches),
    ("a short render", short_render),
];

/// Runs all steps, then the tests; the last line of the output is the count of tests. Whether all is well.
pub(crate) fn run() -> Result<bool> {
    let mut report = vec![];
    let mut is_well = true;
    for (name, step) in STEPS {
        let (end, time) = timed(name, step);
        is_well &= !matches!(end, End::Failed);
        report.push((name, end, time));
    }
    let mut count = None;
    let (end, time) = timed("tests", || {
        let (counted, is_well) = test::count()?;
        count = Some(counted);
        Ok(End::of(is_well))
    });
    is_well &= matches!(end, End::Passed);
    report.push(("tests", end, time));
    say("");
    for (name, end, time) in &report {
        let word = match end {
            End::Passed => "passed".to_owned(),
            End::Failed => "FAILED".to_owned(),
            End::Skipped(reason) => format!("skipped: {reason}"),
        };
        say(&format!("{name:<18}{:>7.1} s  {word}", time.as_secs_f64()));
    }
    say("");
    say(&count.unwrap_or_default().to_string());
    Ok(is_well)
}

/// Runs a step under its heading; a step that cannot run has failed.
fn timed(name: &str, step: impl FnOnce() -> Result<End>) -> (End, Duration) {
    say(&format!("\n== {name}"));
    let start = Instant::now();
    let end = step().unwrap_or_else(|error| {
        say(&format!("{error:#}"));
        End::Failed
    });
    (end, start.elapsed())
}

/// Runs `cargo NAME`, or says that it is not installed.
fn if_installed(name: &str, command: &mut Command) -> Result<End> {
    if !has_cargo_command(name) {
        return Ok(End::Skipped(format!("cargo {name} is not installed")));
    }
    succeeds(command).map(End::of)
}

fn formatting() -> Result<End> {
    if_installed("fmt", &mut cargo(&["fmt", "--all", "--check"]))
}

fn lints() -> Result<End> {
    if_installed("clippy", &mut cargo(&["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"]))
}

fn documentation() -> Result<End> {
    let mut command = cargo(&["doc", "--workspace", "--no-deps"]);
    succeeds(command.env("RUSTDOCFLAGS", "-D warnings")).map(End::of)
}

/// Every package that has features, without any and with each alone.
fn features() -> Result<End> {
    let (check, flags): (_, &[_]) =
        if has_cargo_command("clippy") { ("clippy", &["--", "-D", "warnings"]) } else { ("check", &[]) };
    let mut is_well = true;
    for (package, features) in workspace::packages_with_features()? {
        for feature in [""].into_iter().chain(features.iter().map(String::as_str)) {
            say(&format!("{package}, {}", if feature.is_empty() { "no feature" } else { feature }));
            let args = [check, "--package", &package, "--no-default-features", "--features", feature, "--all-targets"];
            is_well &= succeeds(cargo(&args).args(flags))?;
        }
    }
    Ok(End::of(is_well))
}

/// Licences, sources and duplicates; advisories are left out because they need a network.
fn dependencies() -> Result<End> {
    if_installed("deny", &mut cargo(&["deny", "check", "licenses", "bans", "sources"]))
}

/// Each measured piece of work once, in the profile of the tests, so that benches do not rot.
fn benches() -> Result<End> {
    succeeds(&mut cargo(&["test", "--workspace", "--bench", "stations"])).map(End::of)
}

/// The built-in scene through the program as users build it.
fn short_render() -> Result<End> {
    const SIZE: [u32; 2] = [160, 90];
    let folder = workspace::root().join("target/ci");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let picture = folder.join("canted.png");
    // A picture of an earlier run proves nothing.
    if picture.exists() {
        fs::remove_file(&picture).with_context(|| format!("cannot remove {}", picture.display()))?;
    }
    let mut command = cargo(&["run", "--release", "--package", "canted-cli", "--", "render", "--spp", "1"]);
    command.args(["--size", &format!("{}x{}", SIZE[0], SIZE[1]), "--output"]).arg(&picture);
    if !succeeds(&mut command)? {
        return Ok(End::Failed);
    }
    let size = png::size(&picture)?;
    ensure!(size == SIZE, "{} has {} x {} pixels", picture.display(), size[0], size[1]);
    Ok(End::Passed)
}
