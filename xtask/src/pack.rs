//! `cargo xtask pack-device`: a folder that measures and tests a GPU on a machine without Rust and without a network.
//!
//! It has the benchmarks, the program, the tests that need a device, models, and one script, which writes what it finds to `results`. A GPU is often
//! lent for minutes, on a machine that has nothing but a driver.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail, ensure};
use serde::Deserialize;

use crate::command::{self, cargo, say, succeeds};

/// Tests that need a device, by the names of their programs.
const TESTS: [&str; 5] = ["twins_trace", "twins_build", "twins_render", "device", "gpu"];

/// Folders and files of the models that they read.
const MODELS: [&str; 8] = [
    "sponza",
    "kitchen",
    "instanced",
    "stanford/bunny.ply",
    "stanford/dragon_871k.glb",
    "truss/eiffel.glb",
    "gltf/Fox.glb",
    "gltf/CesiumMan.glb",
];

/// Most bytes of the folder.
const MOST: u64 = 50_000_000;

/// What runs there. Every line is for any POSIX shell.
const SCRIPT: &str = r#"#!/bin/sh
# Measures and tests a GPU. Writes to the folder results beside this script. Chapters take at most seven minutes, tests seven and a half.
# Needs a Vulkan driver and loader, tar and xz. VK_DRIVER_FILES names the driver where the loader does not find it.
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d) || exit 2
trap 'rm -rf "$work"' EXIT
mkdir -p "$here/results"
tar xJf "$here/programs.tar.xz" -C "$work" || exit 2
if [ -f "$here/models.tar.xz" ]; then tar xJf "$here/models.tar.xz" -C "$work" || exit 2; fi
cd "$work" || exit 2
export CANTED_SCENES="$work/models" CANTED_REQUIRE_DEVICE=1 NODEVICE_SELECT=1
: "${XDG_RUNTIME_DIR:=$work}"
export XDG_RUNTIME_DIR
limited() { seconds=$1; shift; if command -v timeout >/dev/null; then timeout "$seconds" "$@"; else "$@"; fi; }
clock() { if command -v nvidia-smi >/dev/null; then nvidia-smi --query-gpu=name,driver_version,clocks.sm --format=csv,noheader; fi; }
{
  ./canted devices
  for chapter in rays levels picture streams build sort frames; do
    clock
    limited 60 ./canted-bench --device gpu --rounds 10 --chapters "$chapter"
  done
} 2>&1 | tee "$here/results/bench.txt"
{
  for test in tests/*; do
    echo "== $test"
    limited 90 "$test" 2>&1
  done
} | tee "$here/results/tests.txt" | grep -E '^==|FAILED|panicked|test result'
"#;

/// Builds everything and writes the folder.
pub(crate) fn run(folder: &Path) -> Result<bool> {
    let folder = &command::root().join(folder);
    let staged = folder.join("staged");
    let made = fs::create_dir_all(staged.join("tests"));
    made.with_context(|| format!("cannot make {}", staged.display()))?;
    let programs = ["--package", "canted-cli", "--package", "canted-benches"];
    if !succeeds(cargo(&["build", "--release"]).args(programs))? {
        return Ok(false);
    }
    let release = command::target().join("release");
    for program in ["canted", "canted-bench"] {
        copy(&release.join(program), &staged.join(program))?;
    }
    for (name, program) in tests()? {
        copy(&program, &staged.join("tests").join(name))?;
    }
    // What tests read: the example of motion.
    let examples = staged.join("examples");
    fs::create_dir_all(examples.join("models")).with_context(|| format!("cannot make {}", examples.display()))?;
    for name in ["motion.toml", "models/plane.obj", "models/cube.obj", "models/sphere.obj"] {
        let from = command::root().join("examples").join(name);
        fs::copy(&from, examples.join(name)).with_context(|| format!("cannot copy {}", from.display()))?;
    }
    archive(&staged, &folder.join("programs.tar.xz"), &["canted", "canted-bench", "examples", "tests"])?;
    fs::remove_dir_all(&staged).with_context(|| format!("cannot remove {}", staged.display()))?;
    let models = command::models();
    let there: Vec<&str> = MODELS.into_iter().filter(|model| models.join(model).exists()).collect();
    let packed = folder.join("models.tar.xz");
    if there.is_empty() {
        say(&format!("skipped models: no folder {} (set CANTED_SCENES)", models.display()));
    } else {
        archive(&models, &packed, &there)?;
    }
    let script = folder.join("run.sh");
    fs::write(&script, SCRIPT).with_context(|| format!("cannot write {}", script.display()))?;
    let n_bytes = size(&folder.join("programs.tar.xz"))? + if there.is_empty() { 0 } else { size(&packed)? };
    say(&format!("{}: {:.0} MB; run it with `sh run.sh`", folder.display(), n_bytes as f64 * 1e-6));
    ensure!(n_bytes <= MOST, "{} has {n_bytes} bytes, more than {MOST}", folder.display());
    Ok(true)
}

fn size(path: &Path) -> Result<u64> {
    Ok(fs::metadata(path).with_context(|| format!("cannot read {}", path.display()))?.len())
}

/// Copies a program, without the names of its functions where `strip` is installed.
fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::copy(from, to).with_context(|| format!("cannot copy {} to {}", from.display(), to.display()))?;
    // Without it the folder is only larger.
    let _ = command::succeeds_silently(Command::new("strip").arg(to));
    Ok(())
}

/// Packs some of the contents of a folder; models lie below `models`.
fn archive(from: &Path, to: &Path, names: &[&str]) -> Result<()> {
    let mut tar = Command::new("tar");
    tar.arg("-cJf").arg(to).arg("-C").arg(from);
    if to.ends_with("models.tar.xz") {
        tar.arg("--transform=s,^,models/,");
    }
    ensure!(succeeds(tar.args(names))?, "tar cannot write {}: it needs GNU tar and xz", to.display());
    Ok(())
}

/// What cargo says of a program that it built.
#[derive(Deserialize)]
struct Built {
    target: Option<Target>,
    executable: Option<PathBuf>,
}

#[derive(Deserialize)]
struct Target {
    name: String,
}

/// Builds the tests. Returns their names and programs.
fn tests() -> Result<Vec<(String, PathBuf)>> {
    let mut build = cargo(&["test", "--workspace", "--no-run", "--message-format=json"]);
    for name in TESTS {
        build.args(["--test", name]);
    }
    let mut found = vec![];
    let is_well = command::for_each_line(&mut build, |line| {
        if let Ok(Built { target: Some(Target { name }), executable: Some(program) }) = serde_json::from_str(line) {
            found.push((name, program));
        }
    })?;
    ensure!(is_well, "the tests do not compile");
    found.retain(|(name, _)| TESTS.contains(&name.as_str()));
    if let Some(missing) = TESTS.into_iter().find(|name| !found.iter().any(|(known, _)| known == name)) {
        bail!("cargo built no test '{missing}'");
    }
    // Several packages have tests of one name.
    for i in 0..found.len() {
        let n_before =
            found[..i].iter().filter(|(name, _)| name.split('-').next() == found[i].0.split('-').next()).count();
        if n_before > 0 {
            found[i].0 = format!("{}-{n_before}", found[i].0);
        }
    }
    Ok(found)
}
