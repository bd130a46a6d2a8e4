//! Sequences under each `--update` policy: updates and rays together.

mod sequences;

use std::{fmt::Write, time::Duration};

use anyhow::{Result, ensure};
use canted_fixtures::{Rotation, View};
use canted_renderer::{Prepared, StructureConfig, Tracer, UpdateOptions, UpdatePolicy, Updates, prepare};
use canted_trace::{Hit, Ray, Watertight};

use crate::{clock, interleave::median, options::Options, rays};
pub(super) use sequences::FPS;
use sequences::Sequence;

const POLICIES: [(&str, UpdatePolicy); 3] =
    [("auto", UpdatePolicy::Auto), ("refit", UpdatePolicy::Refit), ("rebuild", UpdatePolicy::Rebuild)];

/// Widths of the square pictures: a preview, and a picture of several samples.
const WIDTHS: [u32; 2] = [96, 384];

/// The measurements of one policy over a sequence.
#[derive(Clone, Default)]
struct Took {
    /// Seconds of updates and of rays, of each round.
    seconds: Vec<[f64; 2]>,
    updates: Updates,
}

impl Took {
    /// Milliseconds of a frame: updates, rays, both; medians over the rounds.
    fn ms(&self, n_frames: usize) -> [f64; 3] {
        #[expect(clippy::cast_precision_loss, reason = "few frames")]
        let scale = 1e3 / n_frames as f64;
        let of = |pick: fn(&[f64; 2]) -> f64| scale * median(&self.seconds.iter().map(pick).collect::<Vec<_>>());
        [of(|s| s[0]), of(|s| s[1]), of(|s| s[0] + s[1])]
    }
}

/// Measures and writes the table.
pub(super) fn table(out: &mut String, options: &Options) -> Result<()> {
    let (n_frames, rounds) = if options.is_quick { (12, 2) } else { (48, options.rounds.min(3)) };
    let (sequences, missing) = sequences::all(n_frames, options.is_quick)?;
    let _ = writeln!(
        out,
        "\n### Update policies\n\nSequences of {n_frames} frames, the first one built alike by all; one thread, all policies in turn in each frame, medians of \
         {rounds} rounds. Milliseconds of processor time of this thread for a frame: its update / its camera rays. `auto over best` compares with the better one \
         of `refit` and `rebuild`, update and rays together.\n\n| sequence and rays | auto | refit | rebuild | auto over best | refits of auto | rebuilds of auto | \
         drift of refit |\n| --- | --- | --- | --- | --- | --- | --- | --- |",
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut worst = (0.0, String::new());
    for sequence in &sequences {
        for width in WIDTHS {
            let name = format!("{}, {} rays", sequence.name, width * width);
            let took = pool.install(|| measure(sequence, width, rounds))?;
            let ms: Vec<[f64; 3]> = took.iter().map(|took| took.ms(sequence.frames.len() - 1)).collect();
            let over = ms[0][2] / ms[1][2].min(ms[2][2]);
            let cells: Vec<String> = ms.iter().map(|[update, rays, _]| format!("{update:.2} / {rays:.2}")).collect();
            let of_auto = &took[0].updates;
            let _ = writeln!(
                out,
                "| {name} | {} | {over:.3} | {} | {} | {:.2} |",
                cells.join(" | "),
                of_auto.refits + of_auto.top_refits,
                of_auto.rebuilds + of_auto.top_rebuilds,
                took[1].updates.max_drift
            );
            if over > worst.0 {
                worst = (over, name);
            }
        }
    }
    let _ =
        writeln!(out, "\n`auto` takes at most {:.3} times as long as the best fixed policy ({}).", worst.0, worst.1);
    missing.iter().for_each(|name| {
        let _ = writeln!(out, "\nNot measured: {name}; the model is not available.");
    });
    Ok(())
}

/// Each policy over the sequence, in turn in each frame.
fn measure(sequence: &Sequence, width: u32, rounds: usize) -> Result<Vec<Took>> {
    let mut all = vec![Took::default(); POLICIES.len()];
    let rays = rays(sequence, width);
    for round in 0..rounds {
        let first = || -> Result<_> { Ok(prepare::<Watertight>(&sequence.frames[0], &StructureConfig::default())?) };
        let mut prepared = POLICIES.iter().map(|_| first()).collect::<Result<Vec<_>>>()?;
        // The rays of the first frame.
        let mut traces: Vec<f64> = prepared.iter().map(|prepared| traced(prepared, &rays).1).collect();
        all.iter_mut().for_each(|took| {
            took.seconds.push([0.0; 2]);
            took.updates = Updates::default();
        });
        for (frame, scene) in sequence.frames.iter().enumerate().skip(1) {
            let mut hits: Vec<Vec<Option<Hit>>> = vec![];
            for i in 0..POLICIES.len() {
                // No policy is always the first to read the frame.
                let i = (i + frame + round) % POLICIES.len();
                let update =
                    UpdateOptions { policy: POLICIES[i].1, trace_time: Duration::from_secs_f64(traces[i].max(0.0)) };
                let (updates, updating) = clock::time(|| prepared[i].update(scene, &update));
                let (found, tracing) = traced(&prepared[i], &rays);
                let took = &mut all[i];
                took.updates += updates?;
                let seconds = took.seconds.last_mut().expect("a round has started");
                *seconds = [seconds[0] + updating.cpu, seconds[1] + tracing];
                traces[i] = tracing;
                hits.push(found);
            }
            ensure!(hits.iter().all(|found| *found == hits[0]), "{}: policies differ in frame {frame}", sequence.name);
        }
    }
    Ok(all)
}

/// Hits of all rays, and the seconds of processor time that they took.
fn traced(prepared: &Prepared<Watertight>, rays: &[Ray]) -> (Vec<Option<Hit>>, f64) {
    let (hits, took) =
        clock::time(|| rays.iter().map(|ray| prepared.structure.closest_hit(ray, &mut ())).collect::<Vec<_>>());
    (hits, took.cpu)
}

/// The pixels of a picture; the camera stands still.
fn rays(sequence: &Sequence, width: u32) -> Vec<Ray> {
    let [eye, target] = sequence.view.unwrap_or_else(|| {
        let bounds = sequence.frames[sequence.frames.len() / 2].bounds_world();
        let [low, high] = [bounds.min, bounds.max].map(|p| p.map(f64::from));
        let center: [f64; 3] = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
        let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let away = [0.9, 0.7, 1.1];
        [std::array::from_fn(|k| center[k] + extent * away[k]), center]
    });
    View { eye, target, fov_degrees: 50.0, rotation: Rotation::IDENTITY }.rays(width).iter().map(rays::ray).collect()
}
