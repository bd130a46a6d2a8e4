//! Geometry that changes every frame: refits, rebuilds and moved instances, compared with peers in turn.
//!
//! ```text
//! mesh, its vertices at two times -> BVHs -> refit or rebuild, all in turn -> tables
//! ```

mod sequences;
mod updates;

use std::fmt::Write;

use anyhow::Result;

use crate::{
    options::Options,
    timing::{self, Seconds, median, spread},
};

/// Something that is updated for every frame.
struct Updated<'a> {
    name: String,
    /// Updates for the frame of this number.
    update: Box<dyn FnMut(usize) -> Result<()> + Send + 'a>,
    took: Vec<Seconds>,
}

impl<'a> Updated<'a> {
    fn new(name: impl Into<String>, update: impl FnMut(usize) -> Result<()> + Send + 'a) -> Self {
        Self { name: name.into(), update: Box::new(update), took: vec![] }
    }
}

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let _ = writeln!(
        out,
        "\n## Motion\n\nGeometry moves every frame; everything is updated in turn, {} frames after a warm-up. Milliseconds: median wall time \
         (half spread), and processor time of all threads, which other processes do not affect.",
        options.rounds
    );
    updates::refits(out, options)?;
    updates::builds(out, options)?;
    updates::instances(out, options)?;
    sequences::policies(out, options)?;
    sequences::pictures(out, options)
}

/// Updates all for each frame, in turn; the first frame warms up.
fn run(all: &mut [Updated<'_>], rounds: usize, pool: &rayon::ThreadPool) -> Result<()> {
    for frame in 0..=rounds {
        for one in &mut *all {
            // Threads of peers are outside of the pool.
            let (done, took) = timing::time_all(|| pool.install(|| (one.update)(frame)));
            done?;
            if frame > 0 {
                one.took.push(took);
            }
        }
    }
    Ok(())
}

/// A row: the name, times, and how many times as long as `reference` it takes in processor time and wall time.
fn row(out: &mut String, scene: &str, one: &Updated<'_>, reference: Option<&Updated<'_>>) {
    let of = |seconds: fn(&Seconds) -> f64, one: &Updated<'_>| one.took.iter().map(seconds).collect::<Vec<f64>>();
    let (wall, cpu) = (of(|s| 1e3 * s.wall, one), of(|s| 1e3 * s.cpu, one));
    let relative = reference.map_or_else(String::new, |reference| {
        let [of_wall, of_cpu] = [(|s: &Seconds| 1e3 * s.wall) as fn(&Seconds) -> f64, |s| 1e3 * s.cpu]
            .map(|seconds| median(&of(seconds, one)) / median(&of(seconds, reference)));
        format!("{of_wall:.2} / {of_cpu:.2}")
    });
    let _ = writeln!(
        out,
        "| {scene} | {} | {:.2} (±{:.0} %) | {:.2} | {relative} |",
        one.name,
        median(&wall),
        100.0 * spread(&wall),
        median(&cpu)
    );
}
