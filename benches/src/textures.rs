//! The cost of texture lookups: Sponza with and without its textures, by filter footprint; and a scene without
//! textures, where the cost must be zero.

use std::{fmt::Write, sync::atomic::AtomicBool};

use anyhow::{Context, Result};
use canted_renderer::{Integrator, Lod, Settings, StructureConfig, prepare, render};
use canted_scene::{Camera, Encoding, Scene, Texture};
use canted_trace::Watertight;

use crate::{
    clock,
    picture::sponza,
    report::samples::{Ratio, Samples},
};

/// In column order.
const LODS: [(&str, Lod); 3] = [("none", Lod::None), ("cone", Lod::Cone), ("aniso", Lod::Aniso)];

/// Integrators, and few and many samples per pixel that take about as long with either.
const INTEGRATORS: [(&str, Integrator, [u32; 2]); 2] =
    [("hybrid", Integrator::Hybrid, [4, 20]), ("path", Integrator::Path, [2, 10])];

/// Textures may cost this many times the time without them.
const AIM: f64 = 1.15;

/// A scene with and without its textures, from one camera.
struct Subject {
    /// Prefix of its row names.
    prefix: &'static str,
    textured: Scene,
    plain: Scene,
    camera: Camera,
}

/// Renders all variants in turn and writes the section.
pub(crate) fn section(out: &mut String, rounds: usize) -> Result<()> {
    out.push_str(
        "\n## Textures\n\nSponza at 320 x 180 from its gallery; \"without\" replaces each color texture by its mean color, so that \
         masks, rays of `hybrid` and path lengths stay the same. The built-in scene has no texture: all its columns show one scene, \
         and \"without\" is `--lod none` once more. Microseconds of all processors per sample: the time of many samples minus that \
         of few, so that work done once per picture, such as mip levels, is not included; median (half spread); median ratio to \
         \"without\" of the same round, noise if the interval of that median contains 1.\n\n",
    );
    let mut subjects = vec![without_textures()?];
    match sponza()? {
        Some(scene) => subjects.insert(0, of_sponza(scene)),
        None => out.push_str("Sponza is not available.\n\n"),
    }
    out.push_str("| integrator | without |");
    for (name, _) in LODS {
        let _ = write!(out, " `--lod {name}` |");
    }
    let _ = writeln!(out, "\n|{}", " --- |".repeat(2 + LODS.len()));
    let (mut textured, mut plain) = (vec![], vec![]);
    for subject in &subjects {
        for (name, integrator, samples) in INTEGRATORS {
            let microseconds = measure(subject, integrator, samples, rounds)?;
            let row = format!("{}{name}, {} and {} samples", subject.prefix, samples[0], samples[1]);
            out.push_str(&line(&row, &microseconds));
            let ratios = LODS.iter().zip(&microseconds[1..]);
            let rated = ratios.map(|((lod, _), with)| (format!("{row}, `{lod}`"), with.over(&microseconds[0])));
            let cells = if subject.prefix.is_empty() { &mut textured } else { &mut plain };
            cells.extend(rated);
        }
    }
    if !textured.is_empty() {
        let _ = writeln!(out, "\n{}", of_aim(&textured));
    }
    let _ = writeln!(out, "\n{}", of_nothing(&plain));
    Ok(())
}

/// A table row: the first time is the one without textures.
fn line(name: &str, microseconds: &[Samples]) -> String {
    let mut out = format!("| {name} |");
    for (i, of_one) in microseconds.iter().enumerate() {
        let _ = write!(out, " {:.2} (±{:.0} %)", of_one.median(), 100.0 * of_one.spread());
        if i > 0 {
            let ratio = of_one.over(&microseconds[0]);
            let noise = if ratio.is_noise() { ", noise" } else { "" };
            let _ = write!(out, ", {:.2}x{noise}", ratio.median);
        }
        out.push_str(" |");
    }
    out.push('\n');
    out
}

/// Whether each cell reaches the aim, as far as its rounds determine.
fn of_aim(cells: &[(String, Ratio)]) -> String {
    let named = |is: &dyn Fn(&Ratio) -> bool| {
        let names: Vec<&str> = cells.iter().filter(|(_, ratio)| is(ratio)).map(|(name, _)| &name[..]).collect();
        if names.is_empty() { "none".to_owned() } else { names.join("; ") }
    };
    let is_reached = |ratio: &Ratio| ratio.interval[1] <= AIM;
    let is_missed = |ratio: &Ratio| ratio.interval[0] > AIM;
    format!(
        "The aim is at most {AIM}x. Reached: {}. Missed: {}. Undecided, because the interval contains it: {}.",
        named(&is_reached),
        named(&is_missed),
        named(&|ratio| !is_reached(ratio) && !is_missed(ratio))
    )
}

/// Whether a scene without textures is as fast with lookups enabled.
fn of_nothing(cells: &[(String, Ratio)]) -> String {
    let real: Vec<&str> = cells.iter().filter(|(_, ratio)| !ratio.is_noise()).map(|(name, _)| &name[..]).collect();
    if real.is_empty() {
        "Textures cost nothing in a scene without them: every difference is noise.".to_owned()
    } else {
        format!(
            "Textures should cost nothing in a scene without them, but these differ beyond noise: {}.",
            real.join("; ")
        )
    }
}

/// Microseconds per sample of each round, without textures and then with each lookup method.
fn measure(subject: &Subject, integrator: Integrator, samples: [u32; 2], rounds: usize) -> Result<Vec<Samples>> {
    let Subject { textured, plain, camera, .. } = subject;
    let prepared = prepare::<Watertight>(textured, &StructureConfig::default())?;
    let settings =
        Settings { width: 320, height: 180, integrator, bounces: integrator.bounces(), ..Settings::default() };
    let seconds = |scene: &Scene, lod: Lod, samples: u32| -> Result<f64> {
        let settings = Settings { lod, samples, ..settings };
        let cancel = AtomicBool::new(false);
        let (film, took) =
            clock::time_all(|| render(scene, &prepared.structure, camera, &settings, &|_, _| {}, &cancel));
        film?;
        Ok(took.cpu)
    };
    let mut variants = vec![(plain, Lod::None)];
    variants.extend(LODS.map(|(_, lod)| (textured, lod)));
    let mut microseconds = vec![vec![]; variants.len()];
    let [few, many] = samples;
    for round in 0..=rounds {
        for ((scene, lod), microseconds) in variants.iter().zip(&mut microseconds) {
            let more = seconds(scene, *lod, many)? - seconds(scene, *lod, few)?;
            if round > 0 {
                microseconds.push(more * 1e6 / f64::from(settings.width * settings.height * (many - few)));
            }
        }
    }
    Ok(microseconds.into_iter().map(Samples::from).collect())
}

fn of_sponza(textured: Scene) -> Subject {
    let mut plain = textured.clone();
    for material in &mut plain.materials {
        if let Some(slot) = material.base_color_texture.take() {
            let mean = mean_color(&textured.textures[slot.texture.0 as usize]);
            material.base_color = std::array::from_fn(|k| material.base_color[k] * mean[k]);
        }
    }
    let camera = Camera::pinhole([700.0, 700.0, -100.0], [-300.0, 250.0, 100.0], [0.0, 1.0, 0.0], 60.0);
    Subject { prefix: "", textured, plain, camera }
}

/// Mean of a texture's texels in linear light, white if it has none: path lengths depend on reflectance.
fn mean_color(texture: &Texture) -> [f32; 3] {
    let linear = |byte: u8| match (texture.encoding, f64::from(byte) / 255.0) {
        (Encoding::Linear, x) => x,
        (Encoding::Srgb, x) if x <= 0.04045 => x / 12.92,
        (Encoding::Srgb, x) => ((x + 0.055) / 1.055).powf(2.4),
    };
    let n = texture.texels.len() as f64;
    #[expect(clippy::cast_possible_truncation, reason = "a mean of numbers in 0..=1")]
    let mean = |k: usize| (texture.texels.iter().map(|texel| linear(texel[k])).sum::<f64>() / n) as f32;
    if texture.texels.is_empty() { [1.0; 3] } else { std::array::from_fn(mean) }
}

fn without_textures() -> Result<Subject> {
    let plain = canted_scene::builtin();
    let camera = *plain.cameras.first().context("the built-in scene has no camera")?;
    Ok(Subject { prefix: "built-in, no textures: ", textured: plain.clone(), plain, camera })
}

#[cfg(test)]
mod tests {
    use super::*;
    use canted_scene::Wrap;

    fn samples(values: [f64; 5]) -> Samples {
        values.to_vec().into()
    }

    #[test]
    fn a_line_marks_noise() {
        let without = samples([1.0, 1.1, 1.2, 1.0, 1.1]);
        let text = line("a", &[without.clone(), without.scaled(1.25), without.clone()]);
        assert_eq!(text, "| a | 1.10 (±9 %) | 1.38 (±9 %), 1.25x | 1.10 (±9 %), 1.00x, noise |\n");
    }

    #[test]
    fn the_aim_is_reached_missed_or_undecided() {
        let of = |name: &str, interval: [f64; 2]| (name.to_owned(), Ratio { median: interval[0], interval });
        let text = of_aim(&[of("a", [1.0, 1.1]), of("b", [1.1, 1.2]), of("c", [1.2, 1.3]), of("d", [1.15, 1.15])]);
        assert_eq!(
            text,
            "The aim is at most 1.15x. Reached: a; d. Missed: c. Undecided, because the interval contains it: b."
        );
    }

    #[test]
    fn costs_without_lookups_are_reported() {
        let of = |name: &str, interval: [f64; 2]| (name.to_owned(), Ratio { median: interval[0], interval });
        assert!(of_nothing(&[of("a", [0.9, 1.1])]).ends_with("is noise."));
        assert!(of_nothing(&[of("a", [0.9, 1.1]), of("b", [1.1, 1.2])]).ends_with("beyond noise: b."));
    }

    #[test]
    fn mean_colors_use_linear_light() {
        let texture = |encoding, texels: &[[u8; 4]]| Texture {
            name: String::new(),
            width: texels.len().try_into().unwrap(),
            height: 1,
            texels: texels.to_vec(),
            encoding,
            wrap: [Wrap::Repeat; 2],
            magnification: canted_scene::Magnification::Linear,
        };
        let texels = [[0, 255, 188, 0], [255, 255, 188, 255]];
        assert_eq!(mean_color(&texture(Encoding::Linear, &texels)), [0.5, 1.0, 188.0 / 255.0]);
        let [red, green, blue] = mean_color(&texture(Encoding::Srgb, &texels));
        assert!(red == 0.5 && green == 1.0 && (blue - 0.503).abs() < 0.001, "{red} {green} {blue}");
        assert_eq!(mean_color(&texture(Encoding::Srgb, &[])), [1.0; 3]);
    }

    #[test]
    fn the_scene_without_textures_has_none() {
        let subject = without_textures().unwrap();
        assert!(subject.textured.materials.iter().all(|material| material.textures().next().is_none()));
    }
}
