//! Benchmarks of the device that `--device` names: build, sort, rays, pictures, also compared with the CPU.

mod builds;
mod clock;
mod pictures;
mod rays;

use std::fmt::Write as _;
use std::io::Write as _;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use canted_gpu::{AdapterKind, Choice, Gpu, block_on};

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

/// Least runs on hardware, whose clocks vary.
const HARDWARE_ROUNDS: usize = 10;

/// Work before each figure: idle devices take tens of milliseconds to reach their clock.
const WARM: Duration = Duration::from_millis(250);

/// A device and its input sizes.
struct Bench {
    gpu: Gpu,
    scale: &'static Scale,
    /// Number of runs.
    rounds: usize,
}

impl Bench {
    /// Whether the device computes on the CPU.
    fn is_software(&self) -> bool {
        self.gpu.info().kind == AdapterKind::Software
    }

    /// Repeats `run` until it has run once, and on hardware for as long as clocks take to rise.
    fn warm<T>(&self, mut run: impl FnMut() -> Result<T>) -> Result<()> {
        let start = Instant::now();
        loop {
            run()?;
            if self.is_software() || start.elapsed() >= WARM {
                return Ok(());
            }
        }
    }
}

/// A part of the section.
type Chapter = (&'static str, fn(&mut String, &Bench) -> Result<()>);

/// The chapters, by the names of `--chapters`.
const CHAPTERS: [Chapter; 10] = [
    ("rays", rays::section),
    ("levels", rays::levels),
    ("picture", pictures::sponza_picture),
    ("streams", pictures::streams),
    ("build", builds::builds),
    ("sort", builds::sort),
    ("frames", builds::frames),
    ("hits", rays::structures),
    ("both", pictures::both),
    ("pixels", pictures::differing),
];

/// Measures the device and prints a section with its name, chapter by chapter.
pub(crate) fn section(choice: &Choice, options: &Options) -> Result<()> {
    let known = CHAPTERS.map(|(name, _)| name);
    if let Some(unknown) = options.chapters.iter().find(|name| !known.contains(&name.as_str())) {
        bail!("there is no chapter '{unknown}'; use {}", known.join(", "));
    }
    let gpu = block_on(Gpu::open(choice))?;
    let facts = gpu.info();
    let is_software = facts.kind == AdapterKind::Software;
    let rounds = if is_software { options.rounds.min(SOFTWARE_ROUNDS) } else { options.rounds.max(HARDWARE_ROUNDS) };
    let clock = if gpu.has_timestamps() { "device timestamps" } else { "wall clock" };
    let mut out = format!(
        "\n## On {}\n\nA {} adapter, {}, {}. Pass times by {clock}, {rounds} runs after {} ms or more of the same work, in which the driver \
         compiles and clocks rise.\n",
        facts.name,
        facts.kind,
        facts.backend,
        facts.driver,
        if is_software { 0 } else { WARM.as_millis() }
    );
    if is_software {
        out.push_str(
            "A software driver computes on the CPU: this section only shows that everything runs, on small inputs. The same command \
             measures hardware.\n",
        );
    }
    let scale = if is_software || options.is_quick { &SMALL } else { &FULL };
    let bench = Bench { gpu, scale, rounds };
    let mut seconds: Vec<String> = vec![];
    let all = Instant::now();
    for (name, write) in CHAPTERS {
        if !options.chapters.is_empty() && !options.chapters.iter().any(|wanted| wanted == name) {
            continue;
        }
        let start = Instant::now();
        let (done, clock) = clock::during(&bench.gpu.info().name, || write(&mut out, &bench));
        done?;
        let _ = writeln!(out, "\n{}", clock::sentence(clock));
        seconds.push(format!("{name} {:.0}", start.elapsed().as_secs_f64()));
        // A run that is ended early has printed what it measured.
        std::io::stdout().write_all(options.titled(&std::mem::take(&mut out)).as_bytes())?;
    }
    let all = all.elapsed().as_secs_f64();
    writeln!(std::io::stdout(), "\nSeconds of this section: {all:.0}; {}.", seconds.join(", "))?;
    Ok(())
}
