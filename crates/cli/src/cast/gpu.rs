//! Rays traced on the GPU. The CPU traces the rays whose traversal the GPU cuts short.

use anyhow::Result;
use canted_gpu::{self as gpu, DeviceHit, Gpu, GpuError, TracedScene};
use canted_renderer::{Structure, traced_scene};
use canted_scene::Scene;
use canted_trace::Ray;
use canted_wide::LaneKernel;
use rayon::prelude::*;

use super::{Args, hits::Answer};
use crate::device::{Machine, check_triangles};

/// The scene on the GPU; `None` where the CPU traces all rays.
pub(super) fn upload<K: LaneKernel>(
    machine: &Machine,
    scene: &Scene,
    structure: &Structure<K>,
    args: &Args,
) -> Result<Option<TracedScene>> {
    machine.ready(|gpu| {
        check_triangles(args.structure.triangles)?;
        traced_scene(gpu, scene, structure)
    })
}

/// Traces all rays. `on_cpu` traces those that the GPU does not finish.
pub(super) fn answers(
    gpu: &Gpu,
    traced: &TracedScene,
    scene: &Scene,
    rays: &[Ray],
    is_occlusion: bool,
    on_cpu: impl Fn(&Ray) -> Answer + Sync,
) -> Result<Vec<Answer>, GpuError> {
    if is_occlusion {
        let found = traced.occluded(gpu, rays)?;
        return Ok(completed(rays, &found, |&is_hit| if is_hit { Answer::OCCLUDED } else { Answer::MISS }, on_cpu));
    }
    let answer = |hit: &Option<DeviceHit>| {
        hit.map_or(Answer::MISS, |DeviceHit { t, u, v, primitive, instance }| {
            Answer::hit([t, u, v], primitive, instance, scene)
        })
    };
    Ok(completed(rays, &traced.closest_hits(gpu, rays)?, answer, on_cpu))
}

fn completed<T: Sync>(
    rays: &[Ray],
    found: &[gpu::Outcome<T>],
    answer: impl Fn(&T) -> Answer + Sync,
    on_cpu: impl Fn(&Ray) -> Answer + Sync,
) -> Vec<Answer> {
    let complete = |(ray, found): (&Ray, &gpu::Outcome<T>)| match found {
        gpu::Outcome::Complete(found) => answer(found),
        gpu::Outcome::Incomplete => on_cpu(ray),
    };
    rays.par_iter().zip(found).map(complete).collect()
}
