//! The built-in scene rendered by the CPU alone, by the device alone and by both together.

use std::{
    fmt::Write,
    sync::atomic::{AtomicBool, AtomicUsize, Ordering},
};

use anyhow::Result;
use canted_gpu::AdapterKind;
use canted_renderer::{DevicePicture, Monitor, Settings, StructureConfig, Surfaces, frame, prepare, render};
use canted_trace::Watertight;

use super::Bench;
use crate::interleave::{Contender, Timing, ratio, try_run};

/// The renderers, in table order.
const NAMES: [&str; 3] = ["CPU alone", "device alone", "both"];

/// Measures all three in turn and writes the table.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    let [width, height, samples] = bench.scale.shared;
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n### Both at once\n\nThe built-in scene, {width} x {height}, {samples} samples, 2 bounces, after building and uploading; \
         the CPU uses {} threads. Median wall time of {} pictures, all three in turn, ± half the range; tiles of the last \
         picture.\n\n| by | seconds | tiles of the device |\n| --- | --- | --- |",
        rayon::current_num_threads(),
        bench.rounds
    );
    let scene = canted_scene::builtin();
    let prepared = prepare::<Watertight>(&scene, &StructureConfig::default())?;
    let own = scene.cameras.first().copied();
    let camera = own.unwrap_or_else(|| frame(&scene, &prepared.structure, f64::from(width) / f64::from(height)));
    let settings = Settings { width, height, samples, bounces: 2, ..Settings::default() };
    let surfaces = Surfaces::with_lod(&scene, settings.lod);
    let picture = DevicePicture::new(&bench.gpu, &surfaces, &prepared.structure, &camera, &settings)?;
    let cancel = AtomicBool::new(false);
    let n_all = AtomicUsize::new(0);
    let count = |_, of: usize| n_all.store(of, Ordering::Relaxed);
    let monitor = Monitor { progress: &count, finished: &|_| {}, cancel: &cancel };
    let mut n_tiles = 0;
    let by_cpu = || -> Result<()> {
        drop(render(&scene, &prepared.structure, &camera, &settings, &|_, _| {}, &cancel)?);
        Ok(())
    };
    let by_device = || -> Result<()> {
        drop(picture.render(vec![], &monitor)?);
        Ok(())
    };
    let by_both = || -> Result<()> {
        let shared = picture.render_with_cpu(vec![], &monitor)?;
        n_tiles = shared.n_tiles_of_device;
        shared.stopped.map_or(Ok(()), |error| Err(error.into()))
    };
    let [cpu, device, both] = NAMES;
    let timings = try_run(
        bench.rounds,
        vec![Contender::new(cpu, by_cpu), Contender::new(device, by_device), Contender::new(both, by_both)],
    )?;
    let n_all = n_all.into_inner();
    let tiles = ["0".to_owned(), n_all.to_string(), format!("{n_tiles} of {n_all}")];
    for (timing, tiles) in timings.iter().zip(tiles) {
        let _ =
            writeln!(out, "| {} | {:.3} ±{:.0}% | {tiles} |", timing.name, timing.median(), 100.0 * timing.spread());
    }
    let _ = writeln!(out, "\n{}", verdict(&timings, bench.gpu.info().kind == AdapterKind::Software));
    Ok(())
}

/// How both together compare with the better one alone, round by round.
fn verdict(timings: &[Timing], is_software: bool) -> String {
    let [cpu, device, both] = timings else { unreachable!("a timing for each of the three") };
    let better = if cpu.median() <= device.median() { cpu } else { device };
    let cores = if is_software { " The adapter computes on the CPU's own cores, so the two share them." } else { "" };
    format!(
        "Both together are {:.2} times as fast as the better one alone, the {}.{cores}",
        ratio(&better.seconds, &both.seconds),
        better.name.trim_end_matches(" alone")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timings(seconds: [[f64; 3]; 3]) -> Vec<Timing> {
        let timing = |(name, seconds): (&str, [f64; 3])| Timing {
            name: name.to_owned(),
            seconds: seconds.to_vec(),
            speed_ratio: f64::NAN,
        };
        NAMES.into_iter().zip(seconds).map(timing).collect()
    }

    #[test]
    fn both_are_compared_with_the_better_one_of_the_same_round() {
        let text = verdict(&timings([[9.0, 8.0, 90.0], [2.0, 4.0, 20.0], [1.0, 2.0, 10.0]]), false);
        assert_eq!(text, "Both together are 2.00 times as fast as the better one alone, the device.");
        let text = verdict(&timings([[1.0; 3], [6.0; 3], [1.25; 3]]), true);
        assert!(
            text.starts_with("Both together are 0.80 times as fast as the better one alone, the CPU. The adapter"),
            "{text}"
        );
    }
}
