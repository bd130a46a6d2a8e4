//! The dissertation's six pictures: 1920 x 1080, 2 bounces, 6 to 24 samples (Sabino 2020, figures 14 to 19, on a TITAN Xp).

use std::{fmt::Write, sync::atomic::AtomicBool, time::Instant};

use anyhow::Result;
use canted_renderer::{SceneBvh, SceneBvhConfig, Settings, View, frame, render};
use canted_scene::{Light, Scene};

use crate::{
    blemishes::{Blemishes, FACTOR},
    models,
};

pub(crate) const SIZE: [u32; 2] = [1920, 1080];

/// A picture of the dissertation, and what is rendered in its place.
pub(crate) struct Row {
    pub(crate) theirs: &'static str,
    pub(crate) samples: u32,
    their_seconds: f64,
    /// Our model, named as in [`models`].
    pub(crate) model: &'static str,
    /// Whether their scene is not available and ours is a different one.
    pub(crate) is_replaced: bool,
}

/// In the order of the figures.
pub(crate) const ROWS: [Row; 6] = [
    row("Breakfast room", 24, 300.0, "country_kitchen", true),
    row("Buddha", 6, 14.0, "dragon_res2", true),
    row("Dragon", 16, 24.0, "dragon_871k", false),
    row("Sponza", 24, 132.0, "sponza", false),
    row("Pirate ship", 24, 137.0, "eiffel", true),
    row("Bunny", 24, 15.0, "bunny", false),
];

const fn row(theirs: &'static str, samples: u32, their_seconds: f64, model: &'static str, is_replaced: bool) -> Row {
    Row { theirs, samples, their_seconds, model, is_replaced }
}

/// The measurement of one picture.
pub(crate) struct Rendered {
    n_triangles: usize,
    build_seconds: f64,
    pub(crate) seconds: f64,
    n_rays: u64,
    /// Samples that were not finite.
    pub(crate) n_dropped: u64,
    pub(crate) blemishes: Blemishes,
}

/// Renders each once and writes the section.
pub(crate) fn section(out: &mut String) -> Result<()> {
    let [width, height] = SIZE;
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n## The dissertation's pictures, {width} x {height}, 2 bounces, all threads\n\nRendered once on {} threads, each under a \
         sun and a sky so that every vertex casts a shadow ray, the kitchen under a sky and a lamp. A path is a sample with all its \
         bounces; million rays per second count all rays, including shading and shadow rays. Where their scene is not available, \
         another one replaces it, whose seconds cannot be compared. Gaps: pixels whose central ray misses everything while those of its eight \
         neighbors hit; lost: a loop over all triangles finds a hit. Bright and dark: pixels that differ from all of their neighbors by a factor \
         of {FACTOR}. Theirs: Sabino 2020, on a TITAN Xp.\n\n\
         | theirs | ours | triangles | samples | build | seconds | M paths/s | M rays/s | theirs, seconds | theirs, M paths/s | not finite | gaps and \
         speckle |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        rayon::current_num_threads()
    );
    let mut all = vec![];
    for row in &ROWS {
        let Some(scene) = lit(row.model)? else {
            let _ = writeln!(out, "| {} | {}: not available |", row.theirs, row.model);
            continue;
        };
        let rendered = rendered(row, &scene, SIZE)?;
        out.push_str(&line(row, &rendered));
        all.push((row, rendered));
    }
    let _ = writeln!(out, "\n{}", verdict(&all));
    Ok(())
}

/// Renders a picture of a row in another size, and looks for flaws.
pub(crate) fn rendered(row: &Row, scene: &Scene, [width, height]: [u32; 2]) -> Result<Rendered> {
    let start = Instant::now();
    let prepared = SceneBvh::build(scene, &SceneBvhConfig::default())?;
    let build_seconds = start.elapsed().as_secs_f64();
    let own = scene.cameras.first().copied();
    let camera = own.unwrap_or_else(|| frame(scene, &prepared, f64::from(width) / f64::from(height)));
    let settings = Settings { width, height, samples: row.samples, bounces: 2, ..Settings::default() };
    let start = Instant::now();
    let film = render(scene, &prepared, &camera, &settings, &|_, _| {}, &AtomicBool::new(false))?;
    let seconds = start.elapsed().as_secs_f64();
    let (n_rays, n_dropped) = (film.n_rays(), film.n_dropped());
    let blemishes = Blemishes::of(&film, scene, &prepared, &View::new(&camera, width, height)?)?;
    Ok(Rendered { n_triangles: scene.n_placed_triangles(), build_seconds, seconds, n_rays, n_dropped, blemishes })
}

/// The line of one picture.
fn line(row: &Row, rendered: &Rendered) -> String {
    let [width, height] = SIZE.map(f64::from);
    let paths_millions = width * height * f64::from(row.samples) * 1e-6;
    let &Rendered { n_triangles, build_seconds, seconds, n_rays, n_dropped, blemishes } = rendered;
    let rays_millions = n_rays as f64 * 1e-6;
    let is_replaced = if row.is_replaced { " (replacement)" } else { "" };
    format!(
        "| {} | {}{is_replaced} | {n_triangles} | {} | {build_seconds:.2} | {seconds:.1} | {:.2} | {:.2} | {} | {:.2} | {n_dropped} | {blemishes} |\n",
        row.theirs,
        row.model,
        row.samples,
        paths_millions / seconds,
        rays_millions / seconds,
        row.their_seconds,
        paths_millions / row.their_seconds
    )
}

/// Reports samples that were NaN or infinite, and hits that were lost.
fn verdict(all: &[(&Row, Rendered)]) -> String {
    let broken = |of: &dyn Fn(&Rendered) -> u64| {
        let counts = all.iter().map(|(row, rendered)| (of(rendered), row.model)).filter(|(n, _)| *n > 0);
        counts.map(|(n, model)| format!("{n} of {model}")).collect::<Vec<_>>().join(", ")
    };
    let [not_finite, lost] =
        [broken(&|rendered| rendered.n_dropped), broken(&|rendered| rendered.blemishes.lost as u64)];
    let n = all.len();
    match (not_finite.is_empty(), lost.is_empty()) {
        (true, true) => format!("No sample of these {n} pictures was NaN or infinite, and no gap is a lost hit."),
        (false, _) => format!("ERROR: samples were NaN or infinite: {not_finite}."),
        (true, false) => format!("ERROR: camera rays miss what a loop over all triangles hits: {lost}."),
    }
}

/// A model with suitable lights; `None` if it is not available.
pub(crate) fn lit(model: &str) -> Result<Option<Scene>> {
    match model {
        "sponza" => sponza(),
        "country_kitchen" => kitchen(),
        _ => Ok(models::scene(model)?.map(outside)),
    }
}

/// Direction of the sunlight.
const SUN_DIRECTION: [f32; 3] = [-0.282_166, -0.940_553, -0.188_111];

/// Adds a sun and a sky.
pub(crate) fn outside(scene: Scene) -> Scene {
    let sun = Light::Sun { direction: SUN_DIRECTION, irradiance: [3.0, 2.9, 2.6] };
    Scene { environment: Some([0.6, 0.8, 1.0].into()), lights: vec![sun], ..scene }
}

/// The kitchen with a sphere light under its ceiling; `None` if it is not available.
pub(crate) fn kitchen() -> Result<Option<Scene>> {
    let ball = Light::Sphere { center: [-0.5, 2.4, 3.2], radius: 0.25, radiance: [34.0, 30.0, 24.0] };
    let lit = |scene| Scene { environment: Some([1.5, 1.7, 2.0].into()), lights: vec![ball], ..scene };
    Ok(models::scene("country_kitchen")?.map(lit))
}

/// Sponza under a sun and a sky, so that every vertex casts a shadow ray; `None` if it is not available.
pub(crate) fn sponza() -> Result<Option<Scene>> {
    let sun = Light::Sun { direction: SUN_DIRECTION, irradiance: [20.0, 19.0, 17.0] };
    let lit = |scene| Scene { environment: Some([4.0, 5.0, 6.5].into()), lights: vec![sun], ..scene };
    Ok(models::scene("sponza")?.map(lit))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RENDERED: Rendered = Rendered {
        n_triangles: 7,
        build_seconds: 0.5,
        seconds: 66.0,
        n_rays: 132_000_000,
        n_dropped: 0,
        blemishes: BLEMISHES,
    };

    const BLEMISHES: Blemishes = Blemishes { gaps: 3, lost: 1, bright: 2, dark: 5 };

    #[test]
    fn every_row_names_a_known_model() {
        for row in &ROWS {
            assert!(models::path(row.model).is_ok(), "{}", row.model);
        }
        // The dissertation's million paths per second.
        let rates = ["| 0.17 |", "| 0.89 |", "| 1.38 |", "| 0.38 |", "| 0.36 |", "| 3.32 |"];
        for (row, rate) in ROWS.iter().zip(rates) {
            assert!(line(row, &RENDERED).contains(rate), "{}", line(row, &RENDERED));
        }
    }

    #[test]
    fn a_line_shows_rates_and_replaced_scenes() {
        let text = line(&ROWS[3], &RENDERED);
        assert_eq!(
            text,
            "| Sponza | sponza | 7 | 24 | 0.50 | 66.0 | 0.75 | 2.00 | 132 | 0.38 | 0 | 3, of which 1 lost; 2 bright, 5 dark |\n"
        );
        assert!(line(&ROWS[4], &RENDERED).starts_with("| Pirate ship | eiffel (replacement) |"));
    }

    #[test]
    fn non_finite_samples_and_lost_hits_are_reported() {
        let of = |n_dropped, lost| {
            let blemishes = Blemishes { lost, ..BLEMISHES };
            let rendered = |n_dropped| Rendered { n_dropped, blemishes, ..RENDERED };
            verdict(&[(&ROWS[0], rendered(0)), (&ROWS[5], rendered(n_dropped))])
        };
        assert_eq!(of(0, 0), "No sample of these 2 pictures was NaN or infinite, and no gap is a lost hit.");
        assert!(of(3, 0).contains("3 of bunny"), "{}", of(3, 0));
        assert!(of(0, 2).contains("2 of country_kitchen, 2 of bunny"), "{}", of(0, 2));
    }
}
