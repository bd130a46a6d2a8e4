//! Kernels: errors of `t`, `u`, `v` and wrong answers compared with exact fractions, and the cost of a test.

mod boxes;
mod contest;
mod device;
mod lanes;
mod triangles;

use anyhow::Result;

use super::model::Chapter;
use crate::report::model::Effort;
use device::Device;

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let title = "Kernels: errors and wrong answers compared with exact fractions";
    let mut chapter = Chapter { id: "kernels", title, ..Chapter::default() };
    let rounds = effort.pick(2, 7, 15);
    let (_, missing) = lanes::paths();
    chapter.skipped =
        missing.iter().map(|path| format!("the path {}, which this machine lacks", path.name())).collect();
    chapter.skipped.push(ORIENTED_NODES.to_owned());
    let device = Device::open(effort, &mut chapter.skipped);
    let triangles::Found { tables, plots, says } = triangles::measure(effort, rounds, device.as_ref())?;
    chapter.tables.extend(tables);
    chapter.plots.extend(plots);
    let of_boxes = boxes::measure(effort.pick(1, 6, 6), rounds, device.as_ref())?;
    chapter.tables.push(of_boxes.table);
    chapter.plots.extend(of_boxes.plots);
    chapter.tables.push(lanes::measure(effort, rounds, device.as_ref())?);
    chapter.set_sentences(says.into_iter().chain(of_boxes.says));
    chapter.method = METHOD.map(str::to_owned).to_vec();
    Ok(chapter)
}

/// A case without a public function.
const ORIENTED_NODES: &str = "oriented boxes eight at a time, on paths and on devices: only triangle BVHs have oriented nodes, \
    chosen by cost; the chapters on hierarchies and unused features measure such BVHs";

const METHOD: [&str; 7] = [
    "The truth is the exact solution in fractions for the bits of the ray and the triangle. An answer is wrong if it is a hit and \
     the truth is a miss, or the reverse; triangles are closed, so rays through an edge are hits. The error of t is in units in the \
     last place of the true value, that of u and v in units of 2^-24. An f32 kernel cannot be right for all such rays: near an edge \
     the shear of the watertight kernel moves vertices by a few roundings, equally for all neighbors, so nothing leaks. The chapter \
     on extremes lists the promises. If t is nearly zero, as with an origin on the triangle, its units are so small that their \
     number means little.",
    "Times are of one thread, one test after another; triangle records and per-ray values are computed before. All tests on the \
     processor run in turn, round by round, after a warm-up. Points are medians, bars reach from minimum to maximum.",
    "'Möller, Trumbore' and 'Baldwin, Weber' are ours: each has its own f32 filter, and both share the exact f64 test of what passes \
     it. So their errors and answers are the same, and only their times differ.",
    "Paths test eight triangles or boxes at once. Their answers are of BVHs of one triangle each, asserted to equal the single \
     watertight test bit for bit; their times are of rays through leaves of 32 triangles of the case, divided by 32, including the \
     preparation of the ray. Boxes are in nodes of eight boxes of the case: the test only reports whether a ray enters its box, and \
     the scalar path may differ from others by one rounding of a product and a sum.",
    "On a device each ray has its own BVH: a leaf of one triangle, or a node of eight equal boxes, tested by the code of the \
     traversal alone. WGSL does not guarantee rounding to nearest, so a device hits whatever the processor hits and everything \
     within a stated bound of it (`shared/triangle.wgsl`): rays that miss an edge, a vertex or a sliver by less are wrong hits. Some \
     rays that begin within that bound of a triangle, or run in its plane, are wrong misses; numbers below 4e-36 may flush to zero. \
     Times are by the device's own clock if it has one, with enough rays to occupy all units: they measure throughput, not latency. \
     A software driver uses all processor threads.",
    "Each box test is compared with the truth of its own box, oriented or axis-aligned. 'lost' are rays that hit the box but are \
     reported as misses, which must never happen; 'enters' are rays that miss the box but enter it because of its padding. Most \
     cases aim at the box, so that misses are within a rounding; the last three pass an oriented box at a distance. The error of an \
     entry is that of `t` for rays that begin outside; ours enter early by their padding.",
    "The table of one leaf measures complete calls: on a device they include uploading rays and downloading hits.",
];
