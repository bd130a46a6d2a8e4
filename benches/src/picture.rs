//! The dissertation's picture of Sponza: 1920 x 1080, 24 samples, 2 bounces, 132 s on a TITAN Xp.

use std::{fmt::Write, sync::atomic::AtomicBool, time::Instant};

use anyhow::Result;
use canted_renderer::{Settings, StructureConfig, frame, prepare, render};
use canted_scene::{Light, Scene};
use canted_trace::Watertight;

use crate::models;

/// Renders once and writes the section.
pub(crate) fn section(out: &mut String) -> Result<()> {
    out.push_str("\n## Sponza, 1920 x 1080, 24 samples, 2 bounces, all threads\n\n");
    let Some(scene) = sponza()? else {
        out.push_str("Sponza is not at hand.\n");
        return Ok(());
    };
    let start = Instant::now();
    let prepared = prepare::<Watertight>(&scene, &StructureConfig::default())?;
    let build = start.elapsed().as_secs_f64();
    let camera = frame(&scene, &prepared.structure, 1920.0 / 1080.0);
    let settings = Settings { width: 1920, height: 1080, samples: 24, bounces: 2, ..Settings::default() };
    let start = Instant::now();
    let film = render(&scene, &prepared.structure, &camera, &settings, &|_, _| {}, &AtomicBool::new(false))?;
    let seconds = start.elapsed().as_secs_f64();
    #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
    let rate = film.n_rays() as f64 / seconds * 1e-6;
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "{seconds:.1} s for {} M rays on {} threads: {rate:.2} M rays/s, shading and shadow rays included; build {build:.2} s. \
         The dissertation: 132 s.",
        film.n_rays() / 1_000_000,
        rayon::current_num_threads()
    );
    Ok(())
}

/// Sponza under one sun and a sky, so that every vertex casts a shadow ray; `None` where it is not at hand.
pub(crate) fn sponza() -> Result<Option<Scene>> {
    let sun = Light::Sun { direction: [-0.282_166, -0.940_553, -0.188_111], irradiance: [20.0, 19.0, 17.0] };
    let lit = |scene| Scene { environment: Some([4.0, 5.0, 6.5].into()), lights: vec![sun], ..scene };
    Ok(models::scene("sponza")?.map(lit))
}
