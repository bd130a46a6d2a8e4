//! `cargo xtask ci`: all checks.
//!
//! Every step runs, even after a failure. Tests run last, so that the output ends with their count.

use std::{
    fs,
    process::Command,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};

use crate::{
    browser,
    command::{self, cargo, has_cargo_command, say, succeeds},
    kernels, looping,
    publish::{self, Outcome},
    python, test, tidy, window,
};

/// How a step ended.
enum End {
    Passed,
    /// With lines that say why; none where cargo has said it.
    Failed(String),
    Skipped(String),
}

impl End {
    fn of(is_well: bool) -> Self {
        if is_well { Self::Passed } else { Self::Failed(String::new()) }
    }

    /// The same end; a failure that says nothing names its place.
    fn at(self, place: &str) -> Self {
        match self {
            Self::Failed(lines) if lines.is_empty() => Self::Failed(place.to_owned()),
            other => other,
        }
    }
}

type Step = (&'static str, fn() -> Result<End>);

const STEPS: [Step; 13] = [
    ("formatting", formatting),
    ("tidy", || tidy::run().map(End::of)),
    ("lints", lints),
    ("documentation", documentation),
    ("features", features),
    ("oldest compiler", oldest_compiler),
    ("wasm32", wasm),
    ("dependencies", dependencies),
    ("packages", packages),
    ("benches as tests", benches),
    ("kernels", || kernels::check().map(ended)),
    ("a short render", short_render),
    ("window", window),
];

/// Runs all steps, then the tests. Returns whether all passed.
pub(crate) fn run() -> Result<bool> {
    let mut report = vec![];
    let mut is_well = true;
    for (name, step) in STEPS {
        let (end, time) = timed(name, step);
        is_well &= !matches!(end, End::Failed(_));
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
            // The output of a step may be long gone where only the end of a log is kept.
            End::Failed(lines) => format!("FAILED\n{lines}").trim_end().to_owned(),
            End::Skipped(reason) => format!("skipped: {reason}"),
        };
        say(&format!("{name:<18}{:>7.1} s  {word}", time.as_secs_f64()));
    }
    say("");
    say(&count.unwrap_or_default().to_string());
    Ok(is_well)
}

/// Runs a step under its heading; a step that returns an error has failed.
fn timed(name: &str, step: impl FnOnce() -> Result<End>) -> (End, Duration) {
    say(&format!("\n== {name}"));
    let start = Instant::now();
    let end = step().unwrap_or_else(|error| {
        say(&format!("{error:#}"));
        End::Failed(format!("{error:#}"))
    });
    (end, start.elapsed())
}

/// Runs `cargo NAME`, or skips it where it is not installed.
fn if_installed(name: &str, command: &mut Command) -> Result<End> {
    if !has_cargo_command(name) {
        return Ok(End::Skipped(format!("cargo {name} is not installed")));
    }
    succeeds(command).map(End::of)
}

fn formatting() -> Result<End> {
    let mut end = End::Passed;
    for manifest in ["Cargo.toml", python::MANIFEST, browser::MANIFEST] {
        let mut check = cargo(&["fmt", "--manifest-path", manifest, "--all", "--check"]);
        end = both(end, || if_installed("fmt", &mut check).map(|end| end.at(manifest)))?;
    }
    Ok(end)
}

/// The end of two checks of one kind.
fn both(first: End, second: impl FnOnce() -> Result<End>) -> Result<End> {
    // A second check is made also after a failure, to report everything at once.
    let second = second()?;
    Ok(if matches!(first, End::Passed) { second } else { first })
}

fn lints() -> Result<End> {
    let workspace =
        if_installed("clippy", &mut cargo(&["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"]))?;
    both(workspace, || {
        if python::program().is_none() {
            say("skipped lints of the Python package: Python 3.9 or newer is not found");
            return Ok(End::Passed);
        }
        let mut command = cargo(&["clippy", "--manifest-path", python::MANIFEST, "--workspace", "--all-targets"]);
        if_installed("clippy", command.args(["--target-dir", "target/python/build", "--", "-D", "warnings"]))
    })
}

fn documentation() -> Result<End> {
    let mut command = cargo(&["doc", "--workspace", "--no-deps"]);
    succeeds(command.env("RUSTDOCFLAGS", "-D warnings")).map(End::of)
}

/// Checks every package that has features: without any where that is possible, and with each one alone.
fn features() -> Result<End> {
    let (check, flags): (_, &[_]) =
        if has_cargo_command("clippy") { ("clippy", &["--", "-D", "warnings"]) } else { ("check", &[]) };
    let mut failed = Vec::new();
    for (package, features) in command::packages_with_features()? {
        // Without `std` and `libm` there is no square root: every other feature is checked together with `std`.
        let needs_math = features.iter().any(|feature| feature == "libm");
        let none = (!needs_math).then_some("");
        // Windows of other systems and their toolkit take minutes; `cargo clippy -p canted-cli --features view` checks it.
        let features = features.iter().map(String::as_str).filter(|&feature| feature != "view");
        for feature in none.into_iter().chain(features) {
            let name = format!("{package}, {}", if feature.is_empty() { "no feature" } else { feature });
            say(&name);
            let root = if needs_math && feature != "libm" { "std," } else { "" };
            let features = format!("{root}{feature}");
            // Not its tests: what they depend on turns features on again.
            let args = [check, "--package", &package, "--no-default-features", "--features", &features];
            if !succeeds(cargo(&args).args(flags))? {
                failed.push(name);
            }
        }
    }
    Ok(if failed.is_empty() { End::Passed } else { End::Failed(failed.join("\n")) })
}

/// Checks the library with the oldest supported compiler, where it is installed.
fn oldest_compiler() -> Result<End> {
    let manifest = fs::read_to_string(command::root().join("Cargo.toml")).context("cannot read Cargo.toml")?;
    let version = command::value(&manifest, "workspace.package", "rust-version").context("no rust-version")?;
    let toolchains = command::output("rustup", &["toolchain", "list"]).unwrap_or_default();
    let Some(toolchain) = toolchains.split_whitespace().find(|name| name.starts_with(version)) else {
        return Ok(End::Skipped(format!("the Rust {version} toolchain is not installed")));
    };
    let mut command = Command::new("cargo");
    command.arg(format!("+{toolchain}")).args(["check", "--package", "canted", "--package", "canted-cli"]);
    // A cargo that runs this program pins its own toolchain for children.
    command.current_dir(command::root()).env_remove("RUSTUP_TOOLCHAIN").env_remove("CARGO");
    command.env("CARGO_TARGET_DIR", command::root().join("target/oldest"));
    succeeds(&mut command).map(End::of)
}

/// Checks the library and the device's crate for browsers, where the target is installed.
fn wasm() -> Result<End> {
    use browser::TARGET;
    if !browser::has_target()? {
        return Ok(End::Skipped(format!("the target {TARGET} is not installed")));
    }
    let library = ["check", "--package", "canted", "--no-default-features", "--target", TARGET];
    let device = ["check", "--package", "canted-gpu", "--target", TARGET];
    Ok(End::of(succeeds(&mut cargo(&library))? && succeeds(&mut cargo(&device))?))
}

/// Checks every package as `cargo publish` would upload it.
fn packages() -> Result<End> {
    Ok(match publish::dry_run()? {
        Outcome::Well => End::Passed,
        Outcome::Faulty(lines) => End::Failed(lines),
        Outcome::Undecided(reason) => End::Skipped(reason.to_owned()),
    })
}

/// Checks licenses, sources and duplicates. Advisories need a network and are skipped.
fn dependencies() -> Result<End> {
    if_installed("deny", &mut cargo(&["deny", "check", "licenses", "bans", "sources"]))
}

/// Runs each benchmark once, in the profile of the tests.
fn benches() -> Result<End> {
    succeeds(&mut cargo(&["test", "--workspace", "--bench", "obj"])).map(End::of)
}

/// Whether a driver makes of every kernel what is recorded, where the driver is installed.
fn ended(outcome: kernels::Outcome) -> End {
    match outcome {
        kernels::Outcome::Well => End::Passed,
        kernels::Outcome::Costlier(lines) => End::Failed(lines),
        kernels::Outcome::Undecided(reason) => End::Skipped(reason),
    }
}

/// Builds and tests the window of `canted view`, where that is requested.
fn window() -> Result<End> {
    match window::skipped() {
        Some(reason) => Ok(End::Skipped(reason)),
        None => window::run().map(End::of),
    }
}

/// Renders the built-in scene with the program that the tests run.
fn short_render() -> Result<End> {
    const SIZE: [u32; 2] = [160, 90];
    let folder = command::root().join("target/ci");
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let picture = folder.join("canted.png");
    // A picture from an earlier run would hide a failure.
    if picture.exists() {
        fs::remove_file(&picture).with_context(|| format!("cannot remove {}", picture.display()))?;
    }
    // A build of this program alone has other features: it would compile nearly everything once more.
    if !succeeds(&mut cargo(&["test", "--workspace", "--no-run"]))? {
        return Ok(End::of(false));
    }
    let mut render = Command::new(command::built("canted"));
    render.args(["render", "--spp", "1", "--size", &format!("{}x{}", SIZE[0], SIZE[1]), "--output"]).arg(&picture);
    if !succeeds(render.current_dir(command::root()))? {
        return Ok(End::of(false));
    }
    let (size, _) = looping::read(&picture)?;
    ensure!(size == SIZE, "{} has {} x {} pixels", picture.display(), size[0], size[1]);
    Ok(End::Passed)
}
