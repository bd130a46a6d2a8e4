//! What looking up textures costs: Sponza with its colours and without, by how much of a texture a lookup averages; and a scene that
//! has none, where it must cost nothing.

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

/// In the order of the table's columns.
const LODS: [(&str, Lod); 3] = [("none", Lod::None), ("cone", Lod::Cone), ("aniso", Lod::Aniso)];

/// Integrators, and few and many samples a pixel, that take about as long.
const INTEGRATORS: [(&str, Integrator, [u32; 2]); 2] =
    [("hybrid", Integrator::Hybrid, [4, 20]), ("path", Integrator::Path, [2, 10])];

/// What textures may cost: this many times the time without.
const AIM: f64 = 1.15;

/// A scene with its textures and without them, from one place.
struct Subject {
    /// What the names of its rows begin with.
    prefix: &'static str,
    textured: Scene,
    plain: Scene,
    camera: Camera,
}

/// Renders all variants in turn and writes the section.
pub(crate) fn section(out: &mut String, rounds: usize) -> Result<()> {
    out.push_str(
        "\n## Textures\n\nSponza at 320 x 180 from its gallery; \"without\" is the same with the mean colour in place of each \
         colour texture, so that masks, rays under `hybrid` and the lives of paths are the same. The built-in scene has no \
         texture: there all columns are of one scene, and \"without\" is `--lod none` once more. Microseconds of all \
         processors a sample: those of many samples less those of few, so that what is done once for a picture, as making \
         the smaller copies, is no part of them; median (half spread); median ratio to \"without\" of the same round, noise \
         where the interval of that median holds 1.\n\n",
    );
    let mut subjects = vec![without_textures()?];
    match sponza()? {
        Some(scene) => subjects.insert(0, of_sponza(scene)),
        None => out.push_str("Sponza is not at hand.\n\n"),
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
            let told = ratios.map(|((lod, _), with)| (format!("{row}, `{lod}`"), with.over(&microseconds[0])));
            let cells = if subject.prefix.is_empty() { &mut textured } else { &mut plain };
            cells.extend(told);
        }
    }
    if !textured.is_empty() {
        let _ = writeln!(out, "\n{}", of_aim(&textured));
    }
    let _ = writeln!(out, "\n{}", of_nothing(&plain));
    Ok(())
}

/// A row of the table: the first time is the one without textures.
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

/// Whether each cell keeps to the aim, as far as its rounds tell.
fn of_aim(cells: &[(String, Ratio)]) -> String {
    let named = |is: &dyn Fn(&Ratio) -> bool| {
        let names: Vec<&str> = cells.iter().filter(|(_, ratio)| is(ratio)).map(|(name, _)| &name[..]).collect();
        if names.is_empty() { "none".to_owned() } else { names.join("; ") }
    };
    let is_met = |ratio: &Ratio| ratio.interval[1] <= AIM;
    let is_missed = |ratio: &Ratio| ratio.interval[0] > AIM;
    format!(
        "The aim is at most {AIM}x. Met: {}. Missed: {}. The interval holds it: {}.",
        named(&is_met),
        named(&is_missed),
        named(&|ratio| !is_met(ratio) && !is_missed(ratio))
    )
}

/// Whether textures cost a scene without any nothing.
fn of_nothing(cells: &[(String, Ratio)]) -> String {
    let real: Vec<&str> = cells.iter().filter(|(_, ratio)| !ratio.is_noise()).map(|(name, _)| &name[..]).collect();
    if real.is_empty() {
        "Where no surface has a texture they cost nothing: every difference is noise.".to_owned()
    } else {
        format!(
            "Where no surface has a texture they should cost nothing, and differ beyond noise: {}.",
            real.join("; ")
        )
    }
}

/// Microseconds a sample of each round, without textures and then by each way to look them up.
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

/// Mean of a texture's texels in linear light, white where there are none: paths live by what surfaces reflect.
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
    fn a_line_says_what_is_noise() {
        let without = samples([1.0, 1.1, 1.2, 1.0, 1.1]);
        let said = line("a", &[without.clone(), without.scaled(1.25), without.clone()]);
        assert_eq!(said, "| a | 1.10 (±9 %) | 1.38 (±9 %), 1.25x | 1.10 (±9 %), 1.00x, noise |\n");
    }

    #[test]
    fn the_aim_is_met_missed_or_open() {
        let of = |name: &str, interval: [f64; 2]| (name.to_owned(), Ratio { median: interval[0], interval });
        let said = of_aim(&[of("a", [1.0, 1.1]), of("b", [1.1, 1.2]), of("c", [1.2, 1.3]), of("d", [1.15, 1.15])]);
        assert_eq!(said, "The aim is at most 1.15x. Met: a; d. Missed: c. The interval holds it: b.");
    }

    #[test]
    fn what_costs_where_nothing_is_looked_up_is_named() {
        let of = |name: &str, interval: [f64; 2]| (name.to_owned(), Ratio { median: interval[0], interval });
        assert!(of_nothing(&[of("a", [0.9, 1.1])]).ends_with("is noise."));
        assert!(of_nothing(&[of("a", [0.9, 1.1]), of("b", [1.1, 1.2])]).ends_with("beyond noise: b."));
    }

    #[test]
    fn a_mean_is_of_linear_light() {
        let texture = |encoding, texels: &[[u8; 4]]| Texture {
            name: String::new(),
            width: texels.len().try_into().unwrap(),
            height: 1,
            texels: texels.to_vec(),
            encoding,
            wrap: [Wrap::Repeat; 2],
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
