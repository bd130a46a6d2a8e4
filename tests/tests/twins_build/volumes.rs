//! Oriented boxes of nodes contain everything below them exactly, have no more area than axis-aligned boxes, and about the CPU's
//! area.

use canted_fixtures::device_tests::{Test, needs_device};
use std::cell::Cell;

use canted_gpu::{
    Gpu, block_on,
    build::{BuildConfig, BuildEncoder, Built, Range, STRATEGIES},
};
use canted_lbvh::{self as lbvh, Bits, Corners, Strategy, VolumeConfig};
use canted_obb::{Aabb, Frame, Obb, dop};
use rayon::prelude::*;

use crate::setup::{Twin, gpu, meshes, needles, primitives, twins};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(oriented_boxes_contain_everything_below_them),
        needs_device(oriented_boxes_have_nearly_the_area_of_the_cpus),
        needs_device(no_box_has_more_area_than_the_axis_aligned_one),
        needs_device(the_check_detects_a_box_that_is_too_large),
        needs_device(the_check_detects_a_box_that_is_too_small),
    ]
}

/// Boxes of one mesh's nodes, read back.
struct Boxes<'a> {
    aabbs: &'a [Aabb],
    obbs: &'a [Obb],
}

/// Builds the meshes and calls `look` for the boxes of each, with the CPU's twin.
fn with_boxes(gpu: &Gpu, twins: &[Twin], strategy: Strategy, look: impl Fn(usize, &Twin, Boxes<'_>)) {
    let config = BuildConfig { bits: Bits::B63, strategy };
    let built = Built::new(&mut BuildEncoder::new(gpu), primitives(gpu, twins), config).unwrap();
    let aabbs = block_on(gpu.read(&built.aabbs)).unwrap();
    let obbs = built.obbs.as_ref().map_or_else(Vec::new, |obbs| block_on(gpu.read(obbs)).unwrap());
    for (index, (twin, &Range { first, .. })) in twins.iter().zip(built.primitives.ranges()).enumerate() {
        let slots = first as usize..first as usize + twin.tree.nodes.len();
        look(index, twin, Boxes { aabbs: &aabbs[slots.clone()], obbs: obbs.get(slots).unwrap_or(&[]) });
    }
}

/// A corner that a node's box does not contain.
fn escaped(twin: &Twin, leaves: &[Corners], obbs: &[Obb]) -> Option<String> {
    twin.tree.nodes.par_iter().zip(obbs).enumerate().find_map_first(|(index, (node, obb))| {
        let below = &leaves[node.first as usize..=node.last as usize];
        let corner = below.as_flattened().iter().find(|&&corner| !obb.contains(corner))?;
        Some(format!("{corner:?} is not in {obb:?} of node {index}"))
    })
}

/// Asserts that each node's box contains all corners below it, exactly.
pub(crate) fn assert_contained(gpu: &Gpu, twins: &[Twin], strategy: Strategy, name: &str) {
    with_boxes(gpu, twins, strategy, |index, twin, boxes| {
        assert_eq!(boxes.obbs.len(), twin.tree.nodes.len());
        let escaped = escaped(twin, &twin.leaves(), boxes.obbs);
        assert!(escaped.is_none(), "{name}, mesh {index}, {strategy:?}: {}", escaped.unwrap_or_default());
    });
}

fn oriented_boxes_contain_everything_below_them() {
    let gpu = gpu();
    let meshes = [meshes(), needles()].concat();
    let twins = twins(&meshes, Bits::B63);
    for strategy in &STRATEGIES[1..] {
        assert_contained(&gpu, &twins, *strategy, "generated");
    }
}

/// Greatest excess area of device boxes, summed over a tree's nodes: up to forty nested pads of some 2^-18 of the size each, and
/// differently rounded axes on thin boxes.
const MORE_AREA: f64 = 0.01;

fn oriented_boxes_have_nearly_the_area_of_the_cpus() {
    let gpu = gpu();
    let twins = twins(&needles(), Bits::B63);
    for strategy in &STRATEGIES[1..] {
        with_boxes(&gpu, &twins, *strategy, |index, twin, boxes| {
            let cpu = lbvh::volumes(&twin.tree, &twin.leaves(), &VolumeConfig { strategy: *strategy, fallback: true });
            let ids = || (0..).zip(&twin.tree.nodes).map(|(id, _)| lbvh::NodeId(id));
            let cpu: f64 = ids().map(|id| cpu.of(id).area()).sum();
            let axis_aligned: f64 = boxes.aabbs.iter().map(Aabb::area).sum();
            let device: f64 = boxes.obbs.iter().map(Obb::area).sum();
            assert!(
                device <= cpu * (1.0 + MORE_AREA),
                "mesh {index}, {strategy:?}: {device} on the device, {cpu} on the CPU"
            );
            assert!(device < 0.95 * axis_aligned, "mesh {index}, {strategy:?} gains nothing");
        });
    }
}

/// Greatest error of one rounding on a device, and least lengths: as in `shared/volumes.wgsl`.
const ROUNDING: f64 = f32::EPSILON as f64;
const TINY: f64 = 1e-35;

/// Greatest deviation of axes from orthonormality: what the kernel measures, and 13 roundings of that.
const SKEWNESS: f64 = 1.0 / 1024.0 + 13.0 * ROUNDING;

/// Greatest row sum of `|FᵀF - 1|`.
fn skewness(frame: &Frame) -> f64 {
    let dot = |a: usize, b: usize| (0..3).map(|k| f64::from(frame[a][k]) * f64::from(frame[b][k])).sum::<f64>();
    let row = |a: usize| (0..3).map(|b| (dot(a, b) - f64::from(u8::from(a == b))).abs()).sum::<f64>();
    (0..3).map(row).fold(0.0, f64::max)
}

/// Greatest area of a node's box: that of the axis-aligned box around the same contents, and the kernel's rounding.
///
/// With E the rounding: an axis-aligned box has its center off by E of the coordinates, and half-extents of four roundings beyond
/// their factor of 1 + 4 E: 17 E of an area, including second order. An oriented box was chosen because it has less area, by
/// numbers of at most 3 roundings, 2 more in the extents of the axis-aligned box; `dop` compares once per frame, each time 6 E.
/// Its faces may grow by the skewness of its axes.
fn most_area(aabb: &Aabb, obb: &Obb, n_compared: usize) -> f64 {
    let [x, y, z] = std::array::from_fn(|k| {
        let reach = f64::from(aabb.min[k].abs().max(aabb.max[k].abs()));
        aabb.extent()[k] + 2.0 * (ROUNDING * reach + 2.0 * TINY)
    });
    let roundings = 17.0 + 6.0 * n_compared as f64;
    2.0 * (x * y + y * z + z * x) * (1.0 + roundings * ROUNDING) * (1.0 + skewness(&obb.frame))
}

/// The first node whose box exceeds that area.
fn too_large(boxes: &Boxes<'_>, strategy: Strategy) -> Option<(usize, Obb)> {
    let n_compared = if strategy == Strategy::Dop { dop::N_FRAMES - 1 } else { 1 };
    let is_too_large =
        |(aabb, obb): (&Aabb, &Obb)| skewness(&obb.frame) > SKEWNESS || obb.area() > most_area(aabb, obb, n_compared);
    let index = boxes.aabbs.iter().zip(boxes.obbs).position(is_too_large)?;
    Some((index, boxes.obbs[index]))
}

#[expect(clippy::print_stderr, reason = "the share of axis-aligned boxes is reported")]
fn no_box_has_more_area_than_the_axis_aligned_one() {
    let gpu = gpu();
    let twins = twins(&[meshes(), needles()].concat(), Bits::B63);
    for &strategy in &STRATEGIES[1..] {
        let (n_nodes, n_straight) = (Cell::new(0), Cell::new(0));
        with_boxes(&gpu, &twins, strategy, |index, _, boxes| {
            assert_eq!(too_large(&boxes, strategy), None, "mesh {index}, {strategy:?}");
            let straight = boxes.obbs.iter().filter(|obb| obb.frame == Obb::IDENTITY_FRAME);
            n_straight.set(n_straight.get() + straight.count());
            n_nodes.set(n_nodes.get() + boxes.obbs.len());
        });
        let (n_nodes, n_straight) = (n_nodes.get(), n_straight.get());
        eprintln!("{strategy:?}: {n_straight} of {n_nodes} boxes are axis-aligned");
        assert!(0 < n_straight && n_straight < n_nodes, "{strategy:?}: one kind of box is missing");
    }
}

fn the_check_detects_a_box_that_is_too_large() {
    let gpu = gpu();
    let twins = twins(&needles()[..1], Bits::B63);
    for &strategy in &STRATEGIES[1..] {
        with_boxes(&gpu, &twins, strategy, |_, _, Boxes { aabbs, obbs }| {
            let mut grown = obbs.to_vec();
            // As large as the axis-aligned box, and larger by little more than rounding.
            let factor = (aabbs[5].area() / obbs[5].area()).sqrt() as f32 * (1.0 + 1e-3);
            grown[5].half_extents = grown[5].half_extents.map(|half| half * factor);
            assert_eq!(too_large(&Boxes { aabbs, obbs: &grown }, strategy), Some((5, grown[5])));
            let mut skewed = obbs.to_vec();
            skewed[3].frame[0][1] += 0.01;
            assert_eq!(too_large(&Boxes { aabbs, obbs: &skewed }, strategy), Some((3, skewed[3])));
        });
    }
}

fn the_check_detects_a_box_that_is_too_small() {
    let gpu = gpu();
    let twins = twins(&needles()[..1], Bits::B63);
    with_boxes(&gpu, &twins, Strategy::Combined, |_, twin, boxes| {
        let shrunken: Vec<Obb> = boxes
            .obbs
            .iter()
            .map(|obb| Obb { half_extents: obb.half_extents.map(|half| half * 0.999), ..*obb })
            .collect();
        assert!(escaped(twin, &twin.leaves(), &shrunken).is_some());
    });
}
