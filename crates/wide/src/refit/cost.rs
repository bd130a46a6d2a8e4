//! The predicted traversal cost with the boxes as they are.

use canted_obb::Aabb;

use super::boxes::Boxes;
use crate::costs::{Costs, RayCost};
use crate::outline::{Outline, Slot};
use crate::par;

/// Nodes of one job.
const CHUNK: usize = 1 << 10;

/// Predicts costs with the boxes as they are, without their padding; `bounds` enclose all primitives, whose areas sum to `area`.
///
/// A ray enters a convex body inside another with the probability of the ratio of their surface areas; where `bounds` have
/// no area, every ray enters all boxes. Summed in a fixed order.
pub(super) fn predict(outline: &Outline, boxes: &Boxes, area: f64, bounds: &Aabb, costs: &Costs) -> RayCost {
    let all = 0.5 * bounds.area();
    let probability = |area: f64| if all > 0.0 { (area / all).min(1.0) } else { 1.0 };
    let mut sum = match (outline.nodes.first(), outline.leaves.first()) {
        (Some(_), _) => visit(outline, Slot::Node(0), costs),
        (None, Some(_)) => visit(outline, Slot::Leaf(0), costs),
        (None, None) => 0.0,
    };
    let of_children = par::map_chunks(&outline.nodes, CHUNK, |_, nodes| {
        let mut sum = 0.0;
        for node in nodes {
            for (i, &slot) in node.slots.iter().enumerate() {
                if slot != Slot::Empty {
                    sum += probability(boxes.half_area(node, i)) * visit(outline, slot, costs);
                }
            }
        }
        sum
    });
    sum += of_children.into_iter().sum::<f64>();
    let per_primitive = if area > 0.0 { sum * all / area } else { 0.0 };
    RayCost { per_ray: rounded(sum), per_primitive: rounded(per_primitive) }
}

/// A prediction in `f32`, finite.
#[expect(clippy::cast_possible_truncation, reason = "a prediction, clamped")]
fn rounded(x: f64) -> f32 {
    x.min(f64::from(f32::MAX)) as f32
}

/// Cost of visiting the content of a slot.
fn visit(outline: &Outline, slot: Slot, costs: &Costs) -> f64 {
    match slot {
        Slot::Empty => 0.0,
        Slot::Node(node) => f64::from(costs.node(outline.nodes[node].kind)),
        Slot::Leaf(leaf) => {
            let n_blocks = outline.leaves[leaf].places.len().div_ceil(8);
            #[expect(clippy::cast_precision_loss, reason = "at most four blocks")]
            let blocks = f64::from(costs.block) * n_blocks as f64;
            f64::from(costs.leaf) + blocks
        }
    }
}
