//! A sequence of pictures from a file on disk to files on disk: what is spent on anything but rays.

use std::{
    fmt::Write,
    fs,
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use anyhow::Result;
use canted_film::write_png;
use canted_renderer::{Settings, StructureConfig, UpdateOptions, Updates, prepare, render};
use canted_scene::{AnimatedScene, Camera, ReadOptions};
use canted_trace::Watertight;

use super::policies::FPS;
use crate::{models, options::Options};

const N_FRAMES: u16 = 48;
const SIZE: [u32; 2] = [640, 360];
const SAMPLES: u32 = 16;

/// Seconds of wall time.
#[derive(Default)]
struct Took {
    load: f64,
    update: f64,
    rays: f64,
    write: f64,
    all: f64,
    updates: Updates,
}

/// Measures and writes the table.
pub(super) fn table(out: &mut String, options: &Options) -> Result<()> {
    let path = models::folder().join("gltf/Fox.glb");
    let [width, height] = if options.is_quick { SIZE.map(|n| n / 8) } else { SIZE };
    let _ = writeln!(
        out,
        "\n### A sequence of pictures\n\n{N_FRAMES} frames of the run cycle of the skinned Fox, {width}x{height}, {SAMPLES} samples, default integrator under a \
         sky, all threads: the file is read, and every frame is posed, updated by `auto`, rendered and written as PNG. Seconds of wall time.\n\n| sequence | read \
         and pose | update | rays | write | all | all over rays | refits | rebuilds |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    );
    if !path.is_file() {
        let _ = writeln!(out, "| skinned fox, not available | | | | | | | | |");
        return Ok(());
    }
    let took = frames(&path, [width, height])?;
    let _ = writeln!(
        out,
        "| skinned fox | {:.3} | {:.3} | {:.2} | {:.3} | {:.2} | {:.3} | {} | {} |",
        took.load,
        took.update,
        took.rays,
        took.write,
        took.all,
        took.all / took.rays,
        took.updates.refits,
        took.updates.rebuilds
    );
    Ok(())
}

fn frames(path: &std::path::Path, [width, height]: [u32; 2]) -> Result<Took> {
    let folder = std::env::temp_dir().join(format!("canted-frames-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    let start = Instant::now();
    let mut took = Took::default();
    let read = ReadOptions { animation: Some("Run".to_owned()), ..ReadOptions::default() };
    let (mut animated, mut scene) = AnimatedScene::open(path, &read)?;
    scene.environment = Some([0.8, 0.9, 1.0].into());
    let bounds = scene.bounds_world();
    let target: [f32; 3] = std::array::from_fn(|k| 0.5 * (bounds.min[k] + bounds.max[k]));
    let extent = (0..3).map(|k| bounds.max[k] - bounds.min[k]).fold(0.0, f32::max);
    let away: [f32; 3] = [0.9, 0.5, 0.8];
    let eye = std::array::from_fn(|k| target[k] + extent * away[k]);
    let camera = Camera::pinhole(eye, target, [0.0, 1.0, 0.0], 45.0);
    let settings = Settings { width, height, samples: SAMPLES, ..Settings::default() };
    let mut prepared = prepare::<Watertight>(&scene, &StructureConfig::default())?;
    took.load = start.elapsed().as_secs_f64();
    let mut trace_time = Duration::ZERO;
    for frame in 0..N_FRAMES {
        let start = Instant::now();
        animated.pose(f32::from(frame) / f32::from(FPS), &mut scene)?;
        took.load += start.elapsed().as_secs_f64();
        let start = Instant::now();
        took.updates += prepared.update(&scene, &UpdateOptions { trace_time, ..UpdateOptions::default() })?;
        took.update += start.elapsed().as_secs_f64();
        let start = Instant::now();
        let film = render(&scene, &prepared.structure, &camera, &settings, &|_, _| (), &AtomicBool::new(false))?;
        trace_time = start.elapsed();
        took.rays += trace_time.as_secs_f64();
        let start = Instant::now();
        write_png(&folder.join(format!("frame_{frame:04}.png")), &film.picture())?;
        took.write += start.elapsed().as_secs_f64();
    }
    took.all = start.elapsed().as_secs_f64();
    fs::remove_dir_all(&folder)?;
    Ok(took)
}
