//! Rays traced on the GPU. The CPU traces the rays whose traversal the GPU does not complete.

use std::time::Instant;

use anyhow::Result;
use canted_gpu::{DeviceHit, Outcome};
use canted_renderer::{Structure, traced_scene};
use canted_scene::Scene;
use canted_trace::Ray;
use canted_wide::LaneKernel;
use rayon::prelude::*;

use super::{Args, hits::Answer};
use crate::device::{Machine, named};

/// Traces all rays; also returns the seconds spent tracing. `None` where the CPU traces all rays.
pub(super) fn trace<K: LaneKernel>(
    machine: &Machine,
    scene: &Scene,
    structure: &Structure<K>,
    rays: &[Ray],
    args: &Args,
    on_cpu: impl Fn(&Ray) -> Answer + Sync,
) -> Result<Option<(Vec<Answer>, f64)>> {
    let Some((gpu, traced)) = machine.ready(&args.structure, |gpu| traced_scene(gpu, scene, structure))? else {
        return Ok(None);
    };
    let start = Instant::now();
    let hit = |hit: &Option<DeviceHit>| {
        hit.map_or(Answer::MISS, |DeviceHit { t, u, v, primitive, instance }| {
            Answer::hit([t, u, v], primitive, instance, scene)
        })
    };
    let occluded = |&is_hit: &bool| if is_hit { Answer::OCCLUDED } else { Answer::MISS };
    let answers = if args.occluded {
        traced.occluded(gpu, rays).map(|found| completed(rays, &found, occluded, on_cpu))
    } else {
        traced.closest_hits(gpu, rays).map(|found| completed(rays, &found, hit, on_cpu))
    };
    let answers = answers.map_err(|error| named(gpu, error.into()))?;
    Ok(Some((answers, start.elapsed().as_secs_f64())))
}

fn completed<T: Sync>(
    rays: &[Ray],
    found: &[Outcome<T>],
    answer: impl Fn(&T) -> Answer + Sync,
    on_cpu: impl Fn(&Ray) -> Answer + Sync,
) -> Vec<Answer> {
    let complete = |(ray, found): (&Ray, &Outcome<T>)| match found {
        Outcome::Complete(found) => answer(found),
        Outcome::Incomplete => on_cpu(ray),
    };
    rays.par_iter().zip(found).map(complete).collect()
}
