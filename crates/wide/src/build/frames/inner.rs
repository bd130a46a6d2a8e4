//! The frame of an inner node, chosen among few.

use std::ops::RangeInclusive;

use canted_obb::Moments;
use glam::Vec3A;

use super::fitted::{Fitted, half_area, principal_frame};
use super::vector::{from_glam, to_glam};
use super::{Fit, MIN_GAIN};

/// What is carried up of the primitives below a node.
#[derive(Clone, Copy)]
pub(super) struct Below {
    /// Of their surfaces, for principal axes.
    moments: Moments,
    /// Position of the one of greatest weight.
    largest: u32,
    /// Its weight: of triangles the area, in squares of the scaled unit.
    largest_weight: f64,
}

/// Most leaves of a node that tries all frames of its largest primitive. Nodes above inherit what they found.
///
/// `benches/TRIED.md` lists what this shortcut and the two below save in time and cost in area.
const ALL_FRAMES_LEAVES: usize = 4;

/// More leaves than this are ranked by some of them only, at least half as many, evenly spaced.
const RANKED_LEAVES: usize = 64;

/// A box larger by this part than the larger child's is good enough: no frame makes it smaller than the child's best.
const ENOUGH: f32 = 0.05;

impl Below {
    /// Nothing.
    pub(super) const NOTHING: Self = Self { moments: Moments::EMPTY, largest: 0, largest_weight: 0.0 };

    /// One primitive.
    pub(super) fn of_leaf<F: Fitted>(items: &[F], position: usize) -> Self {
        let moments = items[position].moments();
        Self { moments, largest: position as u32, largest_weight: moments.weight }
    }

    /// Two parts together.
    #[inline]
    pub(super) fn joined(a: &Self, b: &Self) -> Self {
        let larger = if b.largest_weight > a.largest_weight { b } else { a };
        Self { moments: a.moments.merged(&b.moments), ..*larger }
    }
}

/// The frame of least area found for the items of `range`: `aligned`, the box in the mesh frame, or one of the children's, of
/// the largest item, or of the principal axes.
pub(super) fn fit<F: Fitted>(
    all: &[F],
    range: RangeInclusive<usize>,
    below: &Below,
    children: [Fit; 2],
    aligned: Fit,
) -> Fit {
    let items = &all[range];
    let enough = (1.0 + ENOUGH) * children[0].half_area.max(children[1].half_area);
    let most = (1.0 - MIN_GAIN) * aligned.half_area;
    let mut choice = Choice { items, stride: stride(items.len()), enough, rows: None, half_area: most };
    if aligned.half_area <= enough {
        return aligned;
    }
    for child in children.iter().filter(|child| child.rows != aligned.rows) {
        choice.offer(|| Some(to_glam(child.rows)));
    }
    // The largest item's best frame is that of a leaf, and inherited.
    if items.len() <= ALL_FRAMES_LEAVES && choice.is_open() {
        for rows in all[below.largest as usize].other_frames() {
            choice.offer(|| Some(rows));
        }
    }
    choice.offer(|| principal_frame(&below.moments));
    let Some(rows) = choice.rows else { return aligned };
    let mut half_area = choice.half_area;
    if choice.stride > 1 {
        half_area = super::half_area(F::extents(items, 1, &rows));
    }
    if half_area < most { Fit { rows: from_glam(rows), half_area } } else { aligned }
}

/// The frame of least area so far.
struct Choice<'a, F> {
    items: &'a [F],
    stride: usize,
    enough: f32,
    rows: Option<[Vec3A; 3]>,
    half_area: f32,
}

impl<F: Fitted> Choice<'_, F> {
    /// Whether no frame is good enough yet.
    fn is_open(&self) -> bool {
        self.half_area > self.enough
    }

    /// Takes the frame that `make` returns where it has less area; `make` is not called where there is a good one.
    #[inline]
    fn offer(&mut self, make: impl FnOnce() -> Option<[Vec3A; 3]>) {
        if !self.is_open() {
            return;
        }
        let Some(rows) = make() else { return };
        let half_area = half_area(F::extents(self.items, self.stride, &rows));
        if half_area < self.half_area {
            (self.rows, self.half_area) = (Some(rows), half_area);
        }
    }
}

/// The step between the leaves that rank the frames of a node of `n` leaves.
fn stride(n: usize) -> usize {
    (n / RANKED_LEAVES + 1).min(n.max(1))
}
