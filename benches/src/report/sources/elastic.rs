//! A falling elastic body by stage of a frame (the BIH thesis's 4.3).

use anyhow::Result;
use canted_gpu::{AdapterKind, Choice, Gpu, block_on};
use canted_renderer::{Settings, Surfaces, UpdateOptions, UpdatePolicy, View, traced_scene};
use elastic::{Material, Simulation, torus};

use super::{
    Found,
    frame::{STAGES, stages},
    one_thread,
};
use crate::{
    report::{
        model::{Cell, Chapter, Effort, Table},
        samples::Samples,
    },
    timing,
};

/// What is done for a frame, in order; the last two are by resolution.
const NAMES: [&str; 7] =
    ["simulation", "surface and normals", "refit", "rebuild", "upload to a device", "rays", "making rays and shading"];

/// Frames per second of the body.
const FPS: f64 = 24.0;

/// A falling ring: simulation, normals, update of the BVH, upload, rays, shading.
pub(super) fn by_stage(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let sizes = effort.pick(&[[32, 18]][..], &[[640, 360]], &[[640, 360], [1920, 1080]]);
    let segments = effort.pick([24, 8], [96, 32], [192, 64]);
    let gpu = block_on(Gpu::open(&Choice::Best)).ok();
    let mut table = Table::new(
        "A falling elastic body by stage of a frame (the BIH thesis's 4.3), one thread",
        &["triangles", "stage", "picture", "time"],
    );
    let (n_triangles, ms) = one_thread(|| measured(segments, sizes, gpu.as_ref(), effort.pick(2, 8, 24)))??;
    let medians = ms.iter().map(|(stage, size, ms)| (*stage, *size, ms.median())).collect::<Vec<_>>();
    for (stage, size, ms) in ms {
        let size = size.map_or_else(|| "–".to_owned(), |[width, height]| format!("{width} x {height}"));
        let [n, stage, size] = [&n_triangles.to_string(), NAMES[stage], &size].map(Cell::text);
        table.rows.push(vec![n, stage, size, Cell::measured(ms, "ms")]);
    }
    let on = match gpu.as_ref().map(|gpu| gpu.info().kind == AdapterKind::Software) {
        Some(true) => "The device is a software driver, which copies in memory.",
        Some(false) => "The device has memory of its own.",
        None => "There is no device.",
    };
    let of = |stage: usize| medians.iter().filter(move |(own, ..)| *own == stage).map(|(_, _, ms)| *ms);
    let pictures: f64 = of(5).zip(of(6)).map(|(rays, shading)| rays + shading).fold(0.0, f64::max);
    let moving: f64 = of(0).chain(of(1)).chain(of(2)).sum();
    table.says = format!(
        "The thesis has no such table. Here, moving the body and its BVH by a refit takes {:.0} % of the time of the largest picture. {on}",
        100.0 * moving / pictures
    );
    chapter.tables.push(table);
    Ok(Found::default())
}

/// Milliseconds of a stage in each frame, and the size of the picture where it depends on that.
type Stage = (usize, Option<[u32; 2]>, Samples);

/// The number of triangles, and the stages in the order of [`NAMES`].
fn measured(segments: [u32; 2], sizes: &[[u32; 2]], gpu: Option<&Gpu>, n_frames: usize) -> Result<(usize, Vec<Stage>)> {
    let mesh = torus([0.45, 0.2], segments, 1.25, 0.5);
    let mut simulation = Simulation::new(&mesh, 0.08, &Material::RUBBER)?;
    let mut ms: Vec<Vec<f64>> = vec![vec![]; 5 + 2 * sizes.len()];
    for _ in 0..n_frames {
        let mut timed = |stage: usize, took: timing::Seconds| ms[stage].push(took.cpu * 1e3);
        let (stepped, took) = timing::time(|| simulation.step(1.0 / FPS));
        stepped?;
        timed(0, took);
        timed(1, timing::time(|| simulation.carry()).1);
        // The rebuild is last, so that each refit is one of a new BVH.
        for (stage, policy) in [(2, UpdatePolicy::Refit), (3, UpdatePolicy::Rebuild)] {
            let options = UpdateOptions { policy, ..UpdateOptions::default() };
            let (updated, took) = timing::time(|| simulation.prepared.update(&simulation.scene, &options));
            updated?;
            timed(stage, took);
        }
        let (scene, bvh) = (&simulation.scene, &simulation.prepared);
        if let Some(gpu) = gpu {
            let (uploaded, took) = timing::time(|| traced_scene(gpu, scene, bvh));
            drop(uploaded?);
            ms[4].push(took.wall * 1e3);
        }
        let surfaces = Surfaces::with_lod(scene, Settings::default().lod);
        for (number, &[width, height]) in sizes.iter().enumerate() {
            let view = View::new(&scene.cameras[0], width, height)?;
            let seconds = stages(scene, &surfaces, bvh, &view, [width, height]);
            let sum = |searches: bool| -> f64 {
                let own = STAGES.iter().zip(seconds).filter(|((_, is_search), _)| *is_search == searches);
                own.map(|(_, (_, seconds))| seconds * 1e3).sum()
            };
            ms[5 + 2 * number].push(sum(true));
            ms[6 + 2 * number].push(sum(false));
        }
    }
    let stage = |(i, ms): (usize, Vec<f64>)| match i.checked_sub(5) {
        None => (i, None, Samples::from(ms)),
        Some(of_picture) => (5 + of_picture % 2, Some(sizes[of_picture / 2]), Samples::from(ms)),
    };
    Ok((mesh.triangles.len(), ms.into_iter().enumerate().filter(|(_, ms)| !ms.is_empty()).map(stage).collect()))
}
