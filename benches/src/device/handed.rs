//! The CPU's work before a device can start: gathering, building, packing and uploading.

use std::fmt::Write;

use anyhow::Result;
use canted_gpu::build::Primitives;
use canted_renderer::{Accel, DevicePicture, Settings, StructureConfig, Surfaces, flatten, frame, prepare};
use canted_trace::Watertight;
use canted_wide::Preset;

use super::Bench;
use crate::{clock::time_all, models};

/// An ordinary scene, and one of a million triangles.
const SCENES: [&str; 2] = ["sponza", "country_kitchen"];

/// Measures and writes the table.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    let _ = writeln!(
        out,
        "\n### Before the device starts\n\nMinimum milliseconds of {} rounds on {} threads, wall time (and processor time of all \
         threads), from a scene in memory. Corners: flattening, gathering and uploading the input of a device build. BVH: a WideBvh \
         built on the CPU, by preset. Picture: packing and uploading that BVH, surfaces and textures.\n\n\
         | scene | triangles | corners | BVH, fast | BVH, balanced | picture |\n| --- | --- | --- | --- | --- | --- |",
        bench.rounds,
        rayon::current_num_threads()
    );
    for name in SCENES {
        let Some(scene) = models::scene(name)? else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        let gpu = &bench.gpu;
        let corners = || -> Result<()> {
            let (positions, triangles, _) = flatten(&scene)?;
            let (corners, _) = canted_lbvh::triangle_corners(&positions, &triangles)?;
            let primitives = Primitives::triangles(gpu, [&corners[..]])?;
            gpu.finish()?;
            drop(primitives);
            Ok(())
        };
        let config =
            |preset| StructureConfig { accel: Accel::Wide { preset, builder: None }, ..StructureConfig::default() };
        let tree = |preset| -> Result<()> {
            drop(prepare::<Watertight>(&scene, &config(preset))?);
            Ok(())
        };
        let prepared = prepare::<Watertight>(&scene, &config(Preset::Fast))?;
        let settings = Settings::default();
        let camera = frame(&scene, &prepared.structure, 1.0);
        let surfaces = Surfaces::with_lod(&scene, settings.lod);
        let picture = || -> Result<()> {
            let picture = DevicePicture::new(gpu, &surfaces, &prepared.structure, &camera, &settings)?;
            gpu.finish()?;
            drop(picture);
            Ok(())
        };
        let _ = writeln!(
            out,
            "| {name} | {} | {} | {} | {} | {} |",
            scene.n_placed_triangles(),
            least(bench.rounds, corners)?,
            least(bench.rounds, || tree(Preset::Fast))?,
            least(bench.rounds, || tree(Preset::Balanced))?,
            least(bench.rounds, picture)?
        );
    }
    Ok(())
}

/// The minimum wall and processor milliseconds of several rounds after a warm-up.
fn least(rounds: usize, mut work: impl FnMut() -> Result<()>) -> Result<String> {
    work()?;
    let (mut wall, mut cpu) = (f64::MAX, f64::MAX);
    for _ in 0..rounds {
        let (done, taken) = time_all(&mut work);
        done?;
        wall = wall.min(taken.wall);
        cpu = cpu.min(taken.cpu);
    }
    Ok(format!("{:.0} ({:.0})", 1e3 * wall, 1e3 * cpu))
}
