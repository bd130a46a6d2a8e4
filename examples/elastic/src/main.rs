//! Renders an elastic torus that falls onto a floor, one picture per frame.
#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a program prints its results and its errors")]

mod options;

use std::{
    fs,
    process::ExitCode,
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use canted_film::write_png;
use canted_renderer::{Integrator, Settings, UpdateOptions, Updates, render};
use elastic::{Material, Stage, torus};

use options::{HELP, Options};

fn main() -> ExitCode {
    match Options::parse(std::env::args().skip(1)).and_then(|options| options.as_ref().map_or_else(help, run)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn help() -> Result<()> {
    println!("{HELP}");
    Ok(())
}

fn run(options: &Options) -> Result<()> {
    fs::create_dir_all(&options.folder).with_context(|| format!("cannot create {}", options.folder.display()))?;
    let mesh = torus([0.45, 0.2], [192, 64], 1.25, 0.5);
    let mut stage = Stage::new(&mesh, options.spacing, &Material::RUBBER)?;
    println!("{} triangles follow {} phyxels", mesh.triangles.len(), stage.body.n_phyxels());
    let [width, height] = options.size;
    let settings = Settings {
        width,
        height,
        samples: options.samples,
        integrator: Integrator::Path,
        bounces: 4,
        ..Settings::default()
    };
    let (mut total, mut trace_time) = (Updates::default(), Duration::ZERO);
    for frame in 0..options.frames {
        let start = Instant::now();
        let update = UpdateOptions { policy: options.update, trace_time };
        let frame_seconds = if frame == 0 { 0.0 } else { 1.0 / f64::from(options.fps) };
        let (n_steps, updates) = stage.advance(frame_seconds, &update)?;
        let move_time = start.elapsed();
        total += updates;

        let start = Instant::now();
        let (structure, camera) = (&stage.prepared.structure, &stage.scene.cameras[0]);
        let film = render(&stage.scene, structure, camera, &settings, &|_, _| (), &AtomicBool::new(false))?;
        trace_time = start.elapsed();
        let path = options.folder.join(format!("frame_{frame:04}.png"));
        write_png(&path, &film.picture())?;
        println!(
            "{}: {n_steps} steps in {:.0} ms, update in {:.2} ms (drift {:.3}), rays in {:.0} ms",
            path.display(),
            1e3 * (move_time - updates.time).as_secs_f64(),
            1e3 * updates.time.as_secs_f64(),
            updates.max_drift,
            1e3 * trace_time.as_secs_f64(),
        );
    }
    println!("{} refits, {} rebuilds, greatest drift {:.2}", total.refits, total.rebuilds, total.max_drift);
    Ok(())
}
