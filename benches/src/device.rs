//! Everything that a device does, on the device that `--device` names: build, sort, rays, pictures, also beside the CPU.

mod both;
mod built;
mod first;
mod handed;
mod picture;
mod rays;
mod sorted;

use std::fmt::Write;

use anyhow::Result;
use canted_gpu::{AdapterKind, Choice, Gpu};

use crate::options::Options;

/// How much is measured: software drivers get small inputs, which show that everything works.
struct Scale {
    /// Scenes to build.
    built: &'static [&'static str],
    /// Logarithms of the numbers of keys to sort.
    sorted: &'static [u32],
    /// Pixels along a view's side.
    resolution: u32,
    /// Width and height of the picture, and samples of a pixel.
    picture: [u32; 3],
    /// The same of the one that the CPU shares.
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

/// A device, and how much of it is measured.
struct Bench {
    gpu: Gpu,
    scale: &'static Scale,
    /// Runs of which the least counts.
    rounds: usize,
}

/// Measures the device and writes a section with its name.
pub(crate) fn section(out: &mut String, choice: &Choice, options: &Options) -> Result<()> {
    let gpu = Gpu::open(choice)?;
    let facts = gpu.info();
    let is_software = facts.kind == AdapterKind::Software;
    let clock = if gpu.has_timestamps() { "the device's timestamps" } else { "the clock on the wall" };
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n## On {}\n\nA {} adapter, {}, {}. Times of passes by {clock}, least of {} runs after one in which the driver compiles.",
        facts.name, facts.kind, facts.backend, facts.driver, options.rounds
    );
    if is_software {
        out.push_str(
            "A software driver computes on the CPU: what stands here shows that everything runs, on small inputs. Numbers of \
             hardware are owed; the same command measures it.\n",
        );
    }
    let scale = if is_software || options.is_quick { &SMALL } else { &FULL };
    let bench = Bench { gpu, scale, rounds: options.rounds };
    built::section(out, &bench)?;
    sorted::section(out, &bench)?;
    handed::section(out, &bench)?;
    rays::section(out, &bench)?;
    rays::walks(out, &bench)?;
    picture::section(out, &bench)?;
    both::section(out, &bench)?;
    first::section(out, choice)
}
