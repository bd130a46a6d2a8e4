//! Which leaning nodes do with one frame for all their children.

use canted_lbvh::Child;
use glam::Vec3A;

use crate::collapse::Plan;
use crate::emit::{Source, range};
use crate::layout::NodeKind;

/// Nodes over more leaves keep a frame for each child: their children seldom agree, and to ask costs time.
const MAX_LEAVES: u32 = 512;

/// Children whose frames are tried for all, those of largest area.
const TRIED: usize = 3;

/// The frame in which boxes around all children cost less than each child's own frame saves; `None` where none does.
///
/// Reads: a leaning node of the plan, its children by falling area. Holds: rows are those of a child's frame.
/// Source: Woop et al. 2014, whose nodes share one frame.
pub(crate) fn shared_frame(source: &Source, plan: &Plan, node: Child, children: &[Child]) -> Option<[[f32; 3]; 3]> {
    let (start, end) = range(source.tree, node);
    if end - start > MAX_LEAVES {
        return None;
    }
    let costs = plan.costs();
    let own: f32 = children.iter().map(|&child| plan.area(child, NodeKind::Lean) * plan.visit(child)).sum();
    let saved = plan.area(node, NodeKind::Lean) * (costs.lean_node - costs.shared_node);
    let mut most = own + saved;
    let mut best = None;
    for &candidate in children.iter().take(TRIED) {
        let rows = (source.frames)(candidate);
        let mut cost = 0.0;
        for &child in children {
            cost += half_area(source, child, rows) * plan.visit(child);
            if cost >= most {
                break;
            }
        }
        if cost < most {
            (most, best) = (cost, Some(rows));
        }
    }
    best
}

/// Half of the surface area of the box along `rows` around all vertices below, in the plan's unit; an estimate.
fn half_area(source: &Source, child: Child, rows: [[f32; 3]; 3]) -> f32 {
    let (start, end) = range(source.tree, child);
    let columns: [Vec3A; 3] = std::array::from_fn(|axis| Vec3A::new(rows[0][axis], rows[1][axis], rows[2][axis]));
    let (mut lo, mut hi) = (Vec3A::MAX, Vec3A::MIN);
    for &[x, y, z] in source.corners[start as usize..end as usize].iter().flatten() {
        let place = columns[0] * x + columns[1] * y + columns[2] * z;
        (lo, hi) = (lo.min(place), hi.max(place));
    }
    let extent = (hi - lo) * source.scale;
    extent.x * extent.y + extent.y * extent.z + extent.z * extent.x
}
