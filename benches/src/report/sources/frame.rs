//! Pictures of the sources: flaws of the dissertation's six (its 4.4), and where the time of a frame goes (Novak's chapter 4, the BIH thesis's
//! 2.1).

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use canted_renderer::{
    HitFilter, LightSampler, Lights, Pattern, Sampler, SceneBvh, SceneBvhConfig, Settings, Surface, Surfaces, View,
    frame, render,
    sampling::{Basis, cosine_hemisphere},
};
use canted_scene::Scene;
use canted_trace::{Hit, Intersect, Ray};
use glam::Vec3;

use super::{Found, one_thread};
use crate::{
    blemishes::FACTOR,
    picture::{self, ROWS},
    report::{
        model::{Cell, Chapter, Effort, Table},
        samples::{Samples, number},
    },
    timing,
};

/// Holes and speckle of the six pictures.
pub(super) fn six_pictures(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let [width, height] = effort.pick([32, 18], [320, 180], picture::SIZE);
    let title = format!("Holes and speckle of the dissertation's six pictures (4.4), {width} x {height}, 2 bounces");
    let head = ["theirs", "ours", "samples", "seconds", "not finite", "gaps", "of them lost", "bright", "dark"];
    let mut table = Table::new(title, &head);
    let (mut n_pictures, mut n_flaws, mut n_lacking) = (0, 0, 0);
    for row in &ROWS {
        let scene = if effort == Effort::Tiny { Some(canted_scene::builtin()) } else { picture::lit(row.model)? };
        let Some(scene) = scene else {
            n_lacking += 1;
            continue;
        };
        let rendered = picture::rendered(row, &scene, [width, height])?;
        let found = rendered.blemishes;
        let ours = format!("{}{}", row.model, if row.is_replaced { " (replacement)" } else { "" });
        let counts = [rendered.n_dropped as usize, found.gaps, found.lost, found.bright, found.dark];
        let mut cells =
            [row.theirs.to_owned(), ours, row.samples.to_string(), number(rendered.seconds)].map(Cell::text).to_vec();
        cells.extend(counts.map(|n| Cell::text(n.to_string())));
        table.rows.push(cells);
        n_pictures += 1;
        n_flaws += found.lost + rendered.n_dropped as usize;
    }
    if n_lacking > 0 {
        chapter
            .skipped
            .push(format!("Holes and speckle of {n_lacking} of the six pictures: the models are not available."));
    }
    table.says = format!(
        "The dissertation shows its pictures without such counts. In {n_pictures} pictures here, {n_flaws} pixels or samples are wrong for certain: not finite, or a \
         camera ray that misses what a loop over all triangles hits. Gaps are pixels that see nothing between eight that do, bright and dark ones differ from all \
         eight neighbors by a factor of {FACTOR}: slits of the model, and noise."
    );
    chapter.tables.push(table);
    Ok(Found::default())
}

/// The stages of a frame: with a search, or without.
pub(super) const STAGES: [(&str, bool); 7] = [
    ("camera rays made", false),
    ("camera rays searched", true),
    ("surfaces at their hits", false),
    ("rays to lights and bounces made", false),
    ("rays to lights searched", true),
    ("bounces searched", true),
    ("shading and sums", false),
];

/// A frame in stages, each for all pixels: camera rays, a ray to a light and a bounce from each hit.
pub(super) fn by_stage(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let [width, height] = effort.pick([32, 18], [480, 270], [960, 540]);
    let title = format!(
        "A frame by stage (Novak's figure 4.1, the BIH thesis's 2.1), {width} x {height}, a ray to a light and a bounce from each hit, one thread"
    );
    let mut table = Table::new(title, &["scene", "stage", "rays", "time", "share"]);
    let mut found = vec![];
    for (name, scene) in subjects(effort)? {
        let Some(scene) = scene else {
            chapter.skipped.push(format!("A frame of {name} by stage: the model is not available."));
            continue;
        };
        let (stages, complete) = one_thread(|| measured(&scene, [width, height], effort.pick(1, 3, 5)))??;
        let sum: f64 = stages.iter().map(|(_, ms)| ms.median()).sum();
        let searched =
            STAGES.iter().zip(&stages).filter(|((_, searches), _)| *searches).map(|(_, (_, ms))| ms.median());
        found.push(format!("{name} {:.0}%", 100.0 * searched.sum::<f64>() / sum));
        for ((stage, _), (n_rays, ms)) in STAGES.iter().zip(stages) {
            let share = format!("{:.1}%", 100.0 * ms.median() / sum);
            let n = if n_rays == 0 { "–".to_owned() } else { n_rays.to_string() };
            let [scene, stage, n, share] = [name, stage, &n, &share].map(Cell::text);
            table.rows.push(vec![scene, stage, n, Cell::measured(ms, "ms"), share]);
        }
        let [scene, stage, n, share] = [name, "for comparison: a picture by the renderer", "–", "–"].map(Cell::text);
        table.rows.push(vec![scene, stage, n, Cell::measured(complete, "ms"), share]);
    }
    table.says = format!(
        "Novak's profile, without numbers, has the search for hits as nearly all of a frame; the BIH thesis says 95 %. Here, the search takes: {}. The last row of a \
         scene is a picture of the renderer with one sample and one bounce: it also lights the surface after the bounce, weights samples, filters pixels and keeps tiles.",
        found.join(", ")
    );
    chapter.tables.push(table);
    Ok(Found::default())
}

fn subjects(effort: Effort) -> Result<Vec<(&'static str, Option<Scene>)>> {
    let mut subjects = vec![("built-in", Some(canted_scene::builtin()))];
    if effort != Effort::Tiny {
        subjects.extend([("sponza", picture::sponza()?), ("kitchen", picture::kitchen()?)]);
    }
    Ok(subjects)
}

/// What one ray to a light brings to a pixel.
struct Lit {
    pixel: usize,
    ray: Ray,
    light: canted_renderer::LightId,
    color: Vec3,
}

/// Rays and milliseconds of each of [`STAGES`], and milliseconds of a picture by the renderer.
fn measured(scene: &Scene, [width, height]: [u32; 2], rounds: usize) -> Result<(Vec<(usize, Samples)>, Samples)> {
    let bvh = SceneBvh::build(scene, &SceneBvhConfig::default())?;
    let own = scene.cameras.first().copied();
    let camera = own.unwrap_or_else(|| frame(scene, &bvh, f64::from(width) / f64::from(height)));
    let view = View::new(&camera, width, height)?;
    let settings = Settings { width, height, samples: 1, bounces: 1, ..Settings::default() };
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let (mut n_rays, mut ms, mut complete) = ([0; STAGES.len()], vec![vec![]; STAGES.len()], vec![]);
    for round in 0..=rounds {
        let stages = stages(scene, &surfaces, &bvh, &view, [width, height]);
        let (film, took) =
            timing::time(|| render(scene, &bvh, &camera, &settings, &|_, _| {}, &AtomicBool::new(false)));
        drop(film?);
        if round > 0 {
            complete.push(took.cpu * 1e3);
            for ((n, seconds), (n_rays, ms)) in stages.into_iter().zip(n_rays.iter_mut().zip(&mut ms)) {
                *n_rays = n;
                ms.push(seconds * 1e3);
            }
        }
    }
    Ok((n_rays.into_iter().zip(ms.into_iter().map(Samples::from)).collect(), complete.into()))
}

/// Rays and seconds of each of [`STAGES`], once.
pub(super) fn stages(
    scene: &Scene,
    surfaces: &Surfaces<'_>,
    bvh: &SceneBvh,
    view: &View,
    [width, height]: [u32; 2],
) -> [(usize, f64); STAGES.len()] {
    let lights = LightSampler::new(Lights::new(scene), surfaces);
    let sampler = Sampler::new(Pattern::Stratified, 1, 0);
    let mut took = [0.0; STAGES.len()];
    let mut timed = |stage: usize, work: &mut dyn FnMut()| took[stage] += timing::time(work).1.cpu;
    let filter = HitFilter::new(surfaces);
    let n_pixels = (width * height) as usize;

    let mut rays: Vec<Ray> = Vec::with_capacity(n_pixels);
    timed(0, &mut || {
        rays.extend((0..width * height).map(|i| {
            let [dx, dy] = sampler.pair(i, 0, 0).map(f64::from);
            view.ray([f64::from(i % width) + dx, f64::from(i / width) + dy])
        }));
    });
    let mut hits: Vec<Option<Hit>> = vec![None; n_pixels];
    let search = |rays: &[Ray], hits: &mut [Option<Hit>], number: u32| {
        let keyed = filter.keyed(number);
        rays.iter().zip(hits).for_each(|(ray, hit)| *hit = bvh.closest_hit_with(ray, &mut { keyed }));
    };
    timed(1, &mut || search(&rays, &mut hits, 0));
    let mut seen: Vec<(usize, Surface)> = vec![];
    timed(2, &mut || {
        let found = hits.iter().zip(&rays).enumerate();
        seen.extend(
            found.filter_map(|(i, (hit, ray))| Some((i, surfaces.at_ray(&(*hit)?, ray, view.cone([0.5; 2], 0))))),
        );
    });
    let (mut lit, mut bounces): (Vec<Lit>, Vec<Ray>) = (vec![], vec![]);
    timed(3, &mut || {
        for (pixel, surface) in &seen {
            let number = *pixel as u32;
            let albedo = Vec3::from(surface.bsdf.albedo());
            let normal = surface.shading_normal.map(|x| x as f32);
            let light = lights.sample(surface, false, sampler.single(number, 0, 1), sampler.pair(number, 0, 2));
            lit.extend(light.and_then(|light| {
                let cosine = Vec3::from(normal).dot(light.to_light.into()).max(0.0);
                let color = albedo * Vec3::from(light.radiance) * (cosine / std::f32::consts::PI);
                Some(Lit { pixel: *pixel, ray: light.shadow_ray?, light: light.light, color })
            }));
            let direction = Basis::about(normal).direction(cosine_hemisphere(sampler.pair(number, 0, 3)));
            bounces.push(surface.spawn_ray(surface.mirror_outward(direction)));
        }
    });
    let mut is_lit = vec![false; lit.len()];
    timed(4, &mut || {
        let keyed = filter.keyed(1);
        for (lit, is_lit) in lit.iter().zip(&mut is_lit) {
            *is_lit = lights.lights().is_unoccluded(&lit.ray, lit.light, bvh, &mut { keyed });
        }
    });
    let mut hits_of_bounces = vec![None; bounces.len()];
    timed(5, &mut || search(&bounces, &mut hits_of_bounces, 2));
    let mut picture = vec![Vec3::ZERO; n_pixels];
    timed(6, &mut || {
        let own = rays.iter().zip(&hits).zip(&mut picture);
        own.for_each(|((ray, hit), color)| add_light(color, &lights, ray, hit.as_ref(), Vec3::ONE));
        for (lit, _) in lit.iter().zip(&is_lit).filter(|(_, is_lit)| **is_lit) {
            picture[lit.pixel] += lit.color;
        }
        for (((pixel, surface), ray), hit) in seen.iter().zip(&bounces).zip(&hits_of_bounces) {
            add_light(&mut picture[*pixel], &lights, ray, hit.as_ref(), surface.bsdf.albedo().into());
        }
    });
    std::hint::black_box(picture);
    let n_rays = [n_pixels, n_pixels, 0, lit.len() + bounces.len(), lit.len(), bounces.len(), 0];
    std::array::from_fn(|i| (n_rays[i], took[i]))
}

/// Adds the light that a ray finds where it hits no triangle.
fn add_light(color: &mut Vec3, lights: &LightSampler<'_>, ray: &Ray, hit: Option<&Hit>, weight: Vec3) {
    if let Some(light) = lights.lights().intersect(ray, hit) {
        *color += weight * Vec3::from(light.radiance);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_a_camera_ray_and_every_hit_a_bounce() {
        let scene = canted_scene::builtin();
        let (stages, complete) = measured(&scene, [16, 9], 1).unwrap();
        let n: Vec<usize> = stages.iter().map(|(n, _)| *n).collect();
        assert_eq!((n[0], n[1]), (144, 144));
        assert!(n[5] > 0 && n[5] <= 144 && n[3] == n[4] + n[5], "{n:?}");
        assert!(stages.iter().all(|(_, ms)| ms.median() >= 0.0) && complete.median() > 0.0);
    }
}
