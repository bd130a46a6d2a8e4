//! Rays traced on the GPU.

use std::time::Instant;

use anyhow::{Result, anyhow};
use canted_gpu::{DeviceHit, Gpu, Outcome, TracedScene};
use canted_renderer::DeviceError;
use canted_scene::Scene;
use canted_trace::Ray;
use rayon::prelude::*;

use super::{Args, hits::Answer};
use crate::device::{Machine, named};

/// Traces all rays; also returns the seconds spent tracing. Rays whose traversal the GPU does not complete have no answer. `None`
/// where the CPU traces all rays. `make` brings the scene to the GPU.
pub(super) fn trace(
    machine: &Machine,
    scene: &Scene,
    rays: &[Ray],
    args: &Args,
    make: impl FnOnce(&Gpu) -> Result<TracedScene, DeviceError>,
) -> Result<Option<(Vec<Option<Answer>>, f64)>> {
    let ready = machine.ready(&args.structure, make).map_err(|error| match error.downcast_ref() {
        Some(DeviceError::Prepare(of_scene)) => anyhow!("{}: {of_scene}", args.scene.display()),
        _ => error,
    })?;
    let Some((gpu, traced)) = ready else { return Ok(None) };
    let start = Instant::now();
    let hit = |hit: &Option<DeviceHit>| {
        hit.map_or(Answer::MISS, |DeviceHit { t, u, v, primitive, instance }| {
            Answer::hit([t, u, v], primitive, instance, scene)
        })
    };
    let occluded = |&is_hit: &bool| if is_hit { Answer::OCCLUDED } else { Answer::MISS };
    let answers = if args.occluded {
        traced.occluded(gpu, rays).map(|found| completed(&found, occluded))
    } else {
        traced.closest_hits(gpu, rays).map(|found| completed(&found, hit))
    };
    let answers = answers.map_err(|error| named(gpu, error.into()))?;
    Ok(Some((answers, start.elapsed().as_secs_f64())))
}

fn completed<T: Sync>(found: &[Outcome<T>], answer: impl Fn(&T) -> Answer + Sync) -> Vec<Option<Answer>> {
    let complete = |found: &Outcome<T>| match found {
        Outcome::Complete(found) => Some(answer(found)),
        Outcome::Incomplete => None,
    };
    found.par_iter().map(complete).collect()
}
