//! Whether a padded triangle is in a box, by separating axes.
//!
//! Source: Akenine-Möller 2001. The shape of the padded triangle is a sum of convex shapes, so it is in the box if and only if the triangle
//! is in the box enlarged by the padding.

use canted_lbvh::Corners;
use canted_obb::vector::{cross, dot, reach, sub, to_f64};
use canted_obb::{Aabb, vector::Vector};
use canted_trace::AABB_PAD;

/// A triangle and its padding, a little less than that of the build: what only touches a cell may be in its neighbor.
pub(super) struct Overlap {
    vertices: [Vector; 3],
    pad: f64,
    axes: [Vector; 13],
}

/// What is less than the padding, relative to it. Rounding of a projection in `f64`, relative to ρ∞, is far less.
const TOLERANCE: f64 = 1.0 / (1 << 20) as f64;

impl Overlap {
    pub(super) fn new(corners: &Corners) -> Self {
        let vertices = corners.map(to_f64);
        let [a, b, c] = vertices;
        let edges = [sub(b, a), sub(c, b), sub(a, c)];
        let units: [Vector; 3] = std::array::from_fn(|k| std::array::from_fn(|j| if j == k { 1.0 } else { 0.0 }));
        let mut axes = [cross(edges[0], edges[1]); 13];
        axes[1..4].copy_from_slice(&units);
        for (i, edge) in edges.iter().enumerate() {
            for (k, unit) in units.iter().enumerate() {
                axes[4 + 3 * i + k] = cross(*edge, *unit);
            }
        }
        let reach = vertices.iter().map(|&v| reach(v)).fold(0.0, f64::max);
        Self { vertices, pad: f64::from(AABB_PAD) * reach * (1.0 - TOLERANCE), axes }
    }

    /// Whether a point of the padded triangle is in the box.
    pub(super) fn is_in(&self, aabb: &Aabb) -> bool {
        // Only the part of the box near the triangle matters: rounding is then relative to the triangle, not to the box.
        let end = |pick: fn(f64, f64) -> f64, k: usize| self.vertices.iter().map(|v| v[k]).reduce(pick).unwrap_or(0.0);
        let min: Vector = std::array::from_fn(|k| f64::from(aabb.min[k]).max(end(f64::min, k) - self.pad));
        let max: Vector = std::array::from_fn(|k| f64::from(aabb.max[k]).min(end(f64::max, k) + self.pad));
        if (0..3).any(|k| min[k] > max[k]) {
            return false;
        }
        let center: Vector = std::array::from_fn(|k| 0.5 * (min[k] + max[k]));
        let half: Vector = std::array::from_fn(|k| 0.5 * (max[k] - min[k]) + self.pad);
        let relative = self.vertices.map(|v| sub(v, center));
        self.axes.iter().all(|&axis| {
            let projections = relative.map(|v| dot(axis, v));
            let least = projections.into_iter().fold(f64::INFINITY, f64::min);
            let greatest = projections.into_iter().fold(f64::NEG_INFINITY, f64::max);
            let radius = dot(axis.map(f64::abs), half);
            least <= radius && greatest >= -radius
        })
    }

    /// Whether all points of the padded triangle are in the box.
    pub(super) fn is_within(&self, aabb: &Aabb) -> bool {
        self.vertices.iter().all(|v| {
            (0..3).all(|k| f64::from(aabb.min[k]) <= v[k] - self.pad && v[k] + self.pad <= f64::from(aabb.max[k]))
        })
    }
}
