//! What a ray is predicted to cost in the boxes as they are.

use super::boxes::half_area;
use super::outline::{Outline, Slot};
use crate::Costs;
use crate::emit::Records;
use canted_obb::Aabb;

/// Prices of visits, and what the tree cost when its boxes were fresh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wear {
    pub(crate) costs: Costs,
    /// Predicted cost before the first refit, from which on it is known.
    pub(crate) fresh: Option<f32>,
}

impl Wear {
    /// Of a tree just built.
    pub(crate) fn new(costs: Costs) -> Self {
        Self { costs, fresh: None }
    }
}

/// Predicted cost of a ray that enters `bounds`, in visits of box nodes.
///
/// A ray enters a convex body inside another with the probability of their surface areas' ratio; where `bounds` have
/// no area, every ray that meets one thing meets all. Summed in a fixed order.
pub(crate) fn predicted(outline: &Outline, records: &Records, bounds: &Aabb, costs: &Costs) -> f32 {
    let all = 0.5 * bounds.area();
    let share = |area: f64| if all > 0.0 { (area / all).min(1.0) } else { 1.0 };
    let root = match (outline.nodes.first(), outline.leaves.first()) {
        (Some(_), _) => visit(outline, Slot::Node(0), costs),
        (None, Some(_)) => visit(outline, Slot::Leaf(0), costs),
        (None, None) => 0.0,
    };
    let mut sum = root;
    for node in &outline.nodes {
        for (i, &slot) in node.slots.iter().enumerate() {
            if slot != Slot::Nothing {
                sum += share(half_area(node, &records.lines, i)) * visit(outline, slot, costs);
            }
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "a prediction")]
    let sum = sum as f32;
    sum
}

/// Cost of a visit to what a slot holds.
fn visit(outline: &Outline, slot: Slot, costs: &Costs) -> f64 {
    match slot {
        Slot::Nothing => 0.0,
        Slot::Node(node) => f64::from(costs.node(outline.nodes[node].kind)),
        Slot::Leaf(leaf) => {
            let n_blocks = outline.leaves[leaf].places.len().div_ceil(8);
            #[expect(clippy::cast_precision_loss, reason = "at most four blocks")]
            let blocks = f64::from(costs.block) * n_blocks as f64;
            f64::from(costs.leaf) + blocks
        }
    }
}
