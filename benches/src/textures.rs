//! What looking up textures costs: Sponza with its colours and without, by how much of a texture a lookup averages.

use std::{fmt::Write, sync::atomic::AtomicBool};

use anyhow::Result;
use canted_renderer::{Integrator, Lod, Settings, StructureConfig, prepare, render};
use canted_scene::{Camera, Scene};
use canted_trace::Watertight;

use crate::{clock, interleave::median, picture::sponza};

/// In the order of the table's columns.
const LODS: [Lod; 3] = [Lod::None, Lod::Cone, Lod::Aniso];

/// Integrators, and samples a pixel that take about as long.
const INTEGRATORS: [(&str, Integrator, u32); 2] = [("hybrid", Integrator::Hybrid, 12), ("path", Integrator::Path, 6)];

/// Renders all variants in turn and writes the section.
pub(crate) fn section(out: &mut String, rounds: usize) -> Result<()> {
    out.push_str("\n## Textures\n\n");
    let Some(scene) = sponza()? else {
        out.push_str("Sponza is not at hand.\n");
        return Ok(());
    };
    out.push_str(
        "Sponza at 320 x 180 from its gallery; \"without\" is the same less its colour textures, so that masks and, under `hybrid`, rays are \
         the same. Making the smaller copies is in the time. Microseconds of all processors a sample, median (half spread); median ratio to \
         \"without\" of the same round.\n\n| integrator | without | `--lod none` | `--lod cone` | `--lod aniso` |\n\
         | --- | --- | --- | --- | --- |\n",
    );
    let plain = without_colours(scene.clone());
    for (name, integrator, samples) in INTEGRATORS {
        let microseconds = measure(&scene, &plain, integrator, samples, rounds)?;
        let _ = write!(out, "| {name}, {samples} samples |");
        for (i, of_one) in microseconds.iter().enumerate() {
            let [low, high] = of_one.iter().fold([f64::MAX, 0.0], |[low, high], &x| [x.min(low), x.max(high)]);
            let middle = median(of_one);
            let _ = write!(out, " {middle:.2} (±{:.0} %)", 50.0 * (high - low) / middle);
            if i > 0 {
                let ratios: Vec<f64> =
                    of_one.iter().zip(&microseconds[0]).map(|(with, without)| with / without).collect();
                let _ = write!(out, ", {:.2}x", median(&ratios));
            }
            out.push_str(" |");
        }
        out.push('\n');
    }
    Ok(())
}

/// Microseconds a sample of each round, without textures and then by each way to look them up.
fn measure(scene: &Scene, plain: &Scene, integrator: Integrator, samples: u32, rounds: usize) -> Result<Vec<Vec<f64>>> {
    let prepared = prepare::<Watertight>(scene, &StructureConfig::default())?;
    let camera = Camera::pinhole([700.0, 700.0, -100.0], [-300.0, 250.0, 100.0], [0.0, 1.0, 0.0], 60.0);
    let settings =
        Settings { width: 320, height: 180, samples, integrator, bounces: integrator.bounces(), ..Settings::default() };
    let mut variants = vec![(plain, Lod::None)];
    variants.extend(LODS.map(|lod| (scene, lod)));
    let mut microseconds = vec![vec![]; variants.len()];
    for round in 0..=rounds {
        for ((scene, lod), microseconds) in variants.iter().zip(&mut microseconds) {
            let settings = Settings { lod: *lod, ..settings };
            let cancel = AtomicBool::new(false);
            let (film, took) =
                clock::time_all(|| render(scene, &prepared.structure, &camera, &settings, &|_, _| {}, &cancel));
            film?;
            if round > 0 {
                microseconds.push(took.cpu * 1e6 / f64::from(320 * 180 * samples));
            }
        }
    }
    Ok(microseconds)
}

fn without_colours(mut scene: Scene) -> Scene {
    for material in &mut scene.materials {
        material.base_color_texture = None;
    }
    scene
}
