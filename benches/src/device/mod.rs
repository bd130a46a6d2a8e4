//! Benchmarks of the device that `--device` names: build, sort, rays, pictures, also compared with the CPU.

mod builds;
mod pictures;
mod rays;

use std::fmt::Write as _;
use std::io::Write as _;
use std::time::Instant;

use anyhow::Result;
use canted_gpu::{AdapterKind, Choice, Gpu};

use crate::options::Options;

/// Input sizes: software drivers get small inputs, which only show that everything works.
struct Scale {
    /// Scenes to build.
    built: &'static [&'static str],
    /// Logarithms of the numbers of keys to sort.
    sorted: &'static [u32],
    /// Pixels along a view's side.
    resolution: u32,
    /// Width and height of the picture, and samples of a pixel.
    picture: [u32; 3],
    /// The same for the picture that the CPU and the device render together.
    shared: [u32; 3],
}

const SMALL: Scale =
    Scale { built: &["bunny", "sponza"], sorted: &[18], resolution: 64, picture: [320, 180, 1], shared: [320, 180, 2] };

const FULL: Scale = Scale {
    built: &["bunny", "sponza", "dragon_871k", "country_kitchen"],
    sorted: &[20, 24],
    resolution: 1024,
    picture: [1920, 1080, 24],
    shared: [1920, 1080, 16],
};

/// Most runs on software drivers: five take a quarter of an hour on llvmpipe.
const SOFTWARE_ROUNDS: usize = 2;

/// A device and its input sizes.
struct Bench {
    gpu: Gpu,
    scale: &'static Scale,
    /// Number of runs; the minimum counts.
    rounds: usize,
}

impl Bench {
    /// Whether the device computes on the CPU.
    fn is_software(&self) -> bool {
        self.gpu.info().kind == AdapterKind::Software
    }
}

/// Measures the device and writes a section with its name.
pub(crate) fn section(out: &mut String, choice: &Choice, options: &Options) -> Result<()> {
    let gpu = Gpu::open(choice)?;
    let facts = gpu.info();
    let is_software = facts.kind == AdapterKind::Software;
    let rounds = if is_software { options.rounds.min(SOFTWARE_ROUNDS) } else { options.rounds };
    let clock = if gpu.has_timestamps() { "device timestamps" } else { "wall clock" };
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n## On {}\n\nA {} adapter, {}, {}. Pass times by {clock}, minimum of {} runs after a first one in which the driver compiles.",
        facts.name, facts.kind, facts.backend, facts.driver, rounds
    );
    if is_software {
        out.push_str(
            "A software driver computes on the CPU: this section only shows that everything runs, on small inputs. Hardware is not \
             measured yet; the same command measures it.\n",
        );
    }
    let scale = if is_software || options.is_quick { &SMALL } else { &FULL };
    let bench = Bench { gpu, scale, rounds };
    let mut chapters = Chapters { out, seconds: vec![] };
    chapters.add("build", |out| builds::builds(out, &bench))?;
    chapters.add("sort", |out| builds::sort(out, &bench))?;
    chapters.add("frames", |out| builds::frames(out, &bench))?;
    chapters.add("mesh to hits", |out| rays::structures(out, &bench))?;
    chapters.add("rays", |out| rays::section(out, &bench))?;
    chapters.add("picture", |out| pictures::sponza_picture(out, &bench))?;
    chapters.add("CPU and device", |out| pictures::both(out, &bench))?;
    chapters.add("pixels that differ", |out| pictures::differing(out, &bench))?;
    chapters.finish();
    Ok(())
}

/// Writes the chapters, and notes how long each takes.
struct Chapters<'a> {
    out: &'a mut String,
    seconds: Vec<(&'static str, f64)>,
}

impl Chapters<'_> {
    fn add(&mut self, name: &'static str, write: impl FnOnce(&mut String) -> Result<()>) -> Result<()> {
        let start = Instant::now();
        write(self.out)?;
        let seconds = start.elapsed().as_secs_f64();
        // A failed progress message does not stop the run.
        let _ = writeln!(std::io::stderr(), "{name}: {seconds:.1} s");
        self.seconds.push((name, seconds));
        Ok(())
    }

    fn finish(self) {
        let all: f64 = self.seconds.iter().map(|(_, seconds)| seconds).sum();
        let each: Vec<String> = self.seconds.iter().map(|(name, seconds)| format!("{name} {seconds:.0}")).collect();
        let _ = writeln!(self.out, "\nSeconds of this section: {all:.0}; {}.", each.join(", "));
    }
}
