use canted_lbvh::{Child, ChildKind, Corners, Tree, Volume, Volumes};
use canted_obb::vector::{add, cross, length, sub};

/// End-point overlap: surface area inside nodes that do not contain it, relative to all surface area.
///
/// Each node counts the area of the triangles that lie inside its volume but not below it. Every `stride`-th triangle
/// is clipped and represents the skipped ones; 1 takes all. Source: Aila, Karras & Laine 2013, with equal node costs.
pub(super) fn end_point_overlap(tree: &Tree, volumes: &Volumes, leaves: &[Corners], stride: usize) -> f64 {
    let (mut overlapping, mut total) = (0.0, 0.0);
    let mut stack = vec![];
    for (position, corners) in (0u32..).zip(leaves).step_by(stride.max(1)) {
        let polygon: Vec<[f64; 3]> = corners.iter().map(|p| p.map(f64::from)).collect();
        total += area(&polygon);
        stack.extend(tree.root());
        while let Some(child) = stack.pop() {
            let ChildKind::Inner(id) = Child::kind(child) else { continue };
            let inside = clip(polygon.clone(), volumes.of(id));
            if inside.len() < 3 {
                continue;
            }
            let node = &tree.nodes[id.index()];
            if !(node.first..=node.last).contains(&position) {
                overlapping += area(&inside);
            }
            stack.extend([node.left, node.right]);
        }
    }
    if total > 0.0 { overlapping / total } else { 0.0 }
}

/// Area of a planar polygon.
fn area(polygon: &[[f64; 3]]) -> f64 {
    let area = |pair: &[[f64; 3]]| cross(sub(pair[0], polygon[0]), sub(pair[1], polygon[0]));
    0.5 * length(polygon[1..].windows(2).map(area).fold([0.0; 3], add))
}

/// The part of a polygon inside a volume (Sutherland & Hodgman 1974).
fn clip(mut polygon: Vec<[f64; 3]>, volume: Volume<'_>) -> Vec<[f64; 3]> {
    let (center, frame, half) = match volume {
        Volume::Aabb(aabb) => {
            (aabb.center(), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], aabb.extent().map(|e| 0.5 * e))
        }
        Volume::Obb(obb) => {
            (obb.center.map(f64::from), obb.frame.map(|axis| axis.map(f64::from)), obb.half_extents.map(f64::from))
        }
    };
    for k in 0..3 {
        for side in [1.0, -1.0] {
            // Signed distance beyond the face; volumes are convex, so each face clips once.
            let beyond = |p: &[f64; 3]| side * (0..3).map(|i| (p[i] - center[i]) * frame[k][i]).sum::<f64>() - half[k];
            let mut kept = Vec::with_capacity(polygon.len() + 1);
            for (i, p) in polygon.iter().enumerate() {
                let next = &polygon[(i + 1) % polygon.len()];
                let (here, there) = (beyond(p), beyond(next));
                if here <= 0.0 {
                    kept.push(*p);
                }
                if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
                    let s = here / (here - there);
                    kept.push(std::array::from_fn(|i| p[i] + s * (next[i] - p[i])));
                }
            }
            polygon = kept;
        }
    }
    polygon
}

#[cfg(test)]
mod tests {
    use super::*;
    use canted_obb::Aabb;

    #[test]
    fn clipping_a_triangle_by_a_box_keeps_the_right_area() {
        let triangle = vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        let unit = Aabb { min: [0.0, 0.0, -1.0], max: [1.0, 1.0, 1.0] };
        // Few bits: nothing is rounded.
        assert_eq!(area(&clip(triangle.clone(), Volume::Aabb(&unit))), 1.0);
        let off = Aabb { min: [3.0; 3], max: [4.0; 3] };
        assert!(clip(triangle, Volume::Aabb(&off)).len() < 3);
    }
}
