//! Which binary tree is collapsed, and in which frame it stands.

use canted_lbvh::{self as lbvh, Bits, Corners, Domain, Tree};
use canted_obb::{Aabb, Obb};
use canted_sah::{PlocConfig, ReinsertConfig, TopDownConfig};

use crate::collapse::{Areas, Plan};
use crate::frames::mesh_frame::{self, MeshFrameConfig};
use crate::measure::{self, Aligned};
use crate::{BinaryTree, Config, Costs};

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

/// The tree split in bins is taken at this part of the other's cost: a prediction this near is none.
const WORTH_SPLITTING: f32 = 0.98;

/// Builds the binary tree.
pub(crate) fn choose(corners: &[Corners], bounds: &Aabb, config: &Config) -> Chosen {
    let scale = measure::unit_scale(bounds);
    let straight = measure::boxes(corners, Obb::IDENTITY_FRAME);
    let (rows, boxes) = match turned(corners, &straight, scale, config) {
        Some(rows) => (rows, measure::boxes(corners, rows)),
        None => (Obb::IDENTITY_FRAME, straight),
    };
    let (tree, aligned) = match config.binary {
        BinaryTree::Radix => {
            let tree = lbvh::radix(by_code(&boxes));
            let aligned = Aligned::of(&tree, &boxes, scale);
            (tree, aligned)
        }
        BinaryTree::Ploc(ploc, reinsertion) => joined(&boxes, &ploc, reinsertion.as_ref(), scale),
        BinaryTree::Better(ploc, reinsertion) => {
            let (tree, aligned) = joined(&boxes, &ploc, Some(&reinsertion), scale);
            let split = canted_sah::top_down(&boxes, &TopDownConfig::default());
            let split_aligned = Aligned::of(&split, &boxes, scale);
            let is_better = cost(&split, &split_aligned, &config.costs)
                <= WORTH_SPLITTING * cost(&tree, &aligned, &config.costs);
            if is_better { (split, split_aligned) } else { (tree, aligned) }
        }
    };
    Chosen { tree, rows, aligned, scale }
}

/// The axes that make a cheap tree so much cheaper that the mesh is worth turning; `None` for its own.
fn turned(corners: &[Corners], straight: &[Aabb], scale: f32, config: &Config) -> Option<[[f32; 3]; 3]> {
    if !config.turn {
        return None;
    }
    let candidates = mesh_frame::candidates(corners, &MeshFrameConfig::default());
    if candidates.is_empty() {
        return None;
    }
    let cheap = |boxes: &[Aabb]| {
        let (tree, aligned) = joined(boxes, &PlocConfig::default(), None, scale);
        cost(&tree, &aligned, &config.costs)
    };
    let mut least = WORTH_TURNING * cheap(straight);
    let mut best = None;
    for rows in candidates {
        let cost = cheap(&measure::boxes(corners, rows));
        if cost <= least {
            (least, best) = (cost, Some(rows));
        }
    }
    best
}

/// Predicted cost of collapsing a tree without leaning nodes.
fn cost(tree: &Tree, aligned: &Aligned, costs: &Costs) -> f32 {
    let Some(root) = tree.root() else { return 0.0 };
    let inner: Vec<Areas> = aligned.inner_areas.iter().map(|&a| Areas::new(a, a)).collect();
    let leaf = |place: u32| Areas::new(aligned.leaf_areas[place as usize], f32::MAX);
    Plan::new(tree, &inner, &leaf, costs, false).cost(root)
}

fn by_code(boxes: &[Aabb]) -> lbvh::Sorted {
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
    // By the middles of their boxes the two halves of a rectangle stand side by side.
    lbvh::by_code(&lbvh::codes_of_boxes(&Domain::new(&bounds, 2, Bits::B63), boxes), Bits::B63)
}

fn joined(
    boxes: &[Aabb],
    ploc: &PlocConfig,
    reinsertion: Option<&ReinsertConfig>,
    scale: f32,
) -> (Tree, Aligned) {
    let sorted = by_code(boxes);
    let in_order: Vec<Aabb> = sorted.leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
    let mut tree = canted_sah::ploc(sorted, &in_order, ploc);
    if let Some(reinsertion) = reinsertion {
        let in_order: Vec<Aabb> = tree.leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
        tree = canted_sah::reinsert(&tree, &in_order, reinsertion);
    }
    let aligned = Aligned::of(&tree, boxes, scale);
    (tree, aligned)
}
