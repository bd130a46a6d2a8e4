//! Rays answered by a device, and by the CPU where the device cuts a walk short.

use anyhow::Result;
use canted_gpu::{self as gpu, DeviceHit, Gpu, GpuError, TracedScene};
use canted_renderer::{Structure, traced_scene};
use canted_scene::Scene;
use canted_trace::Ray;
use canted_wide::LaneKernel;
use rayon::prelude::*;

use super::{Args, hits::Answer};
use crate::device::{Machine, check_triangles};

/// The scene on the machine's device; `None` where the CPU answers.
pub(super) fn traced<K: LaneKernel>(
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

/// Answers all rays; `on_cpu` those that the device does not finish.
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
        return Ok(finished(rays, &found, |&is_hit| if is_hit { Answer::OCCLUDED } else { Answer::MISS }, on_cpu));
    }
    let placed = |hit: &Option<DeviceHit>| {
        hit.map_or(Answer::MISS, |DeviceHit { t, u, v, primitive, instance }| {
            Answer::hit([t, u, v], [scene.instances[instance as usize].first_primitive, primitive, instance])
        })
    };
    let found = traced.closest_hits(gpu, rays)?;
    Ok(finished(rays, &found, placed, on_cpu))
}

fn finished<T: Sync>(
    rays: &[Ray],
    found: &[gpu::Outcome<T>],
    known: impl Fn(&T) -> Answer + Sync,
    on_cpu: impl Fn(&Ray) -> Answer + Sync,
) -> Vec<Answer> {
    let answer = |(ray, found): (&Ray, &gpu::Outcome<T>)| match found {
        gpu::Outcome::Complete(found) => known(found),
        gpu::Outcome::Incomplete => on_cpu(ray),
    };
    rays.par_iter().zip(found).map(answer).collect()
}
