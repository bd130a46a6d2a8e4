//! Which binary tree is collapsed, and in which frame it stands.

use canted_lbvh::{Corners, Tree};
use canted_obb::{Aabb, Obb};
use canted_sah::{Builder, PlocConfig};

use crate::collapse::{Areas, Plan};
use crate::frames::mesh_frame::{self, MeshFrameConfig};
use crate::measure::{self, Aligned};
use crate::{Config, Costs, par};

/// A binary tree over triangles and the axes of its boxes.
pub(crate) struct Chosen {
    pub(crate) tree: Tree,
    pub(crate) rows: [[f32; 3]; 3],
    pub(crate) aligned: Aligned,
    /// Brings the largest extent to about 1.
    pub(crate) scale: f32,
}

/// The mesh is turned where the cheap tree's cost falls to this part.
///
/// Cheap and full costs agree on eleven scenes with any threshold from 0.85 to 0.89.
const WORTH_TURNING: f32 = 0.87;

/// The rival's tree is taken at this part of the other's cost: nearer, the prediction says nothing.
///
/// A scan just below it traces faster in the rival's tree: `benches/TRIED.md`.
const WORTH_CHANGING: f32 = 0.985;

/// Most triangles of a leaf where trees are compared before their frames are known.
///
/// Larger leaves hide what leaning boxes would part: where one holds two struts of twelve triangles, a tree that mixes
/// struts is foretold less cost and traces slower, as measured in `benches/TRIED.md`.
const MAX_COMPARED_LEAF: usize = 16;

/// Builds the binary tree.
pub(crate) fn choose(corners: &[Corners], bounds: &Aabb, config: &Config) -> Chosen {
    let scale = measure::unit_scale(bounds);
    let straight = measure::boxes(corners, Obb::IDENTITY_FRAME);
    let (rows, boxes) = match turned(corners, &straight, scale, config) {
        Some(rows) => (rows, measure::boxes(corners, rows)),
        None => (Obb::IDENTITY_FRAME, straight),
    };
    let (tree, aligned) = over_boxes(&boxes, scale, config);
    Chosen { tree, rows, aligned, scale }
}

/// Builds the binary tree over boxes that stand in one frame.
pub(crate) fn over_boxes(boxes: &[Aabb], scale: f32, config: &Config) -> (Tree, Aligned) {
    let own = || built(boxes, &config.builder, scale);
    let Some(rival) = &config.alternative_builder else { return own() };
    // Each has serial parts of its own.
    let (own, rival) = par::join(own, || built(boxes, rival, scale));
    let costs = compared(&config.costs);
    let cost = |(tree, aligned): &(Tree, Aligned)| cost(tree, aligned, &costs);
    if cost(&rival) <= WORTH_CHANGING * cost(&own) { rival } else { own }
}

/// The axes that make a cheap tree so much cheaper that the mesh is worth turning; `None` for its own.
fn turned(corners: &[Corners], straight: &[Aabb], scale: f32, config: &Config) -> Option<[[f32; 3]; 3]> {
    if !config.rotate_mesh {
        return None;
    }
    let candidates = mesh_frame::candidates(corners, &MeshFrameConfig::default());
    if candidates.is_empty() {
        return None;
    }
    let cheap = |boxes: &[Aabb]| {
        let (tree, aligned) = built(boxes, &Builder::Ploc(PlocConfig::NEAR, None), scale);
        cost(&tree, &aligned, &compared(&config.costs))
    };
    let in_frame = |rows: &[[f32; 3]; 3]| cheap(&measure::boxes(corners, *rows));
    let (straight, turned) = par::join(|| cheap(straight), || par::map(&candidates, 1, 0.0, in_frame));
    let (least, rows) = turned.into_iter().zip(candidates).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (least <= WORTH_TURNING * straight).then_some(rows)
}

/// Costs by which trees are compared.
fn compared(costs: &Costs) -> Costs {
    Costs { max_leaf: costs.max_leaf.min(MAX_COMPARED_LEAF), ..*costs }
}

/// Predicted cost of collapsing a tree without leaning nodes.
pub(crate) fn cost(tree: &Tree, aligned: &Aligned, costs: &Costs) -> f32 {
    let Some(root) = tree.root() else { return 0.0 };
    let inner: Vec<Areas> = aligned.inner_areas.iter().map(|&a| Areas::new(a, a)).collect();
    let leaf = |place: u32| Areas::new(aligned.leaf_areas[place as usize], f32::MAX);
    Plan::new(tree, &inner, &leaf, costs, false).cost(root)
}

fn built(boxes: &[Aabb], builder: &Builder, scale: f32) -> (Tree, Aligned) {
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
    let tree = canted_sah::build(boxes, &bounds, builder);
    let aligned = Aligned::of(&tree, boxes, scale);
    (tree, aligned)
}
