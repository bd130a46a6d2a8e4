//! The dissertation's picture of Sponza on the CPU and on the device.

use std::{fmt::Write, sync::atomic::AtomicBool, time::Instant};

use anyhow::Result;
use canted_renderer::{
    DevicePicture, FirstHit, Integrator, Monitor, Settings, StructureConfig, Surfaces, frame, prepare, render,
};
use canted_trace::Watertight;

use super::Bench;
use crate::picture::sponza;

/// Bounces of the path-traced picture.
const BOUNCES: u32 = 8;

/// Measured pictures of each kind, at most: software drivers take seconds for each.
const PICTURES: usize = 3;

/// Renders with the CPU and with both ways to find first hits, then paths.
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
    let start = Instant::now();
    let n_rays = picture.render(vec![], &monitor)?.n_rays();
    let first = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let other = DevicePicture::new(&bench.gpu, &surfaces, &prepared.structure, &camera, &settings)?;
    let (rasterized, _) = other.with_first_hit(FirstHit::Raster)?;
    let pass = start.elapsed().as_secs_f64();
    // The CPU, the device that traces first hits, and the device that rasterizes them, in turn.
    let rounds = bench.rounds.min(PICTURES);
    let mut least = [f64::MAX; 3];
    for _ in 0..rounds {
        let start = Instant::now();
        drop(render(&scene, &prepared.structure, &camera, &settings, &|_, _| {}, monitor.cancel)?);
        least[0] = least[0].min(start.elapsed().as_secs_f64());
        for (picture, least) in [&picture, &rasterized].into_iter().zip(&mut least[1..]) {
            let start = Instant::now();
            drop(picture.render(vec![], &monitor)?);
            *least = least.min(start.elapsed().as_secs_f64());
        }
    }
    let _ = writeln!(
        out,
        "Least of {rounds} pictures in turn; {:.1} M rays, shadow and occlusion rays included. Before them: {build:.2} s to build the BVH on the CPU, \
         {upload:.2} s to pack and upload the scene and compile; the first traced picture took {first:.2} s, the raster pass and its kernel \
         {pass:.2} s.\n\n| by | first hits | seconds | M rays/s |\n| --- | --- | --- | --- |",
        millions(n_rays)
    );
    let threads = format!("CPU, {} threads", rayon::current_num_threads());
    for ((by, hits), seconds) in
        [(&*threads, "traced"), ("device", "traced"), ("device", "rasterized")].into_iter().zip(least)
    {
        let _ = writeln!(out, "| {by} | {hits} | {seconds:.2} | {:.2} |", millions(n_rays) / seconds);
    }
    let _ = writeln!(out, "| *TITAN Xp, 2020, 1920 x 1080, 24 samples* | *rasterized* | *132* | |");
    let by_paths = Settings { integrator: Integrator::Path, bounces: BOUNCES, ..settings };
    let picture = DevicePicture::new(&bench.gpu, &surfaces, &prepared.structure, &camera, &by_paths)?;
    let (mut least, mut n_rays) = (f64::MAX, 0);
    for round in 0..=rounds {
        let start = Instant::now();
        n_rays = picture.render(vec![], &monitor)?.n_rays();
        // The driver compiles during the first run.
        if round > 0 {
            least = least.min(start.elapsed().as_secs_f64());
        }
    }
    let _ = writeln!(
        out,
        "\nThe same with paths of {BOUNCES} bounces, {:.1} M rays, minimum of {rounds} pictures: {least:.2} s.",
        millions(n_rays)
    );
    Ok(())
}

/// Million rays.
#[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
fn millions(n_rays: u64) -> f64 {
    n_rays as f64 * 1e-6
}
