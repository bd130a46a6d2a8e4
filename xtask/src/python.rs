//! The Python packages: `cargo xtask wheel`, their tests as a part of `cargo xtask test`, and their measurements, `cargo xtask python`.
//!
//! Everything is installed into a virtual environment under `target/python`. Where there is no Python 3.9 or newer, or no package
//! registry, the tests are skipped with that reason.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail, ensure};

use crate::{
    bench::KEEP,
    command::{self, Count, cargo, files_with, say, succeeds, succeeds_silently},
};

/// The manifest of the package, which is no member of the workspace.
pub(crate) const MANIFEST: &str = "crates/python/Cargo.toml";

/// The manifests of all packages: the queries, and the renderer.
const PACKAGES: [&str; 2] = [MANIFEST, "crates/python/render/Cargo.toml"];

/// What `cargo xtask python` writes.
const RECORD: &str = "benches/PYTHON.md";

/// Where programs of Python are looked for, and what they must answer.
const PROGRAMS: [&str; 3] = ["python3", "python", "py"];
const IS_RECENT: &str = "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 9))";

/// What the tests need, peers whose answers some tests record, and what starts workers by Slurm.
const NEEDED: [&str; 6] = ["pytest", "numpy", "trimesh", "dask", "distributed", "fsspec"];
const PEERS: [&str; 3] = ["embreex", "rtree", "dask-jobqueue"];

/// Peers that are measured only: large downloads.
const MEASURED: [&str; 1] = ["open3d"];

/// Tests need no link time optimization, which takes minutes.
const QUICK: [(&str, &str); 2] = [("CARGO_PROFILE_RELEASE_LTO", "off"), ("CARGO_PROFILE_RELEASE_CODEGEN_UNITS", "16")];

/// Builds the wheels into `target/wheels`.
pub(crate) fn wheel() -> Result<bool> {
    let Some(python) = program() else { bail!("Python 3.9 or newer is not found") };
    let environment = Environment::new(python)?;
    if !environment.pip(&["maturin"])? {
        bail!("maturin cannot be installed from the package registry");
    }
    let Some(wheels) = environment.build(&[])? else { return Ok(false) };
    for wheel in wheels {
        say(&format!("wrote {} ({} KiB)", wheel.display(), kib(&wheel)?));
    }
    Ok(true)
}

/// The size of a file in KiB.
fn kib(path: &Path) -> Result<u64> {
    Ok(fs::metadata(path).with_context(|| format!("cannot read {}", path.display()))?.len().div_ceil(1024))
}

/// Measures the package and its peers, and with `--keep` writes [`RECORD`]. `args`: the number of rays and of rounds.
pub(crate) fn measure(args: &[&str]) -> Result<bool> {
    let environment = match Environment::ready(PEERS.iter().chain(&MEASURED))? {
        Ok(environment) => environment,
        Err(reason) => bail!("{reason}"),
    };
    let Some(wheels) = environment.build(&[])? else { return Ok(false) };
    environment.install(&wheels)?;
    let mut script = environment.command(&["crates/python/examples/table.py"]);
    let keeps = args.contains(&KEEP);
    let args: Vec<&str> = args.iter().copied().filter(|&arg| arg != KEEP).collect();
    let numbers: &[&str] = if args.is_empty() { &["1000000", "5"] } else { &args };
    script.env("CANTED_RATE", rate()?).arg(command::models().join("stanford/bunny.ply")).args(numbers);
    let mut text = String::new();
    let is_well = command::for_each_line(&mut script, |line| {
        say(line);
        text += line;
        text.push('\n');
    })?;
    if !is_well {
        return Ok(false);
    }
    for wheel in &wheels {
        let package = wheel.file_name().unwrap_or_default().to_string_lossy();
        text += &format!("\nWheel of {}: {} KiB.\n", package.split('-').next().unwrap_or_default(), kib(wheel)?);
    }
    if keeps {
        command::write(RECORD, &text)?;
    }
    Ok(true)
}

/// Builds the program that measures the same call in Rust, with the link time optimization of the wheel; its path.
fn rate() -> Result<PathBuf> {
    let folder = command::root().join("target");
    let mut command = cargo(&["build", "--release", "--package", "canted", "--example", "bindings", "--target-dir"]);
    if !succeeds(command.arg(&folder).env("CARGO_PROFILE_RELEASE_LTO", "thin"))? {
        bail!("the example bindings does not build");
    }
    Ok(folder.join("release/examples").join(format!("bindings{}", std::env::consts::EXE_SUFFIX)))
}

/// Builds and installs the package, runs its tests and adds them to `count`. Returns whether none failed.
pub(crate) fn test(count: &mut Count) -> Result<bool> {
    let environment = match Environment::ready(&PEERS)? {
        Ok(environment) => environment,
        Err(reason) => {
            say(&format!("skipped the tests of the Python package: {reason}"));
            return Ok(true);
        }
    };
    let Some(wheels) = environment.build(&QUICK)? else {
        say("a Python package does not build: counted as one failure");
        count.failed += 1;
        return Ok(false);
    };
    environment.install(&wheels)?;
    let mut pytest = environment.command(&["-m", "pytest", "-q", "-rs", "-p", "no:cacheprovider"]);
    pytest.current_dir(command::root().join("crates/python"));
    let mut last = String::new();
    let is_well = command::for_each_line(&mut pytest, |line| {
        say(line);
        line.clone_into(&mut last);
    })?;
    let [passed, failed, skipped] = summary(&last);
    count.passed += passed;
    count.skipped += skipped;
    // Without a summary, pytest itself has failed.
    count.failed += if is_well { failed } else { failed.max(1) };
    Ok(is_well)
}

/// Numbers of passed, failed and skipped tests in the last line of pytest, such as `2 failed, 30 passed, 1 error in 45.83s`.
fn summary(line: &str) -> [usize; 3] {
    let of = |word: &str| -> usize {
        let parts = line.trim_matches(['=', ' ']).split(" in ").next().unwrap_or_default().split(", ");
        let numbers = parts.filter_map(|part| part.split_once(' '));
        numbers.filter(|(_, name)| name.starts_with(word)).filter_map(|(n, _)| n.parse::<usize>().ok()).sum()
    };
    [of("passed"), of("failed") + of("error"), of("skipped")]
}

/// The first program that is Python 3.9 or newer with virtual environments.
pub(crate) fn program() -> Option<&'static str> {
    PROGRAMS.into_iter().find(|program| succeeds_silently(&mut command::program(*program, &["-c", IS_RECENT])))
}

/// A virtual environment.
struct Environment {
    folder: PathBuf,
}

impl Environment {
    /// Makes it, or takes that of an earlier run.
    fn new(python: &str) -> Result<Self> {
        let environment = Self { folder: command::root().join("target/python/venv") };
        if !environment.program().is_file()
            && !succeeds(command::program(python, &["-m", "venv"]).arg(&environment.folder))?
        {
            bail!("{python} cannot make the virtual environment {}", environment.folder.display());
        }
        Ok(environment)
    }

    /// With everything that tests and peers need, or the reason why there is none.
    fn ready<'a>(peers: impl IntoIterator<Item = &'a &'static str>) -> Result<Result<Self, &'static str>> {
        let Some(python) = program() else { return Ok(Err("Python 3.9 or newer is not found")) };
        let environment = Self::new(python)?;
        if !environment.pip(&["maturin"])? || !environment.pip(&NEEDED)? {
            return Ok(Err("the package registry cannot be reached"));
        }
        for peer in peers {
            // Wheels only: a peer is not worth a compiler.
            if !environment.pip(&["--only-binary", ":all:", peer])? {
                say(&format!("skipped comparisons with {peer}: it cannot be installed"));
            }
        }
        Ok(Ok(environment))
    }

    fn program(&self) -> PathBuf {
        self.folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" })
    }

    /// Its Python with these arguments, in the root of the workspace.
    fn command(&self, args: &[&str]) -> Command {
        command::program(self.program(), args)
    }

    /// Installs packages; whether that succeeded.
    fn pip(&self, packages: &[&str]) -> Result<bool> {
        let mut command = self.command(&["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
        succeeds(command.args(packages))
    }

    /// Installs wheels.
    fn install(&self, wheels: &[PathBuf]) -> Result<()> {
        for wheel in wheels {
            if !self.pip(&["--no-deps", "--force-reinstall", &wheel.to_string_lossy()])? {
                bail!("{} cannot be installed", wheel.display());
            }
        }
        Ok(())
    }

    /// Builds the wheels; their paths, or `None` where one does not build. `variables` are added to the environment of cargo.
    fn build(&self, variables: &[(&str, &str)]) -> Result<Option<Vec<PathBuf>>> {
        let wheels = command::root().join("target/wheels");
        if wheels.is_dir() {
            // Only these wheels are there afterwards, whatever their version.
            fs::remove_dir_all(&wheels).with_context(|| format!("cannot remove {}", wheels.display()))?;
        }
        for manifest in PACKAGES {
            let args = ["-m", "maturin", "build", "--release", "--quiet", "--manifest-path", manifest, "--out"];
            let mut command = self.command(&args);
            command.arg(&wheels).env("CARGO_TARGET_DIR", command::root().join("target/python/build"));
            command.envs(variables.iter().copied());
            if !succeeds(&mut command)? {
                return Ok(None);
            }
        }
        let built = files_with(&wheels, "whl");
        ensure!(built.len() == PACKAGES.len(), "there are {} wheels in {}", built.len(), wheels.display());
        Ok(Some(built))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summaries_of_pytest_are_read() {
        assert_eq!(summary("143 passed, 4 warnings in 39.11s"), [143, 0, 0]);
        assert_eq!(
            summary("===== 2 failed, 30 passed, 3 skipped, 1 warning, 1 error in 45.83s (0:00:45) ====="),
            [30, 3, 3]
        );
        assert_eq!(summary("2 passed, 2 errors in 1.0s"), [2, 2, 0]);
        assert_eq!(summary("ImportError while loading conftest"), [0, 0, 0]);
    }
}
