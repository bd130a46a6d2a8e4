//! Rays against lines with a thickness.

use std::{path::Path, time::Instant};

use anyhow::{Result, anyhow, bail};
use canted_renderer::BvhKind;
use canted_scene::{Lines, ReadOptions};
use canted_trace::{Hit, Intersect as _, Ray, RoundSegment};
use canted_wide::{Config, WideBvh};
use rayon::prelude::*;

use super::{Cost, files::Answer};
use crate::{device::DeviceArg, options::Structure, output};

/// Answers all rays; also returns what tracing took. `prim` numbers the segments, of one instance.
pub(super) fn trace(
    path: &Path,
    options: &ReadOptions,
    rays: &[Ray],
    is_occlusion: bool,
    structure: &Structure,
    device: &DeviceArg,
) -> Result<(Vec<Answer>, Cost)> {
    let config = &structure.config;
    if config.kind != BvhKind::Wide || config.builder.is_some() {
        bail!(
            "{}: lines are traced through a wide BVH by --preset; --accel, --volumes and --builder are for triangles",
            path.display()
        );
    }
    if !matches!(device, DeviceArg::Auto | DeviceArg::Cpu) {
        output::warn("lines are traced on the CPU: a GPU traces triangles");
    }
    let preset = Config::preset(config.preset);
    let preset = if config.aligned { preset.axis_aligned() } else { preset };
    let lines = canted_scene::read_lines(path, options)?;
    lines.warnings.iter().for_each(|warning| output::warn(&format!("{}: {warning}", path.display())));
    let bvh = WideBvh::over_with(segments(&lines), preset).map_err(|error| anyhow!("{}: {error}", path.display()))?;
    let start = Instant::now();
    let answer = |ray: &Ray| {
        if is_occlusion {
            return if bvh.occluded(ray) { Answer::OCCLUDED } else { Answer::MISS };
        }
        let of_hit = |Hit { t, u, v, primitive, .. }: Hit| Answer::of_segment([t, u, v], primitive.0);
        bvh.closest_hit(ray).map_or(Answer::MISS, of_hit)
    };
    let answers = rays.par_iter().map(answer).collect();
    Ok((answers, Cost { seconds: start.elapsed().as_secs_f64(), gpu_exact_rays: None }))
}

/// The round segments of lines, by number.
fn segments(lines: &Lines) -> Vec<RoundSegment> {
    let segment = |ends: &[u32; 2]| RoundSegment {
        ends: ends.map(|i| lines.points[i as usize]),
        radii: ends.map(|i| lines.radii[i as usize]),
    };
    lines.segments.iter().map(segment).collect()
}
