//! What a ray is predicted to cost in the boxes as they are.

use canted_lbvh::Corners;
use canted_obb::Aabb;

use super::boxes::half_area;
use super::outline::{Outline, Slot};
use crate::Costs;
use crate::emit::Records;

/// Prices of visits, and what the tree cost when its boxes were fresh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wear {
    pub(crate) costs: Costs,
    /// Predicted costs before the first refit, from which on they are known.
    pub(crate) fresh: Option<Prediction>,
}

impl Wear {
    /// Of a tree just built.
    pub(crate) fn new(costs: Costs) -> Self {
        Self { costs, fresh: None }
    }
}

/// What rays are predicted to cost, in visits of box nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prediction {
    /// For a ray that enters the box around the mesh.
    pub(crate) per_ray: f32,
    /// For as many such rays as meet one triangle on average; zero where triangles have no area.
    pub(crate) per_triangle: f32,
}

/// Predicts costs in the boxes as they are, around `corners`, which `bounds` enclose.
///
/// A ray enters a convex body inside another with the probability of their surface areas' ratio; where `bounds` have
/// no area, every ray that meets one thing meets all. Summed in a fixed order.
pub(crate) fn predict(
    outline: &Outline,
    records: &Records,
    corners: &[Corners],
    bounds: &Aabb,
    costs: &Costs,
) -> Prediction {
    let all = 0.5 * bounds.area();
    let share = |area: f64| if all > 0.0 { (area / all).min(1.0) } else { 1.0 };
    let mut sum = match (outline.nodes.first(), outline.leaves.first()) {
        (Some(_), _) => visit(outline, Slot::Node(0), costs),
        (None, Some(_)) => visit(outline, Slot::Leaf(0), costs),
        (None, None) => 0.0,
    };
    for node in &outline.nodes {
        for (i, &slot) in node.slots.iter().enumerate() {
            if slot != Slot::Nothing {
                sum += share(half_area(node, &records.lines, i)) * visit(outline, slot, costs);
            }
        }
    }
    let of_triangles: f64 = corners.iter().map(area).sum();
    let per_triangle = if of_triangles > 0.0 { sum * all / of_triangles } else { 0.0 };
    Prediction { per_ray: rounded(sum), per_triangle: rounded(per_triangle) }
}

/// A prediction in `f32`, finite.
#[expect(clippy::cast_possible_truncation, reason = "a prediction, clamped")]
fn rounded(x: f64) -> f32 {
    x.min(f64::from(f32::MAX)) as f32
}

/// Area of a triangle.
fn area(corners: &Corners) -> f64 {
    let [a, b, c] = corners.map(|vertex| vertex.map(f64::from));
    let edge = |to: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| to[k] - a[k]) };
    let (u, v) = (edge(b), edge(c));
    let normal: [f64; 3] = std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        u[i] * v[j] - u[j] * v[i]
    });
    0.5 * normal.iter().map(|x| x * x).sum::<f64>().sqrt()
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
