//! Whether a picture that stops by noise is as accurate as it claims.

use std::{fmt::Write, sync::atomic::AtomicBool};

use anyhow::{Context, Result};
use canted_film::{Film, Picture, REL_MSE_FLOOR};
use canted_renderer::{Integrator, Pattern, Settings, StructureConfig, prepare, render};
use canted_trace::Watertight;

use crate::bias::example;

const TARGETS: [f32; 3] = [0.1, 0.05, 0.03];
const PATTERNS: [(&str, Pattern); 2] = [("random", Pattern::Random), ("sobol", Pattern::Sobol)];

/// Samples per pixel of the reference: its own error is far below the claimed errors.
const REFERENCE: u32 = 8192;

const SIZE: [u32; 2] = [48, 48];

/// Weights of linear sRGB in luminance, as the film's own.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Renders each target with each pattern and writes the section.
pub(crate) fn section(out: &mut String) -> Result<()> {
    let [width, height] = SIZE;
    let _ = writeln!(
        out,
        "\n## Stopping by noise\n\nThe room of `examples/cornell.toml`, bare and with its glass sphere and mirror, {width} x \
         {height}, `path` with six bounces, at most {REFERENCE} samples per pixel: relative error of luminance that the film claims, \
         and the true error against {REFERENCE} other samples.\n\n\
         | room | sampler | `--noise` | claimed | true | samples per pixel |\n| --- | --- | ---: | ---: | ---: | ---: |"
    );
    let furnished = example("cornell.toml")?;
    let mut bare = furnished.clone();
    // The sphere and the block come last.
    bare.instances.truncate(furnished.instances.len() - 2);
    for (room, scene) in [("bare", bare), ("with glass and mirror", furnished)] {
        let camera = *scene.cameras.first().context("examples/cornell.toml has no camera")?;
        let prepared = prepare::<Watertight>(&scene, &StructureConfig::default())?;
        let base = Settings { width, height, integrator: Integrator::Path, bounces: 6, ..Settings::default() };
        let film = |settings: &Settings| -> Result<Film> {
            Ok(render(&scene, &prepared.structure, &camera, settings, &|_, _| {}, &AtomicBool::new(false))?)
        };
        let truth = Settings { samples: REFERENCE, pattern: Pattern::Stratified, seed: 1, ..base };
        let truth = film(&truth)?.picture();
        for (name, pattern) in PATTERNS {
            for target in TARGETS {
                let film = film(&Settings { samples: REFERENCE, pattern, noise: Some(target), ..base })?;
                #[expect(clippy::cast_precision_loss, reason = "samples are fewer than 2^53")]
                let samples = film.n_samples() as f64 / f64::from(width * height);
                let found = error(&film.picture(), &truth);
                let claimed = film.error();
                let _ = writeln!(out, "| {room} | {name} | {target} | {claimed:.4} | {found:.4} | {samples:.1} |");
            }
        }
    }
    Ok(())
}

/// Root of the mean of `(a - b)² / (b² + ε)` of luminance.
fn error(picture: &Picture, truth: &Picture) -> f64 {
    let luminance = |pixel: &[f32; 3]| -> f64 { pixel.iter().zip(LUMINANCE).map(|(&x, w)| f64::from(x) * w).sum() };
    let squares = picture.pixels.iter().zip(&truth.pixels).map(|(a, b)| {
        let [a, b] = [a, b].map(luminance);
        (a - b).powi(2) / (b * b + REL_MSE_FLOOR)
    });
    #[expect(clippy::cast_precision_loss, reason = "pixels are fewer than 2^53")]
    let n_pixels = truth.pixels.len() as f64;
    (squares.sum::<f64>() / n_pixels).sqrt()
}
