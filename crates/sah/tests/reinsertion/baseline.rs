//! Costs compared with the medium trees of `obvhs`, which also use reinsertion.
use std::{path::PathBuf, time::Duration};

use canted_fixtures as fixtures;
use canted_lbvh::{Child, ChildKind, Corners, NodeId, Tree};
use canted_obb::Aabb;
use canted_sah::{PlocConfig, ReinsertConfig, reinsert};
use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2};

use crate::{
    build::{corners, leaf_boxes},
    ploc::ploc_tree,
};

/// Maximum cost relative to the baseline.
const MAX_RATIO: f64 = 1.05;

fn obvhs_tree(corners: &[Corners]) -> Tree {
    let boxes: Vec<_> =
        corners.iter().map(|c| obvhs::aabb::Aabb::from_points(&c.map(glam::Vec3A::from_array))).collect();
    let params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
    let bvh = build_bvh2(&boxes, params, &mut Duration::default());
    let (mut children, mut inner) = (vec![], vec![0]);
    while let Some(&node) = inner.get(children.len()) {
        let first = bvh.nodes[node as usize].first_index;
        children.push([first, first + 1].map(|child| {
            let node = &bvh.nodes[child as usize];
            if node.is_leaf() {
                return Child::leaf(bvh.primitive_indices[node.first_index as usize]);
            }
            inner.push(child);
            Child::inner(NodeId(u32::try_from(inner.len()).unwrap() - 1))
        }));
    }
    Tree::from_children(&children).unwrap()
}

/// Sum of the areas of the inner nodes over that of the root.
fn cost(tree: &Tree, corners: &[Corners]) -> f64 {
    let leaves = leaf_boxes(tree, corners);
    let mut boxes = vec![Aabb::EMPTY; tree.nodes.len()];
    for &id in &tree.bottom_up {
        let node = tree.nodes[id.index()];
        let [left, right] = [node.left, node.right].map(|child| match child.kind() {
            ChildKind::Leaf(position) => leaves[position as usize],
            ChildKind::Inner(below) => boxes[below.index()],
        });
        boxes[id.index()] = left.union(right);
    }
    boxes.iter().map(Aabb::area).sum::<f64>() / boxes[0].area()
}

fn compare(corners: &[Corners]) {
    let tree = ploc_tree(corners, &PlocConfig::default());
    let ours = cost(&reinsert(&tree, &leaf_boxes(&tree, corners), &ReinsertConfig::FAST), corners);
    let baseline = cost(&obvhs_tree(corners), corners);
    assert!(ours <= MAX_RATIO * baseline, "{ours} vs {baseline}");
}

#[test]
fn near_the_baseline_on_terrain() {
    compare(&corners(&fixtures::grid(5, [120, 120])));
}

/// Triangles of the Sponza OBJ file if it is available.
fn sponza() -> Option<Vec<Corners>> {
    let folder = std::env::var_os("CANTED_SCENES")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes")), PathBuf::from);
    let text = std::fs::read(folder.join("sponza/sponza.obj")).ok()?;
    let (mut points, mut triangles) = (vec![], vec![]);
    for line in String::from_utf8_lossy(&text).lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let xyz: Vec<f32> = words.map(|word| word.parse().unwrap()).collect();
                points.push([xyz[0], xyz[1], xyz[2]]);
            }
            Some("f") => {
                let index = |word: &str| word.split('/').next().unwrap().parse::<usize>().unwrap() - 1;
                let face: Vec<_> = words.map(|word| points[index(word)]).collect();
                triangles.extend((2..face.len()).map(|i| [face[0], face[i - 1], face[i]]));
            }
            _ => {}
        }
    }
    Some(triangles)
}

#[test]
fn near_the_baseline_on_sponza() {
    match sponza() {
        Some(corners) => compare(&corners),
        None => assert!(std::env::var_os("CANTED_SCENES").is_none(), "no sponza/sponza.obj in CANTED_SCENES"),
    }
}
