//! Leaning boxes of nodes contain what is below them, exactly, and have about the area of the CPU's.

use canted_gpu::{
    Gpu,
    build::{BuildConfig, Built, Range, Run, STRATEGIES},
};
use canted_lbvh::{self as lbvh, Bits, Corners, Strategy, VolumeConfig};
use canted_obb::{Aabb, Obb};
use rayon::prelude::*;

use crate::setup::{Twin, gpu, items, meshes, needles, twins};

/// Boxes of one mesh's nodes, read back.
struct Boxes<'a> {
    aabbs: &'a [Aabb],
    obbs: &'a [Obb],
}

/// Builds the meshes, and looks at the boxes of each beside its twin.
fn with_boxes(gpu: &Gpu, twins: &[Twin], strategy: Strategy, look: impl Fn(usize, &Twin, Boxes<'_>)) {
    let config = BuildConfig { bits: Bits::B63, strategy };
    let built = Built::new(&mut Run::new(gpu), items(gpu, twins), config).unwrap();
    let aabbs = gpu.read(&built.aabbs).unwrap();
    let obbs = built.obbs.as_ref().map_or_else(Vec::new, |obbs| gpu.read(obbs).unwrap());
    for (index, (twin, &Range { first, .. })) in twins.iter().zip(built.items.ranges()).enumerate() {
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

#[test]
fn leaning_boxes_contain_all_below_them() {
    let Some(gpu) = gpu("leaning_boxes_contain_all_below_them") else { return };
    let meshes = [meshes(), needles()].concat();
    let twins = twins(&meshes, Bits::B63);
    for strategy in &STRATEGIES[1..] {
        assert_contained(&gpu, &twins, *strategy, "generated");
    }
}

/// How much more area, summed over a tree's nodes, device boxes may have: their pads of some 2^-18 of the size each, up to forty
/// one upon another, and on thin boxes axes that were rounded otherwise.
const MORE_AREA: f64 = 0.01;

#[test]
fn leaning_boxes_have_the_area_of_the_cpus() {
    let Some(gpu) = gpu("leaning_boxes_have_the_area_of_the_cpus") else { return };
    let twins = twins(&needles(), Bits::B63);
    for strategy in &STRATEGIES[1..] {
        with_boxes(&gpu, &twins, *strategy, |index, twin, boxes| {
            let cpu = lbvh::volumes(&twin.tree, &twin.leaves(), &VolumeConfig { strategy: *strategy, fallback: true });
            let ids = || (0..).zip(&twin.tree.nodes).map(|(id, _)| lbvh::NodeId(id));
            let cpu: f64 = ids().map(|id| cpu.of(id).area()).sum();
            let axis_aligned: f64 = boxes.aabbs.iter().map(Aabb::area).sum();
            let device: f64 = boxes.obbs.iter().map(Obb::area).sum();
            assert!(device <= cpu * (1.0 + MORE_AREA), "mesh {index}, {strategy:?}: {device} beside {cpu}");
            assert!(device < 0.95 * axis_aligned, "mesh {index}, {strategy:?} gains nothing");
        });
    }
}

#[test]
fn the_check_sees_a_box_that_is_too_small() {
    let Some(gpu) = gpu("the_check_sees_a_box_that_is_too_small") else { return };
    let twins = twins(&needles()[..1], Bits::B63);
    with_boxes(&gpu, &twins, Strategy::Combined, |_, twin, boxes| {
        let shrunken: Vec<Obb> =
            boxes.obbs.iter().map(|obb| Obb { half: obb.half.map(|half| half * 0.999), ..*obb }).collect();
        assert!(escaped(twin, &twin.leaves(), &shrunken).is_some());
    });
}
