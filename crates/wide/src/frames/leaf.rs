//! The frame of one triangle.

use glam::Vec3A;

use super::Fit;
use super::points::{Triangle, extents, half_area};
use super::vector::{frame, from_glam};

/// The rectangle along the longest edge where it has less area than `straight`, the box in the mesh's frame.
///
/// Of all rectangles around a triangle it is the smallest.
pub(super) fn fit(triangle: &Triangle, straight: Fit) -> Fit {
    let Some(rows) = frame_along(triangle, 0) else { return straight };
    let half_area = half_area(extents(std::slice::from_ref(triangle), 1, &rows));
    if half_area < straight.half_area { Fit { rows: from_glam(rows), half_area } } else { straight }
}

/// The frame along an edge and the normal, edge 0 the longest; `None` where edge or normal is too short.
pub(super) fn frame_along(triangle: &Triangle, edge: usize) -> Option<[Vec3A; 3]> {
    let [a, b, c] = triangle.vertices();
    let mut edges = [b - a, c - b, a - c];
    let squares = edges.map(Vec3A::length_squared);
    let longest = (1..3).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    edges.rotate_left(longest);
    // The two shorter edges lose least to cancellation. An area is of second order: brought to the order of an edge,
    // that of a small triangle does not underflow when it is squared.
    let normal = edges[1].cross(edges[2]) / squares[longest].sqrt();
    frame(edges[edge], normal)
}
