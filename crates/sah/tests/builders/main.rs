//! Builders of binary trees, and the entry point to all of them: on soups, grids, lattices, needles, duplicates and boxes of any
//! scale. Not covered: traced rays.

mod grouped;
mod inputs;
mod ploc;
mod reinsertion;
mod spatial;
mod top_down;

use canted_fixtures as fixtures;
use canted_obb::Aabb;
use canted_sah::{Builder, PlocConfig, ReinsertConfig, TopDownConfig, build};

use crate::inputs::{boxes, checked, corners, degenerate};

const BUILDERS: [Builder; 7] = [
    Builder::Lbvh,
    Builder::Reinserted(ReinsertConfig::FAST),
    Builder::FAST,
    Builder::BALANCED,
    Builder::QUALITY,
    Builder::TopDown(TopDownConfig::BINNED, None),
    Builder::TopDown(TopDownConfig::SWEEP, Some(ReinsertConfig::BALANCED)),
];

fn bounds(boxes: &[Aabb]) -> Aabb {
    boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb))
}

#[test]
fn every_builder_handles_degenerate_meshes() {
    for (name, corners) in degenerate() {
        let boxes = boxes(&corners);
        for builder in BUILDERS {
            let (stats, _) = checked(&build(&boxes, &bounds(&boxes), &builder), &boxes);
            assert_eq!(stats.n_leaves, boxes.len(), "{name}, {builder:?}");
        }
    }
    for builder in BUILDERS {
        for n in 0..3 {
            let boxes = boxes(&corners(&fixtures::soup(1, n)));
            checked(&build(&boxes, &bounds(&boxes), &builder), &boxes);
        }
    }
}

#[test]
fn slower_presets_have_lower_cost() {
    for mesh in [fixtures::scaffold(1, true), fixtures::truss(4)] {
        let boxes = boxes(&corners(&mesh));
        let cost = |builder: &Builder| checked(&build(&boxes, &bounds(&boxes), builder), &boxes).1.sah;
        let [lbvh, fast, balanced, quality] =
            [Builder::Lbvh, Builder::FAST, Builder::BALANCED, Builder::QUALITY].map(|builder| cost(&builder));
        assert!(fast < lbvh && balanced < fast && quality < balanced, "{lbvh} {fast} {balanced} {quality}");
        let near = Builder::Ploc(PlocConfig::NEAR, Some(ReinsertConfig::FAST));
        assert!(cost(&near) < fast);
    }
}
