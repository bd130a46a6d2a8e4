//! Which binary tree is collapsed, and in which frame its boxes are aligned.

use canted_lbvh::Tree;
use canted_obb::{Aabb, Obb};
use canted_sah::{Builder, PlocConfig};

use crate::collapse::{Areas, Plan};
use crate::config::Config;
use crate::costs::Costs;
use crate::frames::mesh_frame::{self, MeshFrameConfig};
use crate::item::{self, Item};
use crate::measure::{self, Aligned};
use crate::par;

/// A binary tree over primitives and the frame of its boxes.
pub(crate) struct Chosen {
    pub(crate) tree: Tree,
    pub(crate) rows: [[f32; 3]; 3],
    pub(crate) aligned: Aligned,
    /// Brings the largest extent to about 1.
    pub(crate) scale: f32,
}

/// The mesh is rotated where the cost of a quickly built tree falls to this part.
///
/// Quick and full builds agree on eleven scenes with any threshold from 0.85 to 0.89.
const MAX_ROTATED_COST: f32 = 0.87;

/// The alternative builder's tree is taken at this part of the other's cost: closer to 1, the prediction is not reliable.
///
/// A scan just below it traces faster in the alternative tree: `benches/TRIED.md`.
const MAX_ALTERNATIVE_COST: f32 = 0.985;

/// Most primitives of a leaf where trees are compared before their frames are known.
///
/// Larger leaves hide what oriented boxes would separate: where one holds two struts of twelve triangles, a tree that mixes
/// struts has a lower predicted cost and traces slower, as measured in `benches/TRIED.md`.
const MAX_COMPARED_LEAF: usize = 16;

/// Builds the binary tree over `items`, which `bounds` enclose.
pub(crate) fn choose<I: Item>(items: &[I], bounds: &Aabb, config: &Config) -> Chosen {
    let scale = measure::unit_scale(bounds);
    let unrotated = item::boxes(items, Obb::IDENTITY_FRAME);
    let candidates = if config.rotate_mesh {
        mesh_frame::candidates(items.len(), &|i| items[i].edges(), &MeshFrameConfig::default())
    } else {
        vec![]
    };
    let boxes_along = |rows: &[[f32; 3]; 3]| item::boxes(items, *rows);
    let (rows, boxes) = match rotation(candidates, &unrotated, &boxes_along, scale, config) {
        Some(rows) => (rows, boxes_along(&rows)),
        None => (Obb::IDENTITY_FRAME, unrotated),
    };
    let (tree, aligned) = over_boxes(&boxes, scale, config);
    Chosen { tree, rows, aligned, scale }
}

/// Builds the binary tree over boxes in one frame.
fn over_boxes(boxes: &[Aabb], scale: f32, config: &Config) -> (Tree, Aligned) {
    let first = || built(boxes, &config.builder, scale);
    let Some(alternative) = &config.alternative_builder else { return first() };
    // Each has serial parts of its own.
    let (first, alternative) = par::join(first, || built(boxes, alternative, scale));
    let costs = compared(&config.costs);
    let cost = |(tree, aligned): &(Tree, Aligned)| cost(tree, aligned, &costs);
    if cost(&alternative) <= MAX_ALTERNATIVE_COST * cost(&first) { alternative } else { first }
}

/// The candidate in which a quickly built tree is so much cheaper that the mesh is rotated; `None` for the axes of the space.
fn rotation(
    candidates: Vec<[[f32; 3]; 3]>,
    unrotated: &[Aabb],
    boxes_along: &(dyn Fn(&[[f32; 3]; 3]) -> Vec<Aabb> + Sync),
    scale: f32,
    config: &Config,
) -> Option<[[f32; 3]; 3]> {
    if candidates.is_empty() {
        return None;
    }
    let quick = |boxes: &[Aabb]| {
        let (tree, aligned) = built(boxes, &Builder::Ploc(PlocConfig::NEAR, None), scale);
        cost(&tree, &aligned, &compared(&config.costs))
    };
    let (unrotated, rotated) =
        par::join(|| quick(unrotated), || par::map(&candidates, 1, 0.0, |rows| quick(&boxes_along(rows))));
    let (least, rows) = rotated.into_iter().zip(candidates).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (least <= MAX_ROTATED_COST * unrotated).then_some(rows)
}

/// Costs by which trees are compared.
fn compared(costs: &Costs) -> Costs {
    Costs { max_leaf: costs.max_leaf.min(MAX_COMPARED_LEAF), ..*costs }
}

/// Predicted cost of a tree that is collapsed into aligned nodes only.
pub(crate) fn cost(tree: &Tree, aligned: &Aligned, costs: &Costs) -> f32 {
    let Some(root) = tree.root() else { return 0.0 };
    let areas = |areas: &[f32]| -> Vec<Areas> { areas.iter().map(|&a| Areas::new(a, a)).collect() };
    let (inner, leaf) = (areas(&aligned.inner_areas), areas(&aligned.leaf_areas));
    Plan::new(tree, &inner, &leaf, costs, false).cost(root)
}

fn built(boxes: &[Aabb], builder: &Builder, scale: f32) -> (Tree, Aligned) {
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
    let tree = canted_sah::build(boxes, &bounds, builder);
    let aligned = Aligned::of(&tree, boxes, scale);
    (tree, aligned)
}
