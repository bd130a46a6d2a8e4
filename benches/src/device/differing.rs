//! How many pixels of the CPU's and the device's pictures differ, and why.

use std::{fmt::Write, sync::atomic::AtomicBool};

use anyhow::{Result, ensure};
use canted_film::{Aov, AovValues, Aovs, Film, srgb};
use canted_renderer::{DevicePicture, Monitor, Settings, StructureConfig, Surfaces, frame, prepare, render};
use canted_scene::Scene;
use canted_trace::Watertight;

use super::Bench;
use crate::picture::sponza;

/// Relative difference of radiance up to which only rounding differs: a shaded sample takes some hundred operations in `f32`, each of which
/// errs by 2^-24, and differences of nearly equal numbers enlarge that by some ten.
const ROUNDING: f64 = 1.0 / (1 << 14) as f64;

/// Measures and writes the table.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
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
    let prepared = prepare::<Watertight>(scene, &StructureConfig::default())?;
    let structure = &prepared.structure;
    let aspect = f64::from(settings.width) / f64::from(settings.height);
    let camera = scene.cameras.first().copied().unwrap_or_else(|| frame(scene, structure, aspect));
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let cancel = AtomicBool::new(false);
    let on_cpu = render(scene, structure, &camera, settings, &|_, _| {}, &cancel)?;
    let picture = DevicePicture::new(&bench.gpu, &surfaces, structure, &camera, settings)?;
    let monitor = Monitor { progress: &|_, _| {}, finished: &|_| {}, cancel: &cancel };
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
        #[expect(clippy::cast_possible_truncation, reason = "as pictures are written")]
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
