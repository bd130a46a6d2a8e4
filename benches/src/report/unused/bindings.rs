//! The bindings of a picture's kernel on a device, for the plain scene and with features forced in.

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use canted_gpu::{Choice, Gpu};
use canted_renderer::{DevicePicture, Monitor, Surfaces};
use canted_scene::Camera;

use super::{Variant, more, over, settings};
use crate::clock;
use crate::report::{
    effort::Effort,
    model::{Cell, Chapter, Table},
    samples::Samples,
};

/// Adds the bindings of each feature, or the reason why no adapter opens.
pub(super) fn add(
    chapter: &mut Chapter,
    name: &str,
    variants: &[Variant],
    camera: &Camera,
    effort: Effort,
) -> Result<()> {
    let gpu = match Gpu::open(&Choice::Best) {
        Ok(gpu) => gpu,
        Err(error) => {
            chapter.skipped.push(format!("{name}, bindings on a device: {error}."));
            return Ok(());
        }
    };
    let settings = settings(effort.pick([8, 8], [32, 18], [64, 36]), 1);
    let surfaces: Vec<Surfaces<'_>> =
        variants.iter().map(|variant| Surfaces::with_lod(&variant.scene, settings.lod)).collect();
    let mut pictures = vec![];
    for (variant, surfaces) in variants.iter().zip(&surfaces) {
        match DevicePicture::new(&gpu, surfaces, &variant.prepared.structure, camera, &settings) {
            Ok(picture) => pictures.push((variant.what, picture)),
            Err(error) => chapter.skipped.push(format!("{name}, {} on a device: {error}.", variant.what)),
        }
    }
    let mut ms: Vec<Vec<f64>> = vec![vec![]; pictures.len()];
    // The driver compiles in round 0.
    for round in 0..=effort.pick(2, 5, 11) {
        for ((_, picture), ms) in pictures.iter().zip(&mut ms) {
            let monitor = Monitor { progress: &|_, _| {}, finished: &|_| {}, cancel: &AtomicBool::new(false) };
            let (film, took) = clock::time(|| picture.render(vec![], &monitor));
            film?;
            if round > 0 {
                ms.push(took.wall * 1e3);
            }
        }
    }
    let title = format!("{name}: bindings of the picture's kernel on {} ({})", gpu.info().name, gpu.info().kind);
    let mut table = Table::new(
        title,
        &[
            "feature",
            "bindings",
            "bytes",
            "additional bytes",
            "not in the plain scene",
            "picture",
            "over the plain scene",
        ],
    );
    let ms: Vec<Samples> = ms.into_iter().map(Samples::from).collect();
    let Some(bare) = pictures.first().map(|(_, picture)| picture.buffers()) else { return Ok(()) };
    let sum = |buffers: &[(&str, u64)]| buffers.iter().map(|(_, n_bytes)| n_bytes).sum::<u64>();
    for (i, ((what, picture), ms_of_one)) in pictures.iter().zip(&ms).enumerate() {
        let buffers = picture.buffers();
        let is_new = |name: &&str| bare.iter().all(|(known, _)| known != name);
        let new: Vec<&str> = buffers.iter().map(|(name, _)| *name).filter(is_new).collect();
        table.rows.push(vec![
            Cell::text(*what),
            Cell::text(buffers.len().to_string()),
            Cell::text(sum(&buffers).to_string()),
            Cell::text(format!("{:+}", more(sum(&buffers), sum(&bare)))),
            Cell::text(if new.is_empty() { "–".to_owned() } else { new.join(", ") }),
            Cell::measured(ms_of_one.clone(), "ms"),
            Cell::text(if i == 0 { "–".to_owned() } else { over(ms_of_one, &ms[0]) }),
        ]);
    }
    chapter.tables.push(table);
    Ok(())
}
