//! The program from its start to its first picture on disk.

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

/// Runs with each device.
const RUNS: usize = 3;

/// Arguments besides the device: the smallest picture that shows that everything started.
const PICTURE: [&str; 5] = ["render", "--size", "320x180", "--spp", "1"];

/// Measures the program in this program's folder and writes the section.
pub(super) fn section(out: &mut String, choice: &Choice) -> Result<()> {
    let arguments = PICTURE.join(" ");
    // Writing to a String cannot fail.
    let _ = writeln!(out, "\n### First picture\n");
    let program = sibling(&env::current_exe()?);
    if !program.exists() {
        let name = program.file_name().unwrap_or_default().display();
        let _ = writeln!(
            out,
            "Not measured: there is no `{name}` in this program's folder; `cargo build --release` builds it."
        );
        return Ok(());
    }
    let _ = writeln!(
        out,
        "`canted {arguments}` from start to end in wall time: it finds adapters, builds the built-in scene's BVH, lets the driver \
         compile and writes the picture. {RUNS} runs with each device in turn, in order, of the program built last.\n\n| `--device` \
         | seconds |\n| --- | --- |"
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
fn sibling(this: &Path) -> PathBuf {
    this.with_file_name("canted").with_extension(env::consts::EXE_EXTENSION)
}

/// Seconds of one run.
fn once(program: &Path, device: &str, picture: &Path) -> Result<f64> {
    let mut command = Command::new(program);
    command.args(PICTURE).args(["--device", device, "-o"]).arg(picture).stdin(Stdio::null());
    let start = Instant::now();
    let output = command.output().with_context(|| format!("cannot start {}", program.display()))?;
    let seconds = start.elapsed().as_secs_f64();
    let text = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "{} --device {device}: {}", program.display(), text.trim());
    Ok(seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_is_in_the_same_folder() {
        let this = Path::new("some").join("folder").join("canted-bench").with_extension(env::consts::EXE_EXTENSION);
        let found = sibling(&this);
        assert_eq!(found.parent(), this.parent());
        assert_eq!(found.file_stem(), Some("canted".as_ref()));
        assert_eq!(found.extension(), this.extension());
    }

    #[test]
    fn missing_and_failing_programs_are_reported() {
        let picture = Path::new("never.png");
        let error = once(Path::new("no/such/program"), "cpu", picture).unwrap_err().to_string();
        assert!(error.contains("no/such/program"), "{error}");
        // This test's own program does not support these options.
        let error = once(&env::current_exe().unwrap(), "cpu", picture).unwrap_err().to_string();
        assert!(error.contains("--device cpu"), "{error}");
    }
}
