//! Kernels: error of `t`, `u`, `v` and wrong answers against exact fractions, and what a test costs.

mod boxes;
mod contest;
mod device;
mod judge;
mod lanes;
mod nodes;
mod passing;
mod triangles;

use anyhow::Result;

use super::effort::Effort;
use super::model::Chapter;
use device::Device;

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let title = "Kernels: error and wrong answers against exact fractions";
    let mut chapter = Chapter { id: "kernels", title, ..Chapter::default() };
    let rounds = effort.pick(2, 7, 15);
    let (_, missing) = lanes::paths();
    chapter.skipped =
        missing.iter().map(|path| format!("the path {}, which this machine lacks", path.name())).collect();
    chapter.skipped.push(LEANING_NODES.to_owned());
    let device = Device::open(effort, &mut chapter.skipped);
    let triangles::Found { tables, plots, says } = triangles::measure(effort, rounds, device.as_ref())?;
    chapter.tables.extend(tables);
    chapter.plots.extend(plots);
    let of_boxes = boxes::measure(effort.pick(1, 6, 6), rounds, device.as_ref())?;
    chapter.tables.push(of_boxes.table);
    chapter.plots.extend(of_boxes.plots);
    chapter.tables.push(lanes::measure(effort, rounds, device.as_ref())?);
    chapter.tell(says.into_iter().chain(of_boxes.says));
    chapter.method = METHOD.map(str::to_owned).to_vec();
    Ok(chapter)
}

/// What a logarithmic axis shows of no error.
const LEAST_ULPS: f64 = 1e-3;

/// What has no door of its own.
const LEANING_NODES: &str = "leaning boxes eight at a time, on paths and on devices: they stand in trees of triangles alone, which choose \
                             them by cost; whole trees of them are in the chapters of hierarchies and of what was left out";

const METHOD: [&str; 7] = [
    "Truth is the solution of the ray's and the triangle's own bits in fractions. An answer is wrong where it is a hit and the truth is \
     a miss, or the other way; the triangle is closed, so rays through its very edge are hits. The error of t is in units in the last \
     place of the true value, that of u and v in units of 2^-24. An f32 kernel cannot answer all such rays right: near an edge the \
     shear of the watertight kernel moves vertices by a few roundings, all neighbours alike, so nothing leaks. What is promised is in \
     the table of extremes. Where t is nearly nothing, as with an origin on the triangle, its units are so small that their number \
     says little.",
    "Times are of one thread, one test after another; records of triangles and what a kernel computes once for a ray are made before. \
     All that the processor does takes turns, round by round, after a warm-up. Points are medians, bars reach from least to greatest.",
    "'Möller, Trumbore' and 'Baldwin, Weber' are ours: an f32 filter each, and one finish in f64 that decides and computes what either \
     lets pass. So their errors and answers are the same, and they differ in time alone.",
    "Paths test eight triangles or boxes at once. Their answers are of trees of one triangle each, and are asserted to be those of the \
     single watertight test, bit for bit; their times of rays through leaves of 32 triangles of the case, over all 32, making the ray \
     ready included. Boxes are in nodes of eight of the case: a ray enters its own or not, where is not told, and nodes of the scalar \
     path decide as others do but for a product and a sum that may round once or twice.",
    "On a device each ray has a tree of its own: a leaf of one triangle, or a node of eight equal boxes, tested by the code of every walk \
     with no walk around it. WGSL promises no rounding to nearest, so a device hits whatever the processor hits and what comes within a \
     stated bound besides (`shared/triangle.wgsl`): rays that miss an edge, a vertex or a sliver by less are its wrong hits. Of \
     rays that begin within that bound of a triangle, and may begin on either side, or that run in its plane, some are wrong misses; \
     numbers below 4e-36 may be zero to it. Its times are by its own clock where it has one, of all its units at once, over so many \
     rays that they have enough to do: what it gets through, not how long one ray waits. A software driver takes all the processor's \
     threads.",
    "Each test of a box is judged by the box that it is given, leaning or straight: 'lost' are rays that meet it and are told they do \
     not, which is promised never to be; 'enters' are rays that miss it and enter, as a pad lets them. Most cases aim at the box, so \
     that what misses does so by a rounding; the last three pass a leaning box at a distance. The error of an entry is that of `t`, \
     where the ray begins outside; ours enter early by their pad.",
    "The table of one leaf is of whole calls: on a device they include sending rays and fetching hits.",
];
