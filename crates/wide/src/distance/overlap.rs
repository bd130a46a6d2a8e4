//! All primitives that overlap a region.

use canted_obb::{Obb, PrimId};
use canted_trace::Convex;

use super::nearest::{Within, squared};
use crate::layout::{Word, WordKind};
use crate::{Primitive, WideBvh};

/// Rounding of a box corner and its projections, relative to the coordinates: f32 rows, and sums in f64; eight u.
const CORNER_ERROR: f64 = 8.0 / 16_777_216.0;

impl<P: Primitive> WideBvh<P> {
    /// All primitives that overlap the axis-aligned box from `min` to `max`, touching included, in ascending order.
    ///
    /// No overlap is missed; a gap below 2^-46 of the coordinates may be reported as an overlap, as in all overlap queries.
    /// Replaces the contents of `primitives`.
    pub fn overlapping_aabb(
        &self,
        min: impl Into<[f32; 3]>,
        max: impl Into<[f32; 3]>,
        primitives: &mut Vec<PrimId>,
    ) {
        self.overlapping(&Convex::from_aabb(min, max), primitives);
    }

    /// All primitives that overlap an oriented box; see [`WideBvh::overlapping_aabb`].
    pub fn overlapping_obb(&self, obb: &Obb, primitives: &mut Vec<PrimId>) {
        self.overlapping(&Convex::from_obb(obb), primitives);
    }

    /// All primitives that overlap a frustum or another convex solid; see [`WideBvh::overlapping_aabb`].
    pub fn overlapping(&self, region: &Convex, primitives: &mut Vec<PrimId>) {
        primitives.clear();
        let mut waiting = vec![self.records.root];
        while let Some(word) = waiting.pop() {
            match word.kind() {
                WordKind::Empty => {}
                WordKind::Leaf { first, n } => self.for_each_in_leaf(first, n, |primitive, shape| {
                    if shape.overlaps(region) {
                        primitives.push(primitive);
                    }
                }),
                WordKind::Node(kind, line) => {
                    let words: [Word; 8] = *crate::layout::node_words(&self.records.lines, kind, line);
                    let boxes = crate::layout::node_boxes(&self.records.lines, kind, line, &self.frame.rows);
                    for (word, (rows, lo, hi)) in words.into_iter().zip(boxes) {
                        if word != Word::EMPTY && may_overlap(region, rows, lo, hi) {
                            waiting.push(word);
                        }
                    }
                }
            }
        }
        primitives.sort_unstable();
        primitives.dedup();
    }

    /// All primitives at most `radius` away from `center`, in ascending order. Replaces the contents of `primitives`.
    pub fn overlapping_sphere(&self, center: impl Into<[f32; 3]>, radius: f32, primitives: &mut Vec<PrimId>) {
        primitives.clear();
        let Some(limit) = squared(radius) else { return };
        self.collect_near(center.into(), &mut Within { primitives, limit });
        primitives.sort_unstable();
        primitives.dedup();
    }
}

/// Whether a box `lo <= rows·x <= hi` may share a point with the region: by the box's axes, then by the region's.
fn may_overlap(region: &Convex, rows: [[f32; 3]; 3], lo: [f64; 3], hi: [f64; 3]) -> bool {
    let rows = rows.map(|row| row.map(f64::from));
    let reach = lo.iter().chain(&hi).fold(region.magnitude(), |most, x| most.max(x.abs()));
    let by_box = (0..3).all(|k| {
        let [min, max] = region.interval(rows[k]);
        let slack = CORNER_ERROR * reach;
        min - slack <= hi[k] && max + slack >= lo[k]
    });
    // With R·Rᵀ = I + E and ‖E‖ <= 1/4 the transposed rows are the inverse up to 1.2·‖E‖; a vector's length is at most
    // √3 times its greatest component.
    let skew = 3.0 * (0..3).map(|k| deviation(rows, k)).sum::<f64>() + CORNER_ERROR;
    if !by_box || skew > 0.25 {
        return by_box;
    }
    region.normals().iter().all(|&normal| {
        // The box's center and radius along the normal.
        let length = normal.iter().map(|x| x.abs()).sum::<f64>();
        let (mut center, mut radius) = (0.0, skew * length * reach);
        for k in 0..3 {
            let along = rows[k][0] * normal[0] + rows[k][1] * normal[1] + rows[k][2] * normal[2];
            center += 0.5 * (lo[k] + hi[k]) * along;
            radius += 0.5 * (hi[k] - lo[k]) * along.abs();
        }
        let [min, max] = region.interval(normal);
        min <= center + radius && max >= center - radius
    })
}

/// How far a row is from unit length and from right angles with the others.
fn deviation(rows: [[f64; 3]; 3], k: usize) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    (0..3).map(|i| (dot(rows[k], rows[i]) - if i == k { 1.0 } else { 0.0 }).abs()).sum()
}
