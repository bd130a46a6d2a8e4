//! Pictures of the CPU and of the device: their times, tiles that both share, and pixels that differ, with the reason.

use std::{
    fmt::Write,
    sync::atomic::{AtomicBool, AtomicUsize, Ordering},
    time::Instant,
};

use anyhow::{Result, ensure};
use canted_film::{Aov, AovValues, Aovs, Film, srgb};
use canted_gpu::{AdapterKind, block_on};
use canted_renderer::{
    DevicePicture, FirstHit, Integrator, Monitor, SceneBvh, SceneBvhConfig, Settings, Surfaces, frame, render,
};
use canted_scene::Scene;

use super::Bench;
use crate::{
    picture::sponza,
    timing::{Contender, Timing, ratio, try_run},
};

/// Measured pictures of each kind, at most: software drivers take seconds for each.
const PICTURES: usize = 3;

/// Renders with the CPU and with both ways to find first hits.
pub(super) fn sponza_picture(out: &mut String, bench: &Bench) -> Result<()> {
    let [width, height, samples] = bench.scale.picture;
    // Writing to a String cannot fail.
    let _ = writeln!(out, "\n### Sponza, {width} x {height}, {samples} samples, 2 bounces\n");
    let Some(scene) = sponza()? else {
        out.push_str("Sponza is not available.\n");
        return Ok(());
    };
    let start = Instant::now();
    let prepared = SceneBvh::build(&scene, &SceneBvhConfig::default())?;
    let build = start.elapsed().as_secs_f64();
    let camera = frame(&scene, &prepared, f64::from(width) / f64::from(height));
    let settings = Settings { width, height, samples, bounces: 2, ..Settings::default() };
    let surfaces = Surfaces::with_lod(&scene, settings.lod);
    let start = Instant::now();
    let picture = DevicePicture::new(&bench.gpu, &surfaces, &prepared, &camera, &settings)?;
    block_on(bench.gpu.finish())?;
    let upload = start.elapsed().as_secs_f64();
    let cancel = AtomicBool::new(false);
    let monitor = Monitor::quiet(&cancel);
    let start = Instant::now();
    let n_rays = picture.render(vec![], &monitor)?.n_rays();
    let first = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let other = DevicePicture::new(&bench.gpu, &surfaces, &prepared, &camera, &settings)?;
    let (rasterized, _) = other.with_first_hit(FirstHit::Raster)?;
    let pass = start.elapsed().as_secs_f64();
    // The CPU, the device that traces first hits, and the device that rasterizes them, in turn.
    let rounds = bench.rounds.min(PICTURES);
    let mut least = [f64::MAX; 3];
    for _ in 0..rounds {
        let start = Instant::now();
        drop(render(&scene, &prepared, &camera, &settings, &|_, _| {}, monitor.cancel)?);
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
    Ok(())
}

/// Renders with the rays of many samples as streams, and with one kernel for whole samples.
pub(super) fn streams(out: &mut String, bench: &Bench) -> Result<()> {
    let [width, height, samples] = bench.scale.picture;
    let rounds = bench.rounds.min(PICTURES);
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n### Streams of rays\n\nThe same pictures with rays of many samples traced together, and with one kernel for whole samples: {width} x {height}, \
         {samples} samples, 2 bounces, after building, uploading and a first picture. Least of {rounds} pictures in turn; both have the same bits. The last \
         column has the rays that exact kernels decided, of the streams.\n\n\
         | scene | integrator | M rays | streams, seconds | one kernel, seconds | streams, M rays/s | one kernel over streams | exact, percent |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    let cancel = AtomicBool::new(false);
    let monitor = Monitor::quiet(&cancel);
    for (name, scene) in [("built-in", Some(canted_scene::builtin())), ("sponza", sponza()?)] {
        let Some(scene) = scene else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        let bvh = SceneBvh::build(&scene, &SceneBvhConfig::default())?;
        let own = scene.cameras.first().copied();
        let camera = own.unwrap_or_else(|| frame(&scene, &bvh, f64::from(width) / f64::from(height)));
        for integrator in Integrator::ALL {
            let settings = Settings { width, height, samples, bounces: 2, integrator, ..Settings::default() };
            let surfaces = Surfaces::with_lod(&scene, settings.lod);
            let of = |are_streams: bool| {
                let picture = DevicePicture::new(&bench.gpu, &surfaces, &bvh, &camera, &settings)?;
                picture.with_streams(are_streams)
            };
            let pictures = [of(true)?, of(false)?];
            let films = [pictures[0].render(vec![], &monitor)?, pictures[1].render(vec![], &monitor)?];
            ensure!(films[0] == films[1], "{name}: streams and one kernel draw different pictures");
            let n_rays = films[0].n_rays();
            let n_exact = pictures[0].n_exact_rays().unwrap_or(n_rays);
            let mut least = [f64::MAX; 2];
            for _ in 0..rounds {
                for (picture, least) in pictures.iter().zip(&mut least) {
                    let start = Instant::now();
                    drop(picture.render(vec![], &monitor)?);
                    *least = least.min(start.elapsed().as_secs_f64());
                }
            }
            let [streams, whole] = least;
            let _ = writeln!(
                out,
                "| {name} | {} | {:.1} | {streams:.2} | {whole:.2} | {:.2} | {:.2} | {:.2} |",
                integrator.name(),
                millions(n_rays),
                millions(n_rays) / streams,
                whole / streams,
                1e2 * n_exact as f64 / n_rays.max(1) as f64
            );
        }
    }
    Ok(())
}

/// Million rays.
fn millions(n_rays: u64) -> f64 {
    n_rays as f64 * 1e-6
}

/// The renderers, in table order.
const NAMES: [&str; 3] = ["CPU alone", "device alone", "both"];

/// Measures all three in turn and writes the table.
pub(super) fn both(out: &mut String, bench: &Bench) -> Result<()> {
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
    let prepared = SceneBvh::build(&scene, &SceneBvhConfig::default())?;
    let own = scene.cameras.first().copied();
    let camera = own.unwrap_or_else(|| frame(&scene, &prepared, f64::from(width) / f64::from(height)));
    let settings = Settings { width, height, samples, bounces: 2, ..Settings::default() };
    let surfaces = Surfaces::with_lod(&scene, settings.lod);
    let picture = DevicePicture::new(&bench.gpu, &surfaces, &prepared, &camera, &settings)?;
    let cancel = AtomicBool::new(false);
    let n_all = AtomicUsize::new(0);
    let count = |_, of: usize| n_all.store(of, Ordering::Relaxed);
    let monitor = Monitor { progress: &count, ..Monitor::quiet(&cancel) };
    let mut n_tiles = 0;
    let by_cpu = || -> Result<()> {
        drop(render(&scene, &prepared, &camera, &settings, &|_, _| {}, &cancel)?);
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

/// Relative difference of radiance up to which only rounding differs: a shaded sample takes some hundred operations in `f32`, each of which
/// errs by 2^-24, and differences of nearly equal numbers enlarge that by some ten.
const ROUNDING: f64 = 1.0 / (1 << 14) as f64;

/// Measures and writes the table.
pub(super) fn differing(out: &mut String, bench: &Bench) -> Result<()> {
    let [width, height, _] = bench.scale.shared;
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n### Pixels that differ between CPU and device\n\n{width} x {height}, one sample, by bounces. A pixel has the same bits; or \
         differs by at most 2^-14 of its radiance, which is rounding; or by more: then the camera ray found another triangle, or a \
         shadow ray, an occlusion ray or a bounce did (only those of later bounces are new in a later row). The last column counts \
         pixels whose 8-bit values differ.\n\n| scene | bounces | pixels | same bits | rounding | other camera hit | other later hit | 8 bits \
         |\n| --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    let scenes: [(&str, Option<Scene>); 2] = [("built-in", Some(canted_scene::builtin())), ("sponza", sponza()?)];
    for (name, scene) in scenes {
        let Some(scene) = scene else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        for bounces in 0..=2 {
            let settings = Settings { width, height, samples: 1, bounces, aovs: ids(), ..Settings::default() };
            let counts = counted(bench, &scene, &settings)?;
            let Counts { pixels, same, rounding, camera, later, visible } = counts;
            let _ = writeln!(
                out,
                "| {name} | {bounces} | {pixels} | {same} | {rounding} | {camera} | {later} | {visible} |"
            );
        }
    }
    Ok(())
}

/// The AOVs that name what camera rays hit.
fn ids() -> Aovs {
    Aovs::NONE.with(Aov::Instance).with(Aov::Primitive)
}

/// Pixels by how they differ.
#[derive(Debug, Default, PartialEq, Eq)]
struct Counts {
    pixels: usize,
    same: usize,
    rounding: usize,
    camera: usize,
    later: usize,
    visible: usize,
}

fn counted(bench: &Bench, scene: &Scene, settings: &Settings) -> Result<Counts> {
    let prepared = SceneBvh::build(scene, &SceneBvhConfig::default())?;
    let structure = &prepared;
    let aspect = f64::from(settings.width) / f64::from(settings.height);
    let camera = scene.cameras.first().copied().unwrap_or_else(|| frame(scene, structure, aspect));
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let cancel = AtomicBool::new(false);
    let on_cpu = render(scene, structure, &camera, settings, &|_, _| {}, &cancel)?;
    let picture = DevicePicture::new(&bench.gpu, &surfaces, structure, &camera, settings)?;
    let monitor = Monitor::quiet(&cancel);
    let on_device = picture.render(vec![], &monitor)?;
    let [cpu_ids, device_ids] = [first_hits(&on_cpu)?, first_hits(&on_device)?];
    let pixels = on_cpu.pixels().iter().zip(on_device.pixels()).map(|(a, b)| [a.mean(), b.mean()]);
    let same_ids = cpu_ids.into_iter().zip(device_ids).map(|(a, b)| a == b);
    Ok(classified(pixels.zip(same_ids)))
}

/// Counts pairs of radiance, with whether the camera ray hit the same triangle.
fn classified(pixels: impl Iterator<Item = ([[f64; 3]; 2], bool)>) -> Counts {
    let mut counts = Counts::default();
    for ([a, b], is_same_hit) in pixels {
        counts.pixels += 1;
        let scale = a.iter().chain(&b).fold(0.0, |most: f64, x| most.max(x.abs()));
        let difference = a.iter().zip(&b).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
        if a == b {
            counts.same += 1;
        } else if difference <= ROUNDING * scale {
            counts.rounding += 1;
        } else if is_same_hit {
            counts.later += 1;
        } else {
            counts.camera += 1;
        }
        let encoded = |color: [f64; 3]| color.map(|c| srgb::encode(c as f32));
        counts.visible += usize::from(encoded(a) != encoded(b));
    }
    counts
}

/// Instance and primitive of each pixel's camera ray.
fn first_hits(film: &Film) -> Result<Vec<[u32; 2]>> {
    let (Some(AovValues::Ids(instances)), Some(AovValues::Ids(primitives))) =
        (film.aov(Aov::Instance), film.aov(Aov::Primitive))
    else {
        anyhow::bail!("the film has no ids");
    };
    ensure!(instances.len() == primitives.len(), "ids of different pictures");
    Ok(instances.into_iter().zip(primitives).map(|(instance, primitive)| [instance, primitive]).collect())
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

    #[test]
    fn pixels_are_classified_by_what_differs() {
        let pixel = |a: f64, b: f64, is_same| ([[a; 3], [b; 3]], is_same);
        let pixels = [
            pixel(0.5, 0.5, true),
            pixel(0.5, 0.5 + 1e-7, true),
            pixel(0.5, 0.6, true),
            pixel(0.5, 0.9, false),
            // The same radiance through another triangle is no difference.
            pixel(0.0, 0.0, false),
        ];
        let counts = classified(pixels.into_iter());
        assert_eq!(counts, Counts { pixels: 5, same: 2, rounding: 1, camera: 1, later: 1, visible: 2 });
    }
}
