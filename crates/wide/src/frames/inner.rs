//! The frame of an inner node, chosen among few.

use canted_obb::{Moments, eigen};
use glam::Vec3A;

use super::leaf::Edges;
use super::points::{Points, Triangle, extents, half_area};
use super::vector::{from_glam, to_glam};
use super::{Fit, FrameConfig, MIN_GAIN, refine};

/// What is carried up of the triangles below a node.
#[derive(Clone, Copy)]
pub(super) struct Below {
    /// Of their surfaces, for principal axes.
    moments: Moments,
    /// Position of the one of largest area.
    largest: u32,
    /// Its area, in squares of the scaled unit.
    largest_area: f64,
}

/// Most leaves of a node that tries all edges of its largest triangle: the sides of a rectangle are edges of its two
/// triangles, but not the longest. Nodes above inherit what they found.
///
/// What this shortcut and the two below save in time and cost in area stands in `benches/TRIED.md`.
const EDGES_LEAVES: usize = 4;

/// More leaves than this are ranked by some of them only, at least half as many, evenly spaced.
const RANKED_LEAVES: usize = 64;

/// A box larger by this part than the larger child's is good enough: no frame makes it smaller than the child's best.
const ENOUGH: f32 = 0.05;

impl Below {
    /// Nothing.
    pub(super) const NOTHING: Self = Self { moments: Moments::EMPTY, largest: 0, largest_area: 0.0 };

    /// One triangle.
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 leaves")]
    pub(super) fn of_leaf(points: &Points, position: usize) -> Self {
        let moments = Moments::from_triangle(points.triangles()[position].vertices().map(|v| v.to_array()));
        Self { moments, largest: position as u32, largest_area: moments.weight }
    }

    /// Two parts together.
    #[inline]
    pub(super) fn joined(a: &Self, b: &Self) -> Self {
        let larger = if b.largest_area > a.largest_area { b } else { a };
        Self { moments: a.moments.merged(&b.moments), ..*larger }
    }
}

/// The frame of least area found for `triangles`: `straight`, the box in the mesh's frame, or one of the children's,
/// of edges, of the principal axes, turned where `config` says so.
pub(super) fn fit(
    points: &Points,
    triangles: &[Triangle],
    below: &Below,
    children: [Fit; 2],
    straight: Fit,
    config: &FrameConfig,
) -> Fit {
    let enough = (1.0 + ENOUGH) * children[0].half_area.max(children[1].half_area);
    let most = (1.0 - MIN_GAIN) * straight.half_area;
    let mut choice = Choice { triangles, stride: stride(triangles.len()), enough, rows: None, half_area: most };
    if straight.half_area <= enough {
        return straight;
    }
    for child in children.iter().filter(|child| child.rows != straight.rows) {
        choice.offer(|| Some(to_glam(child.rows)));
    }
    if triangles.len() <= EDGES_LEAVES {
        let edges = Edges::of(&points.triangles()[below.largest as usize]);
        // The frame along the longest is that of a leaf, and inherited.
        let longest = edges.longest();
        for edge in [(longest + 1) % 3, (longest + 2) % 3] {
            choice.offer(|| edges.frame_along(edge));
        }
    }
    choice.offer(|| Some(to_glam(below.moments.axes(eigen::COARSE))));
    let Some(mut rows) = choice.rows else { return straight };
    let mut half_area = choice.half_area;
    if config.rounds > 0 && triangles.len() <= refine::MAX_LEAVES {
        (rows, half_area) = refine::turned(triangles, rows, config.rounds);
    } else if choice.stride > 1 {
        half_area = super::points::half_area(extents(triangles, 1, &rows));
    }
    if half_area < most { Fit { rows: from_glam(rows), half_area } } else { straight }
}

/// The frame of least area so far.
struct Choice<'a> {
    triangles: &'a [Triangle],
    stride: usize,
    enough: f32,
    rows: Option<[Vec3A; 3]>,
    half_area: f32,
}

impl Choice<'_> {
    /// Takes the frame that `make` makes where it has less area; it is not made where there is a good one.
    #[inline]
    fn offer(&mut self, make: impl FnOnce() -> Option<[Vec3A; 3]>) {
        if self.half_area <= self.enough {
            return;
        }
        let Some(rows) = make() else { return };
        let half_area = half_area(extents(self.triangles, self.stride, &rows));
        if half_area < self.half_area {
            (self.rows, self.half_area) = (Some(rows), half_area);
        }
    }
}

/// One leaf in how many ranks the frames of a node of `n` leaves.
fn stride(n: usize) -> usize {
    (n / RANKED_LEAVES + 1).min(n.max(1))
}
