//! The program itself, from its start to its first picture on the disc.

use std::{
    env,
    fmt::Write,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::Instant,
};

use anyhow::{Context, Result, ensure};
use canted_gpu::Choice;

/// Runs by each.
const RUNS: usize = 3;

/// What it is asked for beside the device: as little as shows that everything started.
const PICTURE: [&str; 5] = ["render", "--size", "320x180", "--spp", "1"];

/// Measures the program that lies beside this one and writes the section.
pub(super) fn section(out: &mut String, choice: &Choice) -> Result<()> {
    let asked = PICTURE.join(" ");
    // Writing to a String cannot fail.
    let _ = writeln!(out, "\n### First picture\n");
    let program = beside(&env::current_exe()?);
    if !program.exists() {
        let name = program.file_name().unwrap_or_default().display();
        let _ = writeln!(out, "Not measured: no `{name}` lies beside this program; `cargo build --release` makes it.");
        return Ok(());
    }
    let _ = writeln!(
        out,
        "`canted {asked}` from its start to its end by the clock on the wall: adapters are looked for, the built-in scene's tree is built, \
         the driver compiles, the picture is written. {RUNS} runs by each in turn, in their order; the program is the one that was \
         built last.\n\n| `--device` | seconds |\n| --- | --- |"
    );
    let picture = env::temp_dir().join(format!("canted-bench-{}.png", std::process::id()));
    let devices = [choice.to_string(), "cpu".to_owned()];
    let mut seconds = [[0.0; RUNS]; 2];
    for run in 0..RUNS {
        for (device, seconds) in devices.iter().zip(&mut seconds) {
            seconds[run] = once(&program, device, &picture)?;
        }
    }
    fs::remove_file(&picture).with_context(|| format!("cannot remove {}", picture.display()))?;
    for (device, seconds) in devices.iter().zip(seconds) {
        let _ = writeln!(out, "| {device} | {} |", seconds.map(|s| format!("{s:.2}")).join(", "));
    }
    Ok(())
}

/// The program in the folder of this one.
fn beside(this: &Path) -> PathBuf {
    this.with_file_name("canted").with_extension(env::consts::EXE_EXTENSION)
}

/// Seconds of one run.
fn once(program: &Path, device: &str, picture: &Path) -> Result<f64> {
    let mut command = Command::new(program);
    command.args(PICTURE).args(["--device", device, "-o"]).arg(picture).stdin(Stdio::null());
    let start = Instant::now();
    let output = command.output().with_context(|| format!("cannot start {}", program.display()))?;
    let seconds = start.elapsed().as_secs_f64();
    let said = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "{} --device {device}: {}", program.display(), said.trim());
    Ok(seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_lies_beside_this_one() {
        let this = Path::new("some").join("folder").join("canted-bench").with_extension(env::consts::EXE_EXTENSION);
        let found = beside(&this);
        assert_eq!(found.parent(), this.parent());
        assert_eq!(found.file_stem(), Some("canted".as_ref()));
        assert_eq!(found.extension(), this.extension());
    }

    #[test]
    fn a_program_that_is_not_there_and_one_that_fails_are_told() {
        let picture = Path::new("never.png");
        let error = once(Path::new("no/such/program"), "cpu", picture).unwrap_err().to_string();
        assert!(error.contains("no/such/program"), "{error}");
        // This test's own program knows no such options.
        let error = once(&env::current_exe().unwrap(), "cpu", picture).unwrap_err().to_string();
        assert!(error.contains("--device cpu"), "{error}");
    }
}
