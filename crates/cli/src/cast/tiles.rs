//! Rays against a store of tiles.

use std::{path::Path, time::Instant};

use anyhow::{Result, bail};
use canted_renderer::{BvhKind, SceneBvhConfig};
use canted_tiles::{OpenOptions, TiledBvh};
use canted_trace::Ray;

use super::{Cost, files::Answer};
use crate::{device::DeviceArg, options::Structure, output};

/// Answers all rays; also returns what tracing took. `prim` and `instance` are those of the scenes that the store was written from.
pub(super) fn trace(
    path: &Path,
    memory: u64,
    rays: &[Ray],
    is_occlusion: bool,
    structure: &Structure,
    device: &DeviceArg,
) -> Result<(Vec<Answer>, Cost)> {
    let SceneBvhConfig { kind, builder, .. } = structure.config;
    if kind != BvhKind::Wide || builder.is_some() {
        bail!(
            "{}: tiles are wide BVHs that were built before; --accel, --volumes and --builder are for scenes",
            path.display()
        );
    }
    if !matches!(device, DeviceArg::Auto | DeviceArg::Cpu) {
        output::warn("tiles are traced on the CPU: a GPU traces scenes that fit into its memory");
    }
    let bvh = TiledBvh::open(path, OpenOptions { memory, ..OpenOptions::default() })?;
    let start = Instant::now();
    let answers = if is_occlusion {
        let mut occluded = vec![false; rays.len()];
        bvh.try_occluded(rays, &mut occluded)?;
        occluded.into_iter().map(|is_hit| if is_hit { Answer::OCCLUDED } else { Answer::MISS }).collect()
    } else {
        let mut hits = vec![None; rays.len()];
        bvh.try_closest_hits(rays, &mut hits)?;
        let answer = |hit: Option<canted_trace::Hit>| {
            hit.map_or(Answer::MISS, |hit| {
                let (number, instance) = bvh.in_whole(hit.instance, hit.primitive);
                Answer::in_whole([hit.t, hit.u, hit.v], number, instance)
            })
        };
        hits.into_iter().map(answer).collect()
    };
    let seconds = start.elapsed().as_secs_f64();
    let counts = bvh.counts();
    output::detail(|| {
        format!("{} tiles, read {} times, up to {} MiB held", bvh.n_tiles(), counts.reads, counts.most_bytes >> 20)
    });
    Ok((answers, Cost { seconds, gpu_exact_rays: None }))
}
