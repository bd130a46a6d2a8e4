//! The frame of one triangle.

use glam::Vec3A;

use super::points::{Triangle, extents, half_area};
use super::vector::{frame, from_glam};
use super::{Fit, MIN_GAIN};

/// Brings edges to a size at which no product of three underflows or overflows: from 1e-9 of the scene to all of it.
const ENLARGED: f32 = 4096.0;

/// The rectangle along the longest edge where it has less area than `straight`, the box in the mesh's frame.
///
/// Of all rectangles around a triangle it is the smallest: twice the triangle.
pub(super) fn fit(triangle: &Triangle, straight: Fit) -> Fit {
    let most = (1.0 - MIN_GAIN) * straight.half_area;
    let edges = Edges::of(triangle);
    // Half of the surface area of a flat box is the rectangle.
    if edges.normal.length_squared() >= (most * ENLARGED * ENLARGED).powi(2) {
        return straight;
    }
    let Some(rows) = edges.frame_along(edges.longest()) else { return straight };
    let half_area = half_area(extents(std::slice::from_ref(triangle), 1, &rows));
    if half_area < most { Fit { rows: from_glam(rows), half_area } } else { straight }
}

/// Edges of a triangle and its normal, enlarged.
pub(super) struct Edges {
    edges: [Vec3A; 3],
    normal: Vec3A,
}

impl Edges {
    /// Of this triangle.
    #[inline]
    pub(super) fn of(triangle: &Triangle) -> Self {
        let [a, b, c] = triangle.vertices();
        let edges = [(b - a) * ENLARGED, (c - b) * ENLARGED, (a - c) * ENLARGED];
        Self { edges, normal: edges[0].cross(edges[1]) }
    }

    /// Which edge is the longest.
    #[inline]
    pub(super) fn longest(&self) -> usize {
        let squares = self.edges.map(Vec3A::length_squared);
        (1..3).fold(0, |best, k| if squares[k] > squares[best] { k } else { best })
    }

    /// The frame along an edge and the normal; `None` where edge or normal is too short.
    #[inline]
    pub(super) fn frame_along(&self, edge: usize) -> Option<[Vec3A; 3]> {
        frame(self.edges[edge], self.normal)
    }
}
