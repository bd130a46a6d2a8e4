//! The dissertation's picture of Sponza on the device.

use std::{fmt::Write, sync::atomic::AtomicBool, time::Instant};

use anyhow::Result;
use canted_renderer::{DevicePicture, Integrator, Monitor, Settings, StructureConfig, Surfaces, frame, prepare};
use canted_trace::Watertight;

use super::Bench;
use crate::picture::sponza;

/// Bounces of the path-traced picture.
const BOUNCES: u32 = 8;

/// Renders twice, because the driver compiles during the first run, and writes the section; then renders paths with one
/// kernel and with a wavefront in turn.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    let [width, height, samples] = bench.scale.picture;
    // Writing to a String cannot fail.
    let _ = writeln!(out, "\n### Sponza, {width} x {height}, {samples} samples, 2 bounces\n");
    let Some(scene) = sponza()? else {
        out.push_str("Sponza is not available.\n");
        return Ok(());
    };
    let start = Instant::now();
    let prepared = prepare::<Watertight>(&scene, &StructureConfig::default())?;
    let build = start.elapsed().as_secs_f64();
    let camera = frame(&scene, &prepared.structure, f64::from(width) / f64::from(height));
    let settings = Settings { width, height, samples, bounces: 2, ..Settings::default() };
    let surfaces = Surfaces::with_lod(&scene, settings.lod);
    let start = Instant::now();
    let picture = DevicePicture::new(&bench.gpu, &surfaces, &prepared.structure, &camera, &settings)?;
    bench.gpu.finish()?;
    let upload = start.elapsed().as_secs_f64();
    let monitor = Monitor { progress: &|_, _| {}, finished: &|_| {}, cancel: &AtomicBool::new(false) };
    let mut seconds = [0.0; 2];
    let mut n_rays = 0;
    for seconds in &mut seconds {
        let start = Instant::now();
        n_rays = picture.render(vec![], &monitor)?.n_rays();
        *seconds = start.elapsed().as_secs_f64();
    }
    let [first, second] = seconds;
    #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
    let (millions, rate) = (n_rays as f64 * 1e-6, n_rays as f64 * 1e-6 / second);
    let _ = writeln!(
        out,
        "{second:.2} s for {millions:.1} M rays: {rate:.2} M rays/s, including shading and shadow rays; the first of two pictures \
         took {first:.2} s. Before it: {build:.2} s to build the BVH on the CPU, {upload:.2} s to pack and upload the scene. The \
         dissertation: 132 s for 1920 x 1080 and 24 samples."
    );
    let by_paths = Settings { integrator: Integrator::Path, bounces: BOUNCES, ..settings };
    let picture = || DevicePicture::new(&bench.gpu, &surfaces, &prepared.structure, &camera, &by_paths);
    let pictures = [picture()?, picture()?.in_waves()?];
    let mut least = [f64::MAX; 2];
    for round in 0..=bench.rounds {
        for (picture, least) in pictures.iter().zip(&mut least) {
            let start = Instant::now();
            n_rays = picture.render(vec![], &monitor)?.n_rays();
            // The driver compiles during the first run.
            if round > 0 {
                *least = least.min(start.elapsed().as_secs_f64());
            }
        }
    }
    let [one, waves] = least;
    #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
    let millions = n_rays as f64 * 1e-6;
    let _ = writeln!(
        out,
        "\nThe same with paths of {BOUNCES} bounces, {millions:.1} M rays, minimum of {} pictures in turn: {one:.2} s with one \
         kernel, {waves:.2} s with a wavefront of three kernels and the same samples.",
        bench.rounds
    );
    Ok(())
}
