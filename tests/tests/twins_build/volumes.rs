//! Boxes of nodes: the axis-aligned ones equal the CPU's, the leaning ones contain what is below them, exactly, and have about
//! the area of the CPU's.

use canted_gpu::{
    Gpu,
    build::{BuildConfig, Built, Range, Run},
};
use canted_lbvh::{self as lbvh, Bits, Corners, Strategy, VolumeConfig};
use canted_obb::{Aabb, Obb};

use crate::setup::{Twin, gpu, items, large, meshes, needles};

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

/// The first corner that a node's box does not contain.
fn escaped(twin: &Twin, leaves: &[Corners], obbs: &[Obb]) -> Option<String> {
    twin.tree.nodes.iter().zip(obbs).enumerate().find_map(|(index, (node, obb))| {
        let below = &leaves[node.first as usize..=node.last as usize];
        let corner = below.as_flattened().iter().find(|&&corner| !obb.contains(corner))?;
        Some(format!("{corner:?} is not in {obb:?} of node {index}"))
    })
}

#[test]
fn axis_aligned_boxes_are_those_of_the_cpu() {
    let Some(gpu) = gpu("axis_aligned_boxes_are_those_of_the_cpu") else { return };
    let twins: Vec<Twin> = meshes().iter().chain([&large(3, 20_000)]).map(|mesh| Twin::of(mesh, Bits::B63)).collect();
    with_boxes(&gpu, &twins, Strategy::Aabb, |index, twin, boxes| {
        let cpu = lbvh::volumes(&twin.tree, &twin.leaves(), &VolumeConfig::default());
        assert_eq!(boxes.aabbs, cpu.aabbs, "mesh {index}");
    });
}

const LEANING: [Strategy; 3] = [Strategy::PcaBounded, Strategy::Quaternion, Strategy::Combined];

#[test]
fn leaning_boxes_contain_all_below_them() {
    let Some(gpu) = gpu("leaning_boxes_contain_all_below_them") else { return };
    let twins: Vec<Twin> = meshes().iter().chain(&needles()).map(|mesh| Twin::of(mesh, Bits::B63)).collect();
    for strategy in LEANING {
        with_boxes(&gpu, &twins, strategy, |index, twin, boxes| {
            assert_eq!(boxes.obbs.len(), twin.tree.nodes.len());
            let escaped = escaped(twin, &twin.leaves(), boxes.obbs);
            assert!(escaped.is_none(), "mesh {index}, {strategy:?}: {}", escaped.unwrap_or_default());
        });
    }
}

/// How much more area, summed over a tree's nodes, device boxes may have: their pads of some 2^-18 of the size each, up to forty
/// one upon another, and on thin boxes axes that were rounded otherwise.
const MORE_AREA: f64 = 0.01;

#[test]
fn leaning_boxes_have_the_area_of_the_cpus() {
    let Some(gpu) = gpu("leaning_boxes_have_the_area_of_the_cpus") else { return };
    let twins: Vec<Twin> = needles().iter().map(|mesh| Twin::of(mesh, Bits::B63)).collect();
    for strategy in LEANING {
        with_boxes(&gpu, &twins, strategy, |index, twin, boxes| {
            let cpu = lbvh::volumes(&twin.tree, &twin.leaves(), &VolumeConfig { strategy, fallback: true });
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
    let twins: Vec<Twin> = needles()[..1].iter().map(|mesh| Twin::of(mesh, Bits::B63)).collect();
    with_boxes(&gpu, &twins, Strategy::Combined, |_, twin, boxes| {
        let shrunken: Vec<Obb> =
            boxes.obbs.iter().map(|obb| Obb { half: obb.half.map(|half| half * 0.999), ..*obb }).collect();
        assert!(escaped(twin, &twin.leaves(), &shrunken).is_some());
    });
}
